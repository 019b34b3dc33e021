//! A reference brought to the frame, the clock and the vertical of the unit that it is compared with.
//!
//! Markers are glued on by hand and cameras are levelled by eye; neither is an error of a filter. Only instruments are
//! compared here, never an estimate: the optical rate of turn with the gyroscope, which gives the lag of the clocks and
//! the rotation between the frames, and the mean optical direction of the specific force, which is up.

use super::OrientationTrial;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Largest lag that is sought, ns, and the step of the search.
const MAX_LAG_NS: i64 = 60_000_000;
const STEP_NS: i64 = 500_000;
/// Longest time between two optical frames from which a rate is taken, ns, and the largest such rate, rad/s.
const MAX_INTERVAL_NS: i64 = 50_000_000;
const MAX_RATE: f64 = 30.0;

/// What was done to a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// What was added to the reference's times, nanoseconds.
    pub lag_ns: i64,
    /// Rotation from the reference's body into the unit's frame.
    pub sensor_from_body: UnitQuaternion<f64>,
    /// Rotation that makes the reference's frame level.
    pub levelling: UnitQuaternion<f64>,
}

/// Aligns the reference of a trial; none, and nothing changed, when there is too little movement to tell.
pub fn align(trial: &mut OrientationTrial) -> Option<Alignment> {
    let turns = optical_turns(trial);
    let lags = (-MAX_LAG_NS..=MAX_LAG_NS).step_by(STEP_NS as usize);
    let fits = lags.filter_map(|lag_ns| Some((lag_ns, fit(trial, &turns, lag_ns)?)));
    let (lag_ns, Fit { sensor_from_body, .. }) = fits.min_by(|a, b| a.1.residual.total_cmp(&b.1.residual))?;
    let mut force = Vector3::zeros();
    for point in &mut trial.reference {
        point.time_ns += lag_ns;
        point.earth_from_sensor *= sensor_from_body.inverse();
        if let Some(acceleration) = interpolated(&trial.time_ns, &trial.acceleration, point.time_ns) {
            force += point.earth_from_sensor * acceleration;
        }
    }
    let levelling = UnitQuaternion::rotation_between(&force, &Vector3::y()).unwrap_or_default();
    for point in &mut trial.reference {
        point.earth_from_sensor = levelling * point.earth_from_sensor;
    }
    Some(Alignment { lag_ns, sensor_from_body, levelling })
}

/// Rates of turn of the reference in its body's frame, rad/s, each at the middle of its interval.
fn optical_turns(trial: &OrientationTrial) -> Vec<(i64, Vector3<f64>)> {
    let mut turns = Vec::new();
    for pair in trial.reference.windows(2) {
        let interval = pair[1].time_ns - pair[0].time_ns;
        if interval <= 0 || interval > MAX_INTERVAL_NS {
            continue;
        }
        let turn = (pair[0].earth_from_sensor.inverse() * pair[1].earth_from_sensor).scaled_axis();
        let rate = turn / (interval as f64 * 1e-9);
        if rate.norm() < MAX_RATE {
            turns.push((pair[0].time_ns + interval / 2, rate));
        }
    }
    turns
}

struct Fit {
    sensor_from_body: UnitQuaternion<f64>,
    /// Mean squared difference of the rates, rad²/s².
    residual: f64,
}

/// The rotation that turns optical rates best into the gyroscope's (Kabsch), at a lag.
fn fit(trial: &OrientationTrial, turns: &[(i64, Vector3<f64>)], lag_ns: i64) -> Option<Fit> {
    let mut products = Matrix3::zeros();
    let (mut squares, mut n) = (0.0, 0.0);
    for (time_ns, optical) in turns {
        if let Some(rate) = interpolated(&trial.time_ns, &trial.angular_rate, time_ns + lag_ns) {
            products += rate * optical.transpose();
            squares += rate.norm_squared() + optical.norm_squared();
            n += 1.0;
        }
    }
    let svd = products.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let handedness = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, handedness)) * v_t;
    let s = &svd.singular_values;
    // Two axes of rotation are needed to see the third.
    (n > 0.0 && s[1] > 1e-6 * s[0]).then(|| Fit {
        sensor_from_body: UnitQuaternion::from_matrix(&rotation),
        residual: (squares - 2.0 * (s[0] + s[1] + handedness * s[2])) / n,
    })
}

/// A vector at a time, between the samples around it; none outside them.
fn interpolated(time_ns: &[i64], vectors: &[Vector3<f64>], when_ns: i64) -> Option<Vector3<f64>> {
    let after = time_ns.partition_point(|&time| time < when_ns);
    let (before, b) = (after.checked_sub(1)?, vectors.get(after)?);
    let fraction = (when_ns - time_ns[before]) as f64 / (time_ns[after] - time_ns[before]) as f64;
    Some(vectors[before].lerp(b, fraction))
}
