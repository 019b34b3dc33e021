//! Filters that know no body: state-space models in, estimates out.
//!
//! A model says how its state moves and how likely an observation is; a driver here does the rest. Log-weights
//! throughout; scratch memory is allocated once.

pub mod guided_filter;
pub mod orientation_filter;
pub mod particle_filter;
pub mod random;
pub mod rate_dynamics;
pub mod rate_smoother;
pub mod resampling;
pub mod truncated_normal;
pub mod unscented;
pub mod weights;
