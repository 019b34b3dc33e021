//! The truth of a fusion simulation as reference channels of the recording.
//!
//! Beside the joint angles, on the camera's clock:
//!
//! | channel | value |
//! |---|---|
//! | `<segment>_clock_offset_s`, `<segment>_clock_drift_ppm` | see [`UnitClock`](super::clock::UnitClock); one sample at time 0 |
//! | `<segment>_mounting_w`, `_x`, `_y`, `_z` | `bone_from_imu`; one sample at time 0 |
//! | `protocol_phase_code` | code of the phase that starts at the sample's time, see [`PHASE_CODES`](super::protocol::PHASE_CODES) |
//! | `jump_flight_s` | time in the air, at each take-off |

use super::UnitTruth;
use super::protocol::Phases;
use crate::recording::{ReferenceSeries, Segment};
use crate::synthetic::TRUTH_SOURCE;

pub(super) fn of_unit(unit: &UnitTruth) -> Vec<ReferenceSeries> {
    let segment = Segment::of_bone(unit.bone);
    let mounting = &unit.bone_from_imu;
    let values = [
        ("clock_offset_s", unit.clock.offset_s),
        ("clock_drift_ppm", unit.clock.drift_ppm),
        ("mounting_w", mounting.w),
        ("mounting_x", mounting.i),
        ("mounting_y", mounting.j),
        ("mounting_z", mounting.k),
    ];
    values.into_iter().map(|(name, value)| series(format!("{segment}_{name}"), &[(0.0, value)])).collect()
}

pub(super) fn of_protocol(phases: &Phases) -> Vec<ReferenceSeries> {
    let flights: Vec<(f64, f64)> =
        phases.jumps.iter().map(|jump| (jump.take_off_s, jump.touch_down_s - jump.take_off_s)).collect();
    let mut all = vec![series("protocol_phase_code".into(), &phases.starts())];
    if !flights.is_empty() {
        all.push(series("jump_flight_s".into(), &flights));
    }
    all
}

/// A series of (time in seconds, value).
fn series(channel: String, samples: &[(f64, f64)]) -> ReferenceSeries {
    ReferenceSeries {
        channel,
        source: TRUTH_SOURCE.to_owned(),
        clock_offset_ns: 0,
        time_ns: samples.iter().map(|(t, _)| (t * 1e9).round() as i64).collect(),
        values: samples.iter().map(|(_, value)| *value).collect(),
    }
}
