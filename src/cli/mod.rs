//! The commands of the binary: one file per command.

pub mod import;
pub mod key;
pub mod openapi;
pub mod serve;

use clap::{Parser, Subcommand};

/// Cloud assessment of human movement: recordings in, joint angles out.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(serve::Args),
    Import(import::Args),
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
        Command::Serve(args) => runtime.block_on(serve::run(&args)),
        Command::Import(args) => import::run(&args),
        Command::Key(args) => runtime.block_on(key::run(&args)),
        Command::Openapi(args) => openapi::run(&args),
    }
}
