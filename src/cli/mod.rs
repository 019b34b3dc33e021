//! The commands of the binary: one file per command.

pub mod evaluate;
pub mod import;
pub mod simulate;
