//! Orientation of inertial units against an optical reference.
//!
//! The error of one sample is `e = q̂ ⊗ q*`, estimate times conjugate reference, in earth's frame. Neither instrument of
//! a unit sees north, so one constant heading, the circular mean of the errors' headings, is taken out of each trial.
//! What is left is told as a whole, and as inclination, the tilt between estimated and true vertical.

pub mod alignment;
#[cfg(test)]
mod tests;
pub mod trial;

pub use trial::OrientationTrial;

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

/// Errors of one estimate of one trial, root mean squares in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OrientationErrors {
    /// Reference samples that were compared.
    pub n_samples: usize,
    /// Angle of the whole error rotation after the heading was taken out.
    pub total_deg: f64,
    /// Angle between estimated and true vertical.
    pub inclination_deg: f64,
}

/// Errors of an estimate, one rotation into `earth` (y up) for each sample of the trial's unit.
///
/// Between samples the estimate is interpolated along the shortest arc. `None` when no scored reference falls between
/// the unit's first and last sample.
pub fn errors(trial: &OrientationTrial, estimate: &[UnitQuaternion<f64>]) -> Option<OrientationErrors> {
    let scored = trial.reference.iter().filter(|point| point.is_scored);
    let errors: Vec<UnitQuaternion<f64>> = scored
        .filter_map(|point| Some(at(&trial.time_ns, estimate, point.time_ns)? * point.earth_from_sensor.inverse()))
        .collect();
    if errors.is_empty() {
        return None;
    }
    let (mut sine, mut cosine) = (0.0, 0.0);
    for error in &errors {
        let heading = 2.0 * error.j.atan2(error.w);
        sine += heading.sin();
        cosine += heading.cos();
    }
    let heading = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), f64::atan2(sine, cosine));
    let (mut total, mut inclination) = (0.0, 0.0);
    for error in &errors {
        total += (heading.inverse() * error).angle().powi(2);
        inclination += (2.0 * error.i.hypot(error.k).atan2(error.w.hypot(error.j))).powi(2);
    }
    let n = errors.len() as f64;
    Some(OrientationErrors {
        n_samples: errors.len(),
        total_deg: (total / n).sqrt().to_degrees(),
        inclination_deg: (inclination / n).sqrt().to_degrees(),
    })
}

/// Orientation at a time, between the samples around it; none outside them.
fn at(time_ns: &[i64], orientations: &[UnitQuaternion<f64>], when_ns: i64) -> Option<UnitQuaternion<f64>> {
    let after = time_ns.partition_point(|&time| time < when_ns);
    let b = orientations.get(after)?;
    if time_ns[after] == when_ns {
        return Some(*b);
    }
    let before = after.checked_sub(1)?;
    let fraction = (when_ns - time_ns[before]) as f64 / (time_ns[after] - time_ns[before]) as f64;
    // Only half a turn between two samples has no shortest arc.
    orientations[before].try_slerp(b, fraction, 1e-9)
}
