//! Time series: interpolation, alignment of clocks, stillness.
//!
//! Time stamps are nanoseconds and strictly increasing; a missing value is NaN. Nothing here knows a body or a sensor.

pub mod alignment;
pub mod correlation;
pub mod grid;
pub mod interpolation;
pub mod local_parabola;
pub mod stillness;
