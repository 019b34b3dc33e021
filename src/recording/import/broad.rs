//! BROAD: one inertial unit on a rigid body in the hand, with the optical orientation of that body.
//!
//! Both are aligned and synchronised by the authors, who also say by 1 in the channel `movement` where a sample counts. The earth frame has z up; the reference is turned to y up.

use super::table::NamedTable;
use super::units::{orientation, orientation_references, sensor, trial, trials, y_up_from_z_up};
use super::{Dataset, ImportError, Source, Trial, regular_times};
use crate::recording::{ReferenceSeries, Segment};
use std::path::Path;

/// Samples per second: one in 3.5 ms.
const RATE_HZ: f64 = 1000.0 / 3.5;

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let stem_of = |file: &str| {
        let stem = file.strip_suffix(".csv")?;
        let number = stem.split_once('_')?.0;
        (number.len() == 2 && number.chars().all(|c| c.is_ascii_digit())).then(|| stem.to_owned())
    };
    trials(root, Dataset::Broad, stem_of, "hand_held_unit")
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let table = NamedTable::read(&source.file, 0)?;
    let time_ns = regular_times(table.n_rows(), RATE_HZ);
    let acceleration = table.vectors(["acc_x", "acc_y", "acc_z"])?;
    let angular_rate = table.vectors(["gyr_x", "gyr_y", "gyr_z"])?;
    let mut unit = sensor(Segment::Object1, &time_ns, &acceleration, &angular_rate);
    unit.device_model = Some("myon-aktos-t".into());
    let optical = table.rows_of(["opt_qw", "opt_qx", "opt_qy", "opt_qz"])?;
    let orientations: Vec<_> = optical.iter().map(|q| Some(y_up_from_z_up() * orientation(q)?)).collect();
    let mut references = orientation_references(Segment::Object1, "optitrack", 0, &time_ns, &orientations);
    let movement = table.rows_of(["movement"])?.into_iter().map(|[moves]| moves).collect();
    references.push(ReferenceSeries {
        channel: "movement".into(),
        source: "authors".into(),
        clock_offset_ns: 0,
        time_ns: time_ns.clone(),
        values: movement,
    });
    trial(source, vec![unit], RATE_HZ, references, Vec::new())
}
