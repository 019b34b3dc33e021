//! The commands of the binary: one file per command.

pub mod assess;
pub mod demo;
pub mod evaluate;
pub mod import;
pub mod key;
mod noise_model;
pub mod openapi;
pub mod serve;
pub mod simulate;
pub mod train;

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
    Assess(assess::Args),
    Import(import::Args),
    Simulate(simulate::Args),
    Evaluate(evaluate::Args),
    Train(train::Args),
    Key(key::Args),
    Openapi(openapi::Args),
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
        Command::Import(args) => import::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Train(args) => train::run(&args),
        Command::Key(args) => runtime.block_on(key::run(&args)),
        Command::Openapi(args) => openapi::run(&args),
    }
}
