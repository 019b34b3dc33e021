//! Time series: stillness. Functions of numbers over time that know no body and no sensor.

pub mod stillness;
