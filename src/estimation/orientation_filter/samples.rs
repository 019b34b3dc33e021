//! Samples made safe: finite, with the time since the one before.

use super::{InertialSamples, OrientationError};
use nalgebra::Vector3;

/// Acceleration below which gravity's direction is not in it (free fall), m/s²: ten times the noise of common sensors.
const MIN_ACCELERATION: f64 = 0.2;
/// Magnitudes above which a sample is a defect of the recording: twenty times the range of common sensors
/// (2000 °/s, 16 g). The bound keeps squares finite.
const MAX_ACCELERATION: f64 = 3200.0;
const MAX_RATE: f64 = 700.0;

/// One sample that any method can take.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Time since the sample before, s; for the first the time to the next, or 0 when there is none.
    pub seconds: f64,
    /// Angular rate, rad/s, finite.
    pub rate: Vector3<f64>,
    /// Specific force, m/s²; zero where it was not measured.
    pub acceleration: Vector3<f64>,
    /// True where the force was measured. In free fall it was, and is almost zero: it then shows no direction, but a mean
    /// over a jump is only right with it.
    pub is_force: bool,
}

impl Sample {
    /// True when the acceleration says something about gravity.
    pub(super) fn has_gravity(&self) -> bool {
        self.is_force && self.acceleration.norm_squared() > MIN_ACCELERATION * MIN_ACCELERATION
    }
}

/// The samples in order, made safe as the module's doc says.
pub(super) fn safe(samples: &InertialSamples<'_>) -> Result<Vec<Sample>, OrientationError> {
    let InertialSamples { time_ns, acceleration, angular_rate } = *samples;
    if acceleration.len() != time_ns.len() || angular_rate.len() != time_ns.len() {
        return Err(OrientationError::UnequalLengths {
            n_times: time_ns.len(),
            n_accelerations: acceleration.len(),
            n_rates: angular_rate.len(),
        });
    }
    let seconds = |i: usize| time_ns[i].saturating_sub(time_ns[i - 1]) as f64 * 1e-9;
    let mut last_rate = Vector3::zeros();
    let mut safe = Vec::with_capacity(time_ns.len());
    for (i, (rate, acceleration)) in angular_rate.iter().zip(acceleration).enumerate() {
        if i > 0 && time_ns[i] <= time_ns[i - 1] {
            return Err(OrientationError::TimeNotIncreasing { sample: i });
        }
        // A comparison with NaN is false, so what is not a number goes with what is too large.
        if rate.norm_squared() < MAX_RATE * MAX_RATE {
            last_rate = *rate;
        }
        let is_force = acceleration.norm_squared() < MAX_ACCELERATION * MAX_ACCELERATION;
        safe.push(Sample {
            seconds: match (i, time_ns.len()) {
                (0, 1) => 0.0,
                (0, _) => seconds(1),
                _ => seconds(i),
            },
            rate: last_rate,
            acceleration: if is_force { *acceleration } else { Vector3::zeros() },
            is_force,
        });
    }
    Ok(safe)
}
