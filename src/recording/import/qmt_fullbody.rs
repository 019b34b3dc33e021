//! Nine units on one person, at the places that the fusion of a skeleton with inertial units uses; no reference.

use super::table::NamedTable;
use super::units::{sensor, trial, trials};
use super::{Dataset, ImportError, Source, Trial};
use crate::recording::Segment;
use std::path::Path;

/// Samples per second.
const RATE_HZ: f64 = 100.0;

/// The data set's name of each segment.
const SEGMENTS: [(&str, Segment); 9] = [
    ("upper_back", Segment::Chest),
    ("upper_arm_left", Segment::LeftUpperArm),
    ("forearm_left", Segment::LeftForearm),
    ("upper_arm_right", Segment::RightUpperArm),
    ("forearm_right", Segment::RightForearm),
    ("upper_leg_left", Segment::LeftThigh),
    ("lower_leg_left", Segment::LeftShank),
    ("upper_leg_right", Segment::RightThigh),
    ("lower_leg_right", Segment::RightShank),
];

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let stem_of = |file: &str| file.strip_suffix(".csv").filter(|stem| stem.ends_with("_9segments")).map(str::to_owned);
    trials(root, Dataset::QmtFullbody, stem_of, "whole_body_movement")
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let table = NamedTable::read(&source.file, 0)?;
    let time_ns: Vec<i64> = table.column("t")?.into_iter().map(|seconds| (seconds * 1e9).round() as i64).collect();
    let mut units = Vec::new();
    for (name, segment) in SEGMENTS {
        let [force, rate] = ["acc", "gyr"].map(|what| ["x", "y", "z"].map(|axis| format!("{name}_{what}_{axis}")));
        let mut unit = sensor(segment, &time_ns, &table.vectors(force)?, &table.vectors(rate)?);
        unit.mounting = (segment == Segment::Chest).then(|| "upper back".to_owned());
        units.push(unit);
    }
    trial(source, units, RATE_HZ, Vec::new(), Vec::new())
}
