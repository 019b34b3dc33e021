//! Errors of clocks and mountings against what a simulated recording says of its units.

use crate::assessment::UnitQuality;
use crate::body::Bone;
use crate::geometry::attitude::attitude_from_rotation;
use crate::recording::{Recording, Segment};
use nalgebra::{Quaternion, Rotation3, UnitQuaternion};
use serde::Serialize;

/// What was found of one unit beside what is true.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitErrors {
    /// The segment that carries the unit.
    pub segment: Segment,
    /// Largest error of the unit's clock between its first and its last sample, milliseconds.
    pub clock_ms: f64,
    /// What the clock was taken from.
    pub evidence: String,
    /// A lower bound of the angle between the mounting that was found and the true one, degrees: the result tells its
    /// angle to the scheme only, so this is the difference of two angles.
    pub mounting_at_least_deg: f64,
}

/// Errors of one unit; none when the recording does not tell its clock and mounting.
pub fn errors_of_unit(recording: &Recording, found: &UnitQuality) -> Option<UnitErrors> {
    let segment = found.segment;
    let truth = |name: &str| {
        let channel = format!("{segment}_{name}");
        recording.references.iter().find(|series| series.channel == channel)?.values.first().copied()
    };
    let (offset_s, drift_ppm) = (truth("clock_offset_s")?, truth("clock_drift_ppm")?);
    let times = &recording.inertial.as_ref()?.sensor(segment)?.time_ns;
    let clock = &found.clock;
    let error_ms = |time_ns: &i64| {
        let unit_s = *time_ns as f64 * 1e-9;
        let estimated = clock.offset_s + clock.drift_ppm * 1e-6 * (unit_s - clock.reference_s);
        // Both maps are straight lines, so the larger error is at one of the ends.
        (estimated - offset_s - drift_ppm * 1e-6 * unit_s).abs() * 1e3
    };
    let [w, x, y, z] = ["w", "x", "y", "z"].map(|part| truth(&format!("mounting_{part}")));
    let bone_from_imu = UnitQuaternion::from_quaternion(Quaternion::new(w?, x?, y?, z?)).to_rotation_matrix();
    let off_scheme_deg = off_scheme(segment.bone()?, &bone_from_imu).to_degrees();
    Some(UnitErrors {
        segment,
        clock_ms: error_ms(times.first()?).max(error_ms(times.last()?)),
        evidence: clock.evidence.clone(),
        mounting_at_least_deg: (off_scheme_deg - found.off_scheme_deg).abs(),
    })
}

/// Angle between a mounting and the scheme's, radians.
fn off_scheme(bone: Bone, bone_from_imu: &Rotation3<f64>) -> f64 {
    attitude_from_rotation(&(bone.scheme_from_imu() * bone_from_imu.inverse())).norm()
}
