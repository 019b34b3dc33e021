//! Real processes of the binary, killed, starved and set against each other.

mod disk_full;
mod kills;
mod load;
mod resumed;
#[cfg(feature = "scaleout")]
mod scaleout;
#[cfg(feature = "scaleout")]
mod servers;
mod support;
