//! The export of an x-IMU, `…_CalInertialAndMag.csv`: degrees per second, g and gauss, 256 samples per second.
//!
//! Packets of other kinds count on the same counter, so its gaps say nothing of time: rows are regular. The unit was on
//! a foot whose side is not stated, so it stands on an object.

use super::table::NamedTable;
use super::units::{G_M_S2, sensor, trial, trials};
use super::{Dataset, ImportError, Source, Trial, regular_times};
use crate::recording::Segment;
use nalgebra::Vector3;
use std::path::Path;

/// Samples per second.
const RATE_HZ: f64 = 256.0;

/// Microtesla in a gauss.
const UT_PER_GAUSS: f64 = 100.0;

const ENDING: &str = "_CalInertialAndMag.csv";

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    trials(root, Dataset::XimuGait, |file| file.strip_suffix(ENDING).map(str::to_owned), "walking")
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let table = NamedTable::read(&source.file, 0)?;
    let columns = |what: &str, unit: &str| ["X", "Y", "Z"].map(|axis| format!("{what} {axis} ({unit})"));
    let rate: Vec<_> = table.vectors(columns("Gyroscope", "deg/s"))?.iter().map(|v| v.map(f64::to_radians)).collect();
    let force: Vec<_> = table.vectors(columns("Accelerometer", "g"))?.iter().map(|v| v * G_M_S2).collect();
    let field: Vec<Vector3<f64>> =
        table.vectors(columns("Magnetometer", "G"))?.iter().map(|v| v * UT_PER_GAUSS).collect();
    let mut unit = sensor(Segment::Object1, &regular_times(table.n_rows(), RATE_HZ), &force, &rate);
    let is_whole = unit.len() == field.len() && field.iter().flatten().all(|value| value.is_finite());
    unit.magnetic_field = is_whole.then_some(field);
    unit.device_model = Some("x-imu".into());
    unit.mounting = Some("foot, side not stated".into());
    let counter = table.column("Packet number")?;
    let n_gaps = counter.windows(2).filter(|pair| pair[1] - pair[0] != 1.0).count();
    let remarks = vec![format!("{n_gaps} gaps in the packet numbers, which other packets share, are not gaps in time")];
    trial(source, vec![unit], RATE_HZ, Vec::new(), remarks)
}
