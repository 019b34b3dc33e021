//! Do accelerometer and gyroscope of one unit agree on how gravity turns in the unit?
//!
//! While a unit moves gently, its accelerometer shows the upward direction `u`, and the gyroscope says how that turns:
//! `du/dt = u × ω`. Means over windows of 0.1 s give differences Δu; least squares then give one factor for all axes
//! (k) and one for each axis of the gyroscope (s):
//!
//! ```text
//! Δu ≈ k (ū × ω̄) T          Δu ≈ Σ sᵢ ω̄ᵢ (ū × eᵢ) T
//! ```
//!
//! A sound unit has factors near 1; rates in degrees have k = π/180; a mirrored axis has sᵢ near −1, and a left-handed
//! unit has it on all three. Sums only, so a stream needs constant memory.

use super::GRAVITY_M_S2;
use nalgebra::{Matrix3, Vector3};

/// Length of a window, nanoseconds: long enough to average noise, short enough for a turn of a limb to be straight.
const WINDOW_NS: i64 = 100_000_000;

/// Farthest that a window's mean acceleration may be from gravity, m/s²: 5 % of gravity.
const GENTLE_M_S2: f64 = 0.05 * GRAVITY_M_S2;

/// Largest change of the unit vector `u` from one window to the next that counts as small, about 23°.
const MAX_CHANGE: f64 = 0.4;

/// Pairs of windows below which nothing is said: 2 s of gentle movement.
const MIN_PAIRS: u64 = 20;

/// A factor with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Factor {
    pub(super) value: f64,
    pub(super) standard_error: f64,
}

#[derive(Debug, Clone, Default)]
struct Window {
    start_ns: i64,
    n: u32,
    acceleration: Vector3<f64>,
    angular_rate: Vector3<f64>,
    since_start_s: f64,
}

/// Mean time (seconds after `start_ns`), acceleration and rate of a finished window.
#[derive(Debug, Clone)]
struct Mean {
    start_ns: i64,
    since_start_s: f64,
    acceleration: Vector3<f64>,
    angular_rate: Vector3<f64>,
}

/// The sums of the two fits.
#[derive(Debug, Clone, Default)]
pub(super) struct GravityAgreement {
    window: Window,
    previous: Option<Mean>,
    n: u64,
    squares: f64,
    normal: Matrix3<f64>,
    right: Vector3<f64>,
}

impl GravityAgreement {
    pub(super) fn push(&mut self, time_ns: i64, acceleration: &Vector3<f64>, angular_rate: &Vector3<f64>) {
        let age = i128::from(time_ns) - i128::from(self.window.start_ns);
        if self.window.n > 0 && age >= i128::from(WINDOW_NS) {
            self.close();
            if age >= 2 * i128::from(WINDOW_NS) {
                // Time was lost: the next window has no neighbour.
                self.previous = None;
            }
        }
        if self.window.n == 0 {
            self.window.start_ns = time_ns;
        }
        self.window.n += 1;
        self.window.acceleration += acceleration;
        self.window.angular_rate += angular_rate;
        self.window.since_start_s += (time_ns - self.window.start_ns) as f64 * 1e-9;
    }

    fn close(&mut self) {
        let window = std::mem::take(&mut self.window);
        let n = f64::from(window.n);
        let mean = Mean {
            start_ns: window.start_ns,
            since_start_s: window.since_start_s / n,
            acceleration: window.acceleration / n,
            angular_rate: window.angular_rate / n,
        };
        let is_gentle = (mean.acceleration.norm() - GRAVITY_M_S2).abs() < GENTLE_M_S2;
        if let Some(previous) = self.previous.take().filter(|_| is_gentle) {
            self.add(&previous, &mean);
        }
        self.previous = is_gentle.then_some(mean);
    }

