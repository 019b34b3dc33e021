//! Gradient descent towards gravity (\[fusion\] Eqs. 1-4, after Madgwick).
//!
//! ```text
//! q_t = q_{t-1} + q̇ Δt            q̇ = ½ q ⊗ (0, ω) − β ∇f / ‖∇f‖            ∇f = Jᵀ f
//!
//!     ⎡ 2 (q2 q4 − q1 q3) − ax  ⎤        ⎡ −2 q3   2 q4  −2 q1   2 q2 ⎤
//! f = ⎢ 2 (q1 q2 + q3 q4) − ay  ⎥    J = ⎢  2 q2   2 q1   2 q4   2 q3 ⎥
//!     ⎣ 2 (½ − q2² − q3²) − az  ⎦        ⎣   0    −4 q2  −4 q3    0   ⎦
//! ```
//!
//! `q` is scalar first and takes sensor to earth (z up), `a` is the normalised acceleration, `β` the gain. Where the
//! gradient vanishes, or there is no gravity in the acceleration, the gyroscope is integrated alone.

use super::samples::{Sample, safe};
use super::strapdown::first_inclination;
use super::{InertialSamples, OrientationError, OrientationEstimate, earth_from_z_up};
use nalgebra::{Quaternion, UnitQuaternion};

/// Gain `β`, rad/s: the one that Madgwick's report found best without a magnetometer.
pub const DEFAULT_GAIN: f64 = 0.033;

/// Orientation by Madgwick's filter with the gain `β` in rad/s.
///
/// `initial` is the rotation from the sensor into `earth` (y up) before the first sample; without it the filter starts
/// from the inclination of the first acceleration, since a small gain takes a minute to find it from elsewhere.
///
/// # Errors
/// As [`super::estimate`].
pub fn estimate(
    samples: &InertialSamples<'_>,
    gain: f64,
    initial: Option<UnitQuaternion<f64>>,
) -> Result<OrientationEstimate, OrientationError> {
    let samples = safe(samples)?;
    let earth_from_z_up = earth_from_z_up();
    let start = initial.map_or_else(|| first_inclination(&samples), |initial| earth_from_z_up.inverse() * initial);
    let mut q = start.into_inner();
    let attitudes = samples.iter().map(|sample| {
        q = step(&q, sample, gain);
        earth_from_z_up * UnitQuaternion::new_unchecked(q)
    });
    Ok(OrientationEstimate { earth_from_sensor: attitudes.collect(), ..OrientationEstimate::default() })
}

/// One step of Eq. 1, normalised.
fn step(q: &Quaternion<f64>, sample: &Sample, gain: f64) -> Quaternion<f64> {
    let by_gyroscope = q * Quaternion::from_imag(sample.rate) * 0.5;
    let rate = match gradient(q, sample) {
        Some(gradient) => by_gyroscope - gradient * gain,
        None => by_gyroscope,
    };
    let next = q + rate * sample.seconds;
    // The norm cannot vanish: the gyroscope's part is orthogonal to q, the gradient's is at most the gain times Δt.
    unit(next).unwrap_or(*q)
}

/// `∇f / ‖∇f‖` of Eqs. 2-4; none where it has no direction.
fn gradient(q: &Quaternion<f64>, sample: &Sample) -> Option<Quaternion<f64>> {
    let a = sample.has_gravity().then(|| sample.acceleration.normalize())?;
    let (q1, q2, q3, q4) = (q.w, q.i, q.j, q.k);
    let fx = 2.0 * (q2 * q4 - q1 * q3) - a.x;
    let fy = 2.0 * (q1 * q2 + q3 * q4) - a.y;
    let fz = 2.0 * (0.5 - q2 * q2 - q3 * q3) - a.z;
    let gradient = Quaternion::new(
        -2.0 * q3 * fx + 2.0 * q2 * fy,
        2.0 * q4 * fx + 2.0 * q1 * fy - 4.0 * q2 * fz,
        -2.0 * q1 * fx + 2.0 * q4 * fy - 4.0 * q3 * fz,
        2.0 * q2 * fx + 2.0 * q3 * fy,
    );
    unit(gradient)
}

/// A quaternion of length one; none where the length is zero or no number.
fn unit(quaternion: Quaternion<f64>) -> Option<Quaternion<f64>> {
    let norm = quaternion.norm();
    (norm > f64::MIN_POSITIVE && norm.is_finite()).then(|| quaternion / norm)
}
