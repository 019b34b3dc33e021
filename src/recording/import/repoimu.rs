//! RepoIMU, T-stick: one inertial unit on a rod in the hand, with the rod's optical orientation.
//!
//! The rod's frame and the unit's differ by 2 to 4 degrees, and the optical frame, z up, is not exactly level: both are
//! kept as they are. The magnetometer is normalised, so it has no unit and is left out.

use super::table::Table;
use super::units::{orientation, orientation_references, sensor, trial, trials, y_up_from_z_up};
use super::{Dataset, ImportError, Source, Trial};
use crate::recording::Segment;
use nalgebra::Vector3;
use std::path::Path;

/// Samples per second.
const RATE_HZ: f64 = 100.0;

/// Time, four of the orientation, three each of acceleration, angular rate and magnetic field.
const N_COLUMNS: usize = 14;

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let stem_of = |file: &str| file.strip_suffix(".csv").filter(|stem| stem.starts_with("TStick_")).map(str::to_owned);
    trials(root, Dataset::Repoimu, stem_of, "hand_held_rod")
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let table = Table::read(&source.file, 2, N_COLUMNS)?;
    let time_ns: Vec<i64> = table.column(0).into_iter().map(|seconds| (seconds * 1e9).round() as i64).collect();
    let vectors = |first: usize| -> Vec<Vector3<f64>> {
        (0..table.n_rows()).map(|i| Vector3::from_column_slice(&table.row(i)[first..first + 3])).collect()
    };
    let unit = sensor(Segment::Object1, &time_ns, &vectors(5), &vectors(8));
    let rods = (0..table.n_rows()).map(|i| Some(y_up_from_z_up() * orientation(&table.row(i)[1..5])?));
    let references = orientation_references(Segment::Object1, "vicon", 0, &time_ns, &rods.collect::<Vec<_>>());
    let remarks = vec!["the reference is the rod's, which differs from the unit's frame by 2 to 4 degrees".to_owned()];
    trial(source, vec![unit], RATE_HZ, references, remarks)
}
