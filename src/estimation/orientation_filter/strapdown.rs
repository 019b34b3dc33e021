//! Attitude by integration of angular rates.
//!
//! Between two samples the rate is taken as linear in time. The turn is then, to fourth order in the step,
//!
//! ```text
//! Δ = (ω₀ + ω₁) Δt/2 + (ω₀ × ω₁) Δt²/12
//! ```
//!
//! The second term is coning: rates whose axis moves turn more than their mean. At 40 Hz and the 16 rad/s of a fast
//! hand, holding the later rate over the step instead is wrong by half a sample, 11°.

use super::samples::{Sample, safe};
use super::{InertialSamples, OrientationError, OrientationEstimate, earth_from_z_up, levelling};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Squared half angle (rad²) below which the series of sine and cosine is exact to 1e-13.
const SERIES_LIMIT: f64 = 0.1;

/// Coefficients of `x`, `x²`, … in `sin √x / √x` and `cos √x`: ±1/3!, 1/5!, … and ±1/2!, 1/4!, …
const SINE: [f64; 5] = [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0];
const COSINE: [f64; 5] = [-1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0, -1.0 / 3_628_800.0];

/// The turn from the sample before to this one, as an attitude vector, rad.
pub(super) fn turn(before: &Vector3<f64>, rate: &Vector3<f64>, seconds: f64) -> Vector3<f64> {
    (before + rate) * (0.5 * seconds) + before.cross(rate) * (seconds * seconds * (1.0 / 12.0))
}

/// `attitude ⊗ exp(turn)`, normalised to first order: a step leaves the norm within 1e-13 of one.
pub(super) fn turned(attitude: &Quaternion<f64>, turn: &Vector3<f64>) -> Quaternion<f64> {
    let x = 0.25 * turn.norm_squared();
    let (sine, cosine) = if x < SERIES_LIMIT {
        (
            1.0 + x * (SINE[0] + x * (SINE[1] + x * (SINE[2] + x * (SINE[3] + x * SINE[4])))),
            1.0 + x * (COSINE[0] + x * (COSINE[1] + x * (COSINE[2] + x * (COSINE[3] + x * COSINE[4])))),
        )
    } else {
        let half = x.sqrt();
        (half.sin() / half, half.cos())
    };
    let next = attitude * Quaternion::from_parts(cosine, turn * (0.5 * sine));
    next * (1.5 - 0.5 * next.norm_squared())
}

/// Inclination of the first acceleration that shows gravity, heading zero; z up.
pub(super) fn first_inclination(samples: &[Sample]) -> UnitQuaternion<f64> {
    let first = samples.iter().find(|sample| sample.has_gravity());
    first.map_or(UnitQuaternion::identity(), |sample| levelling(&sample.acceleration))
}

/// Integrates the gyroscope alone from the inclination of the first acceleration.
pub(super) fn integrate(samples: &InertialSamples<'_>) -> Result<OrientationEstimate, OrientationError> {
    let samples = safe(samples)?;
    let mut attitude = (earth_from_z_up() * first_inclination(&samples)).into_inner();
    let mut before: Option<Vector3<f64>> = None;
    let attitudes = samples.iter().map(|sample| {
        if let Some(before) = before {
            attitude = turned(&attitude, &turn(&before, &sample.rate, sample.seconds));
        }
        before = Some(sample.rate);
        UnitQuaternion::new_unchecked(attitude)
    });
    Ok(OrientationEstimate { earth_from_sensor: attitudes.collect(), ..OrientationEstimate::default() })
}
