//! Thigh and shank of one leg in drop landings and cutting, with the knee angles of Visual3D.
//!
//! The units' rows and the reference's are the same instants, 100 per second. The packet counter wraps at 65536, and
//! the first row is a copy of the second, so the units begin with the second. Flexion is extension with the sign
//! changed. The magnetometer has no unit and is left out, as are abduction and rotation, whose signs are not stated.

use super::table::{NamedTable, Table};
use super::units::{sensor, trial, trials};
use super::{Dataset, ImportError, Source, Trial, file_names, regular_times};
use crate::body::Side;
use crate::recording::{InertialSensor, ReferenceSeries, Segment};
use std::path::Path;

/// Samples per second.
const RATE_HZ: f64 = 100.0;

/// Rows of comments before the names of an export's columns.
const N_COMMENTS: usize = 5;

/// Where the packet counter starts again.
const COUNTER: i64 = 65_536;

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let stem_of = |file: &str| file.strip_suffix(".txt").filter(|stem| side(stem).is_some()).map(str::to_owned);
    trials(root, Dataset::KneeDropCut, stem_of, "drop_landing_or_cutting")
}

fn side(stem: &str) -> Option<Side> {
    match stem.split_once("knee_trial_")?.0 {
        "L" => Some(Side::Left),
        "R" => Some(Side::Right),
        _ => None,
    }
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let side = side(&source.name).unwrap_or(Side::Left);
    let (thigh_segment, shank_segment) = match side {
        Side::Left => (Segment::LeftThigh, Segment::LeftShank),
        Side::Right => (Segment::RightThigh, Segment::RightShank),
    };
    let angles = Table::read(&source.file, N_COMMENTS, 4)?;
    let units = vec![unit(source, thigh_segment, angles.n_rows())?, unit(source, shank_segment, angles.n_rows())?];
    let reference = ReferenceSeries {
        channel: format!("{}_knee_flexion_deg", side.name()),
        source: "visual3d".into(),
        clock_offset_ns: 0,
        time_ns: regular_times(angles.n_rows(), RATE_HZ),
        values: angles.column(1).into_iter().map(|extension| -extension).collect(),
    };
    trial(source, units, RATE_HZ, vec![reference], Vec::new())
}

/// The unit on a segment; its export's name ends with the segment's, and says nothing of the trial.
fn unit(source: &Source, segment: Segment, n_rows: usize) -> Result<InertialSensor, ImportError> {
    let inconsistent = |reason| ImportError::Inconsistent { file: source.file.clone(), reason };
    let folder = source.file.parent().unwrap_or(Path::new(""));
    let ending = format!("_{segment}.txt");
    let names = file_names(folder)?;
    let exports: Vec<_> = names.iter().filter(|name| super::without_gz(name).ends_with(&ending)).collect();
    let [export] = exports[..] else {
        return Err(inconsistent(format!("{} files MT_…{ending} stand beside it, expected one", exports.len())));
    };
    let file = folder.join(export);
    let table = NamedTable::read(&file, N_COMMENTS)?;
    if table.n_rows() != n_rows {
        return Err(inconsistent(format!("{n_rows} rows, but {} in {export}", table.n_rows())));
    }
    let mut time_ns = times(&table.column("PacketCounter")?);
    let mut force = table.vectors(["Acc_X", "Acc_Y", "Acc_Z"])?;
    let mut rate = table.vectors(["Gyr_X", "Gyr_Y", "Gyr_Z"])?;
    if time_ns.len() > 1 && time_ns[0] == time_ns[1] {
        time_ns.iter_mut().for_each(|time| *time += (1e9 / RATE_HZ) as i64);
        time_ns.remove(0);
        force.remove(0);
        rate.remove(0);
    }
    let mut unit = sensor(segment, &time_ns, &force, &rate);
    unit.device_model = Some("xsens".into());
    Ok(unit)
}

/// Times of packets from the first one's, nanoseconds.
fn times(counter: &[f64]) -> Vec<i64> {
    let mut packets = 0;
    let steps = counter.iter().scan(None, |last: &mut Option<i64>, &count| {
        let count = count as i64;
        let step = last.map_or(0, |last| count.wrapping_sub(last).rem_euclid(COUNTER));
        *last = Some(count);
        Some(step)
    });
    let packets = steps.map(|step| {
        packets += step;
        packets
    });
    packets.map(|n| (n as f64 / RATE_HZ * 1e9).round() as i64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_counter_that_wraps_and_skips_gives_the_time() {
        let times = times(&[65_534.0, 65_534.0, 65_535.0, 0.0, 3.0]);
        assert_eq!(times, [0, 0, 10_000_000, 20_000_000, 50_000_000]);
    }
}
