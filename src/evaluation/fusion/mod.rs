//! Camera skeleton and inertial units fused, beside the truth of simulated recordings ([`simulated`]) and beside a real unit
//! on a thigh ([`thigh`]).
//!
//! Angles are compared over the time in which the units are worn: from the T-posture on where the recording says when that
//! was, otherwise from the first frame. Every contender is compared over the same span, the camera's at its frames and the
//! others at the units' rate.

pub mod angles;
pub mod clocks;
pub mod contender;
pub mod simulated;
pub mod summary;
pub mod thigh;

pub use angles::{AngleErrors, compare};
pub use contender::Contender;

#[cfg(test)]
mod tests;
