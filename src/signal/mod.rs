//! Time series: interpolation, alignment of clocks, stillness.
//!
//! Time stamps are nanoseconds and strictly increasing; a missing value is NaN. Nothing here knows a body or a sensor.

pub mod alignment;
pub mod interpolation;
pub mod stillness;
