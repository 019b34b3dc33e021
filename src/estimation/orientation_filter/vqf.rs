//! VQF without a magnetometer (Laidig and Seel, Information Fusion 91, 2023), causal, by the crate `vqf-rs`.
//!
//! What this adds to the crate: samples that are not numbers do not reach it, irregular steps and coning do, as a
//! mean rate over each step; the inclination correction assumes the median step.

use super::samples::{Sample, safe};
use super::strapdown::turn;
use super::{InertialSamples, OrientationError, OrientationEstimate, earth_from_z_up};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use vqf_rs::{Params, VQF};

/// Orientation by VQF with its published defaults.
pub(super) fn estimate(samples: &InertialSamples<'_>) -> Result<OrientationEstimate, OrientationError> {
    let samples = safe(samples)?;
    let mut estimate = OrientationEstimate::default();
    let Some(median) = median_seconds(&samples) else { return Ok(estimate) };
    let mut filter =
        VQF::new(median, None, None, Some(Params { mag_dist_rejection_enabled: false, ..Params::default() }));
    let earth_from_z_up = earth_from_z_up();
    let mut before: Option<Vector3<f64>> = None;
    for sample in &samples {
        let mean = match before {
            Some(before) => turn(&before, &sample.rate, sample.seconds) / sample.seconds,
            None => sample.rate,
        };
        before = Some(sample.rate);
        filter.update_gyr_with_ts(mean.into(), sample.seconds);
        // The crate takes three zeros as no acceleration.
        let acceleration = if sample.has_gravity() { sample.acceleration } else { Vector3::zeros() };
        filter.update_acc(acceleration.into());
        let q = filter.quat_6d();
        let attitude = UnitQuaternion::new_unchecked(Quaternion::new(q.0, q.1, q.2, q.3));
        let (bias, sd) = filter.bias_estimate();
        estimate.earth_from_sensor.push(earth_from_z_up * attitude);
        estimate.bias.push(Vector3::from(bias));
        estimate.bias_sd.push(sd);
        estimate.is_rest.push(filter.rest_detected());
    }
    Ok(estimate)
}

/// Median time between samples, s; one millisecond for a single sample, which has none.
fn median_seconds(samples: &[Sample]) -> Option<f64> {
    let mut seconds: Vec<f64> = samples.iter().map(|sample| sample.seconds).collect();
    let middle = seconds.len().checked_sub(1)? / 2;
    let (_, median, _) = seconds.select_nth_unstable_by(middle, f64::total_cmp);
    Some(if *median > 0.0 { *median } else { 1e-3 })
}
