//! The commands of the binary: one file per command.

pub mod import;
