//! A chain of five segments with a spherical joint and three hinges, units fixed to it rigidly or on foam, with the
//! optical orientation of every segment.
//!
//! Neither file has times: the units run at 40 Hz, the cameras at 30 Hz, from a common start but for the lag that was
//! measured for each trial. The cameras' frame has z up: in it the accelerations at rest point to z within a degree.

use super::table::{NamedTable, existing};
use super::units::{orientation, orientation_references, sensor, trial, trials, y_up_from_z_up};
use super::{Dataset, ImportError, Source, Trial, regular_times};
use crate::recording::Segment;
use std::path::Path;

/// Samples per second of the units.
const RATE_HZ: f64 = 40.0;

/// Frames per second of the cameras.
const OPTICAL_HZ: f64 = 30.0;

/// What is added to the cameras' clock to reach the units', nanoseconds, as the data set's description measured it.
const LAGS_NS: [(&str, i64); 2] = [("trial1", -16_000_000), ("trial2", 2_000_000)];

const SEGMENTS: [Segment; 5] =
    [Segment::Object1, Segment::Object2, Segment::Object3, Segment::Object4, Segment::Object5];

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let stem_of = |file: &str| {
        let (trial, mount) = file.strip_suffix(".csv")?.split_once("_imu_")?;
        (trial.starts_with("trial") && ["rigid", "nonrigid"].contains(&mount)).then(|| format!("{trial}_{mount}"))
    };
    trials(root, Dataset::RingChain, stem_of, "five_segment_chain")
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let (number, mount) = source.name.split_once('_').unwrap_or((&source.name, ""));
    let table = NamedTable::read(&source.file, 0)?;
    let time_ns = regular_times(table.n_rows(), RATE_HZ);
    let name = format!("{number}_omc.csv");
    let optical_file = existing(source.file.parent().unwrap_or(Path::new("")), &name).ok_or_else(|| {
        ImportError::Inconsistent { file: source.file.clone(), reason: format!("its optical file {name} is missing") }
    })?;
    let optical = NamedTable::read(&optical_file, 0)?;
    let optical_ns = regular_times(optical.n_rows(), OPTICAL_HZ);
    let lag_ns = LAGS_NS.iter().find(|(known, _)| *known == number).map_or(0, |(_, lag)| *lag);
    let (mut units, mut references) = (Vec::new(), Vec::new());
    for (i, segment) in SEGMENTS.into_iter().enumerate() {
        let column = |what: &str| format!("seg{}_{what}", i + 1);
        let [force, rate] = ["acc", "gyr"].map(|what| ["x", "y", "z"].map(|axis| column(&format!("{what}_{axis}"))));
        let mut unit = sensor(segment, &time_ns, &table.vectors(force)?, &table.vectors(rate)?);
        unit.mounting = Some(if mount == "rigid" { "rigid" } else { "on foam" }.to_owned());
        units.push(unit);
        let rows = optical.rows_of(["w", "x", "y", "z"].map(|part| column(&format!("quat_{part}"))))?;
        let orientations: Vec<_> = rows.iter().map(|row| Some(y_up_from_z_up() * orientation(row)?)).collect();
        references.extend(orientation_references(segment, "optical", lag_ns, &optical_ns, &orientations));
    }
    trial(source, units, RATE_HZ, references, Vec::new())
}
