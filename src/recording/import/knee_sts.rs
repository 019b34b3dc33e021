//! Left thigh and shank of one person, sitting, standing and walking, with the knee's flexion from markers.
//!
//! Row i of all three files is one instant (within one sample, 25 ms), so the reference takes the thigh unit's times.
//! Rows that the data set marks as not to be scored have no reference. Abduction and rotation are left out: their signs
//! are not stated.

use super::table::{NamedTable, existing};
use super::units::{sensor, trial, trials};
use super::{Dataset, ImportError, Source, Trial};
use crate::recording::{InertialSensor, ReferenceSeries, Segment};
use std::path::{Path, PathBuf};

/// Samples per second.
const RATE_HZ: f64 = 40.0;

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let stem_of = |file: &str| file.strip_suffix("_imu_left_thigh.csv").map(str::to_owned);
    trials(root, Dataset::KneeSts, stem_of, "sit_to_stand_and_sitting")
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let thigh = unit(&source.file, Segment::LeftThigh)?;
    let shank = unit(&sibling(source, "imu_left_shank")?, Segment::LeftShank)?;
    let mocap_file = sibling(source, "mocap_knee")?;
    let mocap = NamedTable::read(&mocap_file, 0)?;
    if [shank.len(), mocap.n_rows()] != [thigh.len(); 2] {
        let reason =
            format!("{} rows, but {} of the thigh and {} of the shank", mocap.n_rows(), thigh.len(), shank.len());
        return Err(ImportError::Inconsistent { file: mocap_file, reason });
    }
    let (flexion, valid) = (mocap.column("knee_flexion_z_deg")?, mocap.column("valid")?);
    let scored = flexion.into_iter().zip(valid).map(|(value, valid)| if valid == 1.0 { value } else { f64::NAN });
    let reference = ReferenceSeries {
        channel: "left_knee_flexion_deg".into(),
        source: "markers-inverse-kinematics".into(),
        clock_offset_ns: 0,
        time_ns: thigh.time_ns.clone(),
        values: scored.collect(),
    };
    trial(source, vec![thigh, shank], RATE_HZ, vec![reference], Vec::new())
}

fn sibling(source: &Source, what: &str) -> Result<PathBuf, ImportError> {
    let name = format!("{}_{what}.csv", source.name);
    existing(source.file.parent().unwrap_or(Path::new("")), &name)
        .ok_or_else(|| ImportError::Inconsistent { file: source.file.clone(), reason: format!("{name} is missing") })
}

fn unit(file: &Path, segment: Segment) -> Result<InertialSensor, ImportError> {
    let table = NamedTable::read(file, 0)?;
    let counter = table.column("PacketCounter")?;
    let first = counter.first().copied().unwrap_or(0.0);
    let time_ns: Vec<i64> = counter.iter().map(|n| ((n - first) / RATE_HZ * 1e9).round() as i64).collect();
    let force = table.vectors(["Acc_X", "Acc_Y", "Acc_Z"])?;
    let mut unit = sensor(segment, &time_ns, &force, &table.vectors(["Gyr_X", "Gyr_Y", "Gyr_Z"])?);
    unit.device_model = Some("xsens-mtw-awinda".into());
    Ok(unit)
}
