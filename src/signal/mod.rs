//! Time series: interpolation, alignment of clocks, stillness.
//!
//! Time stamps are nanoseconds and strictly increasing; a missing value is NaN.

pub mod alignment;
pub mod interpolation;
