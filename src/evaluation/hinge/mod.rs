//! Hinge joints from inertial units against optical angles.
//!
//! Three errors of one series, each a root mean square over the reference's instants:
//!
//! - *offset-free*: one constant is taken out of the trial. The sense of the angle counts for knees; the links of a test
//!   chain have no anatomical one.
//! - *from standing*: estimate and reference both count from the quiet standing that the estimate found, so nothing is
//!   fitted. It is what a clinic sees that takes its own zero from standing.
//! - *absolute*: nothing is taken out. The reference's own zero is that of markers on the skin.

#[cfg(test)]
mod tests;
pub mod trial;

pub use trial::HingeTrial;

use crate::pipeline::skeleton_fusion::hinge::HingeAngles;
use serde::Serialize;

/// Standard deviations to each side of a 95 % interval.
const SDS_OF_95_PERCENT: f64 = 1.96;

/// Errors of one estimate of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HingeErrors {
    /// Reference instants that were compared.
    pub n_samples: usize,
    /// Root mean square error after one constant, degrees.
    pub offset_free_deg: f64,
    /// Correlation with the reference.
    pub correlation: f64,
    /// Root mean square error when both count from quiet standing, degrees; none without standing or without a reference
    /// in it.
    pub from_standing_deg: Option<f64>,
    /// Root mean square error with nothing taken out, degrees; none when the estimate's zero is arbitrary.
    pub absolute_deg: Option<f64>,
    /// Share of the reference that lies in the 95 % interval of the angle about its zero, one constant taken out.
    pub held: f64,
}

/// Errors of an estimate; none when no reference falls into it.
pub fn errors(trial: &HingeTrial, estimate: &HingeAngles) -> Option<HingeErrors> {
    let points: Vec<Point> = points(trial, estimate);
    let n = points.len() as f64;
    if points.len() < 2 {
        return None;
    }
    let mean = |pick: fn(&Point) -> f64| points.iter().map(pick).sum::<f64>() / n;
    let (mean_estimate, mean_reference) = (mean(|p| p.estimate), mean(|p| p.reference));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in &points {
        let (x, y) = (point.estimate - mean_estimate, point.reference - mean_reference);
        (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
    }
    let sign = if trial.has_sense || xy >= 0.0 { 1.0 } else { -1.0 };
    let rmse_after = |offset: f64| {
        let sum: f64 = points.iter().map(|p| (sign * p.estimate - p.reference - offset).powi(2)).sum();
        (sum / n).sqrt().to_degrees()
    };
    let offset = sign * mean_estimate - mean_reference;
    let is_held = |p: &&Point| (sign * p.estimate - p.reference - offset).abs() <= SDS_OF_95_PERCENT * p.sd;
    let standing = estimate.standing.as_ref();
    let standing_offset = standing.and_then(|standing| {
        let stands = |p: &&Point| standing.stretches.iter().any(|stretch| stretch.contains(&p.index));
        let differences: Vec<f64> = points.iter().filter(stands).map(|p| sign * p.estimate - p.reference).collect();
        (!differences.is_empty()).then(|| differences.iter().sum::<f64>() / differences.len() as f64)
    });
    Some(HingeErrors {
        n_samples: points.len(),
        offset_free_deg: rmse_after(offset),
        correlation: sign * xy / (xx * yy).sqrt().max(f64::MIN_POSITIVE),
        from_standing_deg: standing_offset.map(rmse_after),
        absolute_deg: standing.map(|_| rmse_after(0.0)),
        held: points.iter().filter(is_held).count() as f64 / n,
    })
}

/// Estimate and reference at one instant of the reference, rad.
struct Point {
    /// The estimate's sample at or after it.
    index: usize,
    estimate: f64,
    sd: f64,
    reference: f64,
}

/// The estimate, interpolated, wherever the reference is a number.
fn points(trial: &HingeTrial, estimate: &HingeAngles) -> Vec<Point> {
    let known = trial.reference_time_ns.iter().zip(&trial.reference).filter(|(_, value)| value.is_finite());
    let points = known.filter_map(|(&time, &reference)| {
        let index = estimate.time_ns.partition_point(|&t| t < time);
        let later = *estimate.time_ns.get(index)?;
        let before = if later == time { index } else { index.checked_sub(1)? };
        let step = (later - estimate.time_ns[before]).max(1) as f64;
        let fraction = (time - estimate.time_ns[before]) as f64 / step;
        let mix = |values: &[f64]| values[before] + (values[index] - values[before]) * fraction;
        Some(Point { index, estimate: mix(&estimate.flexion), sd: mix(&estimate.flexion_sd), reference })
    });
    points.collect()
}
