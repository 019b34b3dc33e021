//! Real processes of the binary, killed, starved and set against each other.

#![expect(clippy::unwrap_used, reason = "all of this crate is tests; helpers of tests fail by panic too")]

#[path = "../common/mod.rs"]
mod common;
mod disk_full;
mod kills;
mod load;
mod resumed;
#[cfg(feature = "scaleout")]
mod scaleout;
#[cfg(feature = "scaleout")]
mod servers;
mod support;
#[cfg(feature = "otel")]
mod traces;
