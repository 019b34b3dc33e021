//! Orientation of one inertial sensor from its accelerometer and gyroscope.
//!
//! Every method answers the same question: which rotation takes a vector of the sensor into `earth`, at the time of
//! each sample. `earth` is right-handed with y up, like `world`; its heading is whatever the sensor's was at the first
//! sample, because neither instrument sees north. Inside, the methods work with z up, as \[fusion\] does.
//!
//! | method | what it is |
//! |---|---|
//! | [`OrientationMethod::Gyroscope`] | rates integrated, nothing corrected: the baseline |
//! | [`OrientationMethod::Madgwick`] | gradient descent towards gravity, \[fusion\] Eqs. 1-4 |
//! | [`OrientationMethod::Vqf`] | causal: strapdown, gravity low-passed in an almost inertial frame, bias by Kalman updates |
//! | [`OrientationMethod::Smoother`] | the whole recording at once; estimates what is wrong with the sensor; the default |
//!
//! An angular rate is the rate at the instant of its time stamp, so that two neighbours give the turn between them.
//! A rate that is not a number is replaced by the last one that was; an acceleration that is not a number, or of almost
//! no magnitude (free fall), corrects nothing.

pub mod calibration;
pub mod madgwick;
mod normal_equations;
mod rest;
mod samples;
pub mod smoother;
mod strapdown;
#[cfg(test)]
mod tests;
mod vqf;
mod zero_phase;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;

/// A method that estimates orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OrientationMethod {
    /// Integration of the gyroscope alone, from the inclination of the first acceleration.
    Gyroscope,
    /// Madgwick's gradient descent with [`madgwick::DEFAULT_GAIN`].
    Madgwick,
    /// VQF without a magnetometer, causal.
    Vqf,
    /// Self-calibrating smoother over the whole recording.
    #[default]
    Smoother,
}

impl OrientationMethod {
    /// Every method, the baseline first.
    pub const ALL: [OrientationMethod; 4] = [Self::Gyroscope, Self::Madgwick, Self::Vqf, Self::Smoother];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyroscope",
            Self::Madgwick => "madgwick",
            Self::Vqf => "vqf",
            Self::Smoother => "smoother",
        }
    }
}

/// An orientation filter that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no orientation filter; there are gyroscope, madgwick, vqf and smoother")]
pub struct UnknownOrientationMethod(pub String);

impl FromStr for OrientationMethod {
    type Err = UnknownOrientationMethod;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| UnknownOrientationMethod(name.to_owned()))
    }
}

impl fmt::Display for OrientationMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What one sensor measured; all three slices are equally long.
#[derive(Debug, Clone, Copy)]
pub struct InertialSamples<'a> {
    /// Times in nanoseconds, strictly increasing; they need not be regular.
    pub time_ns: &'a [i64],
    /// Specific force in the sensor's frame, m/s²; at rest it points up with 9.81 m/s².
    pub acceleration: &'a [Vector3<f64>],
    /// Angular rate of the sensor in its own frame, rad/s.
    pub angular_rate: &'a [Vector3<f64>],
}

/// Orientation over time, and what the method learnt about the sensor.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OrientationEstimate {
    /// Rotation from the sensor's frame into `earth` (y up, heading of the first sample) at each sample.
    pub earth_from_sensor: Vec<UnitQuaternion<f64>>,
    /// Bias of the gyroscope at each sample, rad/s; empty when the method estimates none.
    pub bias: Vec<Vector3<f64>>,
    /// Standard deviation of the bias in its worst direction at each sample, rad/s; empty as `bias` is.
    pub bias_sd: Vec<f64>,
    /// True where the sensor rested; empty when the method does not ask.
    pub is_rest: Vec<bool>,
    /// Standard deviation of the inclination at each sample, rad; empty when the method does not know it. It is how far
    /// gyroscope and accelerometer contradict each other, and does not see what they have in common.
    pub inclination_sd: Vec<f64>,
}

/// Why there is no orientation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OrientationError {
    /// The slices differ in length.
    #[error(
        "{n_times} time stamps, {n_accelerations} accelerations and {n_rates} angular rates: expected as many of each"
    )]
    UnequalLengths {
        /// Time stamps.
        n_times: usize,
        /// Accelerations.
        n_accelerations: usize,
        /// Angular rates.
        n_rates: usize,
    },
    /// Time stands still or runs backwards.
    #[error("the time stamp of sample {sample} is not after the one before it")]
    TimeNotIncreasing {
        /// Index of the later sample.
        sample: usize,
    },
}

/// Orientation of a sensor by a method with its defaults.
///
/// # Errors
/// [`OrientationError`] when the slices do not fit each other or time does not increase. No samples give no orientations.
pub fn estimate(
    method: OrientationMethod,
    samples: &InertialSamples<'_>,
) -> Result<OrientationEstimate, OrientationError> {
    match method {
        OrientationMethod::Gyroscope => strapdown::integrate(samples),
        OrientationMethod::Madgwick => madgwick::estimate(samples, madgwick::DEFAULT_GAIN, None),
        OrientationMethod::Vqf => vqf::estimate(samples),
        OrientationMethod::Smoother => smoother::estimate(samples, &smoother::SmootherSettings::default()),
    }
}

/// `earth` (y up) from the frame in which the methods work (z up): x stays, z becomes y.
fn earth_from_z_up() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0, 0.0))
}

/// The smallest rotation that turns `direction` upwards (z); none needed when it has no length.
fn levelling(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let Some(d) = direction.try_normalize(0.0) else { return UnitQuaternion::identity() };
    // Exactly down there is no smallest rotation: half a turn about x does it.
    let cosine = ((1.0 + d.z) * 0.5).sqrt();
    if cosine < 1e-6 {
        return UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    }
    let s = 0.5 / cosine;
    UnitQuaternion::new_normalize(Quaternion::new(cosine, s * d.y, -s * d.x, 0.0))
}
