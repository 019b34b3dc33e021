//! Errors of one angle over one recording.
//!
//! ```text
//! speed(t_i) = (v_{i+1} − v_{i−1}) / (t_{i+1} − t_{i−1})        of estimate and reference, at the estimate's times
//! NCC = Pearson's correlation, the normalised cross-correlation at lag zero of both less their means
//! ```
//!
//! Without taking the means away, two angles that merely are both positive correlate by 0.9.

use crate::evaluation::agreement::Agreement;
use crate::evaluation::reference::interpolated;
use crate::recording::ReferenceSeries;
use serde::Serialize;

/// Estimates of one angle.
#[derive(Debug, Clone, Copy)]
pub struct Estimate<'a> {
    /// Times of the samples, nanoseconds.
    pub time_ns: &'a [i64],
    /// The angle, degrees; NaN where there is none.
    pub value: &'a [f64],
    /// Ends of the 95 % intervals, degrees; none for estimates without.
    pub interval: Option<[&'a [f32]; 2]>,
}

/// How far the estimate of one angle is from its reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AngleErrors {
    /// The angle, for example `left_knee_flexion_deg`.
    pub channel: String,
    /// Share of the estimate's times with a reference at which there is an estimate, 0 to 1.
    pub coverage: f64,
    /// Root mean square error, degrees.
    pub rmse_deg: f64,
    /// The same after the mean error was taken out, degrees.
    pub offset_free_deg: f64,
    /// Zero-mean normalised cross-correlation; none when one of both does not move.
    pub ncc: Option<f64>,
    /// Root mean square error of the angular velocity, degrees per second.
    pub speed_rmse_deg_s: Option<f64>,
    /// Share of the 95 % intervals that hold the reference, 0 to 1; none without intervals.
    pub held: Option<f64>,
}

/// Errors of an estimate from a time on; none when it and the reference have no time in common.
pub fn compare(estimate: &Estimate<'_>, reference: &ReferenceSeries, from_ns: i64) -> Option<AngleErrors> {
    let first = estimate.time_ns.partition_point(|time| *time < from_ns);
    let time_ns = &estimate.time_ns[first..];
    let truth = interpolated(reference, time_ns);
    // An angle that passed ±180° is the same angle a turn further.
    let turns = |value: f64, truth: f64| {
        let turns = 360.0 * ((value - truth) / 360.0).round();
        if turns.is_finite() { turns } else { 0.0 }
    };
    let raw = &estimate.value[first..];
    let value: Vec<f64> = raw.iter().zip(&truth).map(|(v, t)| v - turns(*v, *t)).collect();
    let agreement = Agreement::between(&value, &truth);
    let n_reference = truth.iter().filter(|t| t.is_finite()).count();
    let interval = estimate.interval.map(|ends| ends.map(|end| &end[first..]));
    let held = interval.and_then(|[low, high]| {
        let (mut n, mut held) = (0, 0);
        for i in 0..truth.len() {
            let turned = turns(raw[i], truth[i]);
            let (low, high) = (f64::from(low[i]) - turned, f64::from(high[i]) - turned);
            if truth[i].is_finite() && low.is_finite() && high.is_finite() {
                n += 1;
                held += usize::from((low..=high).contains(&truth[i]));
            }
        }
        (n > 0).then(|| f64::from(held as u32) / f64::from(n as u32))
    });
    Some(AngleErrors {
        channel: reference.channel.clone(),
        coverage: agreement.n() as f64 / n_reference.max(1) as f64,
        rmse_deg: agreement.rmse()?,
        offset_free_deg: agreement.rmse_without_offset()?,
        ncc: agreement.correlation(),
        speed_rmse_deg_s: Agreement::between(&speed(time_ns, &value), &speed(time_ns, &truth)).rmse(),
        held,
    })
}

/// Central differences, per second; NaN at both ends and beside missing values.
pub fn speed(time_ns: &[i64], value: &[f64]) -> Vec<f64> {
    let at = |i: usize| {
        let (before, after) = (i.wrapping_sub(1), i + 1);
        match (value.get(before), value.get(after)) {
            (Some(a), Some(b)) if time_ns[after] > time_ns[before] => {
                (b - a) / ((time_ns[after] - time_ns[before]) as f64 * 1e-9)
            }
            _ => f64::NAN,
        }
    };
    (0..value.len()).map(at).collect()
}
