//! Time series: interpolation, alignment of clocks, stillness.
