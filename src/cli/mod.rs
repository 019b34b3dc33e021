//! The commands of the binary: one file per command.

pub mod assess;
mod assess_legs;
pub mod audit;
pub mod backup;
pub mod demo;
pub mod evaluate;
mod housekeeping;
pub mod import;
pub mod import_depth;
pub mod key;
mod method;
mod noise_model;
pub mod openapi;
mod overlay;
pub mod patient;
mod place;
pub mod retention;
pub mod serve;
pub mod simulate;
pub mod simulate_walker;
pub mod telemetry;
pub mod train;
pub mod user;
pub mod worker;

use clap::{Parser, Subcommand};

/// Cloud assessment of human movement: recordings in, joint angles out.
///
/// New here? `surefoot demo` shows the whole journey of one recording in a few seconds.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Serve(serve::Args),
    Worker(worker::Args),
    Assess(assess::Args),
    Import(Import),
    Simulate(Simulate),
    Evaluate(evaluate::Args),
    Train(train::Args),
    Key(key::Args),
    User(user::Args),
    Patient(patient::Args),
    Retention(retention::Args),
    Audit(audit::Args),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
    Doctor(backup::DoctorArgs),
    Openapi(openapi::Args),
}

/// Of a data set, or of what has arguments of its own.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, arg_required_else_help = true)]
struct Import {
    #[command(subcommand)]
    kind: Option<import_depth::Kind>,
    #[command(flatten)]
    dataset: Option<import::Args>,
}

/// Of an exercise, or of what has arguments of its own.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, arg_required_else_help = true)]
struct Simulate {
    #[command(subcommand)]
    kind: Option<simulate_walker::Kind>,
    #[command(flatten)]
    exercise: simulate::Args,
}

/// Runs the command that the arguments name.
///
/// # Errors
/// What the command says went wrong.
pub fn run() -> anyhow::Result<()> {
    let runtime = tokio::runtime::Runtime::new()?;
    match Cli::parse().command {
        Command::Demo(args) => runtime.block_on(demo::run(&args)),
        Command::Assess(args) => assess::run(&args),
        Command::Serve(args) => runtime.block_on(serve::run(&args)),
        Command::Worker(args) => runtime.block_on(worker::run(&args)),
        Command::Import(Import { kind: Some(import_depth::Kind::Depth(args)), .. }) => import_depth::run(&args),
        Command::Import(Import { dataset: Some(args), .. }) => import::run(&args),
        Command::Simulate(Simulate { kind: Some(simulate_walker::Kind::Walker(args)), .. }) => {
            simulate_walker::run(&args)
        }
        Command::Simulate(Simulate { kind: None, exercise }) => simulate::run(&exercise),
        // The parser has asked for arguments already.
        Command::Import(_) => anyhow::bail!("nothing to do; --help lists what there is"),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Train(args) => train::run(&args),
        Command::Key(args) => runtime.block_on(key::run(&args)),
        Command::User(args) => runtime.block_on(user::run(&args)),
        Command::Patient(args) => runtime.block_on(patient::run(&args)),
        Command::Retention(args) => runtime.block_on(retention::run(&args)),
        Command::Audit(args) => runtime.block_on(audit::run(&args)),
        Command::Backup(args) => runtime.block_on(backup::back_up(&args)),
        Command::Restore(args) => runtime.block_on(backup::restore(&args)),
        Command::Doctor(args) => runtime.block_on(backup::examine(&args)),
        Command::Openapi(args) => openapi::run(&args),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn command(words: &[&str]) -> Result<Command, clap::Error> {
        Cli::try_parse_from([&["surefoot"], words].concat()).map(|cli| cli.command)
    }

    #[test]
    fn the_arguments_of_all_commands_fit_together() {
        Cli::command().debug_assert();
    }

    #[test]
    fn what_has_arguments_of_its_own_stands_beside_exercises_and_data_sets() {
        let walker = command(&["simulate", "walker", "--out", "w.mcap", "--missing", "0.3"]);
        assert!(matches!(walker, Ok(Command::Simulate(Simulate { kind: Some(_), .. }))), "{walker:?}");
        let exercise = command(&["simulate", "step", "--out", "s.mcap"]);
        assert!(matches!(exercise, Ok(Command::Simulate(Simulate { kind: None, .. }))), "{exercise:?}");
        let depth = command(&["import", "depth", "f.u16le", "--calibration", "c.json", "--out", "w.mcap"]);
        assert!(matches!(depth, Ok(Command::Import(Import { kind: Some(_), dataset: None }))), "{depth:?}");
        let dataset = command(&["import", "cmu", "data", "out"]);
        assert!(matches!(dataset, Ok(Command::Import(Import { kind: None, dataset: Some(_) }))), "{dataset:?}");
        assert!(command(&["simulate"]).is_err() && command(&["import", "cmu"]).is_err());
    }
}