    fn add(&mut self, before: &Mean, after: &Mean) {
        let dt = (after.start_ns - before.start_ns) as f64 * 1e-9 + after.since_start_s - before.since_start_s;
        let (u, v) = (before.acceleration.normalize(), after.acceleration.normalize());
        let change = v - u;
        if change.norm() > MAX_CHANGE {
            return;
        }
        let (up, rate) = ((u + v) / 2.0, (before.angular_rate + after.angular_rate) / 2.0);
        let turns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| up.cross(&axis) * rate.dot(&axis) * dt);
        let columns = Matrix3::from_columns(&turns);
        self.normal += columns.transpose() * columns;
        self.right += columns.transpose() * change;
        self.squares += change.norm_squared();
        self.n += 1;
    }

    /// The factor of all axes, k.
    pub(super) fn overall(&self) -> Option<Factor> {
        let normal = self.normal.sum();
        if self.n < MIN_PAIRS || normal <= f64::MIN_POSITIVE {
            return None;
        }
        let value = self.right.sum() / normal;
        let variance = (self.squares - value * self.right.sum()).max(0.0) / (2 * self.n - 1) as f64;
        Some(Factor { value, standard_error: (variance / normal).sqrt() })
    }

    /// The factor of each axis of the gyroscope, s; nothing where the unit did not turn about an axis.
    pub(super) fn of_axes(&self) -> Option<[Factor; 3]> {
        if self.n < MIN_PAIRS {
            return None;
        }
        let inverse = self.normal.try_inverse()?;
        let value = inverse * self.right;
        let variance = (self.squares - value.dot(&self.right)).max(0.0) / (2 * self.n - 3) as f64;
        let factor =
            |i: usize| Factor { value: value[i], standard_error: (variance * inverse[(i, i)].max(0.0)).sqrt() };
        Some([factor(0), factor(1), factor(2)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// A unit that turns about all axes for 20 s at 100 Hz, its gyroscope changed by `measured`.
    fn agreement(measured: impl Fn(Vector3<f64>) -> Vector3<f64>) -> GravityAgreement {
        let mut agreement = GravityAgreement::default();
        let mut world_from_imu = UnitQuaternion::identity();
        for i in 0..2000 {
            let t = f64::from(i) * 0.01;
            let rate = Vector3::new((1.3 * t).sin(), 0.8 * (0.9 * t + 1.0).cos(), 0.7 * (1.7 * t).sin());
            let up = world_from_imu.inverse() * Vector3::new(0.0, GRAVITY_M_S2, 0.0);
            agreement.push(i64::from(i) * 10_000_000, &up, &measured(rate));
            world_from_imu *= UnitQuaternion::from_scaled_axis(rate * 0.01);
        }
        agreement
    }

    #[test]
    fn a_sound_unit_has_factors_of_one() {
        let agreement = agreement(|rate| rate);
        let factors = agreement.of_axes().unwrap();
        // Windows of 0.1 s bend a turn of 1 rad/s by less than 1 %.
        assert!(factors.iter().all(|factor| (factor.value - 1.0).abs() < 0.01), "{factors:?}");
        assert!((agreement.overall().unwrap().value - 1.0).abs() < 0.01);
    }

    #[test]
    fn rates_in_degrees_have_a_factor_of_pi_over_180() {
        let factor = agreement(|rate| rate.map(f64::to_degrees)).overall().unwrap();
        assert!((factor.value.to_degrees() - 1.0).abs() < 0.01 && factor.standard_error < 1e-3, "{factor:?}");
    }

    #[test]
    fn a_mirrored_axis_has_a_factor_of_minus_one() {
        let factors = agreement(|rate| Vector3::new(rate.x, -rate.y, rate.z)).of_axes().unwrap();
        let expected = [1.0, -1.0, 1.0];
        assert!(factors.iter().zip(expected).all(|(factor, s)| (factor.value - s).abs() < 0.01), "{factors:?}");
    }

    #[test]
    fn a_unit_that_does_not_turn_or_is_shaken_hard_says_nothing() {
        let still = agreement(|_| Vector3::zeros());
        assert!(still.overall().is_none() && still.of_axes().is_none());
        let mut shaken = GravityAgreement::default();
        (0..2000).for_each(|i| shaken.push(i * 10_000_000, &Vector3::new(20.0, 0.0, 0.0), &Vector3::x()));
        assert!(shaken.overall().is_none());
    }
}
