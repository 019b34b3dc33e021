//! Recordings with known truth.

pub mod exercise;
pub mod motion;
pub mod posture;
pub mod subject;

pub use exercise::Exercise;
pub use subject::Subject;
