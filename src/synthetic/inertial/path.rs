//! The way of a rigid body through space, and what an ideal inertial unit on it reads.

use super::STANDARD_GRAVITY;
use crate::geometry::attitude::attitude_from_quaternion;
use nalgebra::{UnitQuaternion, Vector3};

/// Places of a path for each second. The fastest things on a body, impacts of 20 Hz, are sampled 25 times.
pub const GRID_HZ: f64 = 512.0;

/// Places before the time 0 and after the end, for derivatives and interpolation there.
const MARGIN: usize = 4;

/// Places of a body on an even grid of times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RigidPath {
    /// Position in `world`, metres.
    pub position: Vec<Vector3<f64>>,
    /// `world_from_imu`.
    pub rotation: Vec<UnitQuaternion<f64>>,
}

/// What an ideal unit reads on the grid.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct IdealReadings {
    /// Specific force in `imu`, m/s².
    pub force: Vec<Vector3<f64>>,
    /// Angular rate in `imu`, rad/s.
    pub rate: Vec<Vector3<f64>>,
}

/// Number of places of a recording of `end_s` seconds.
pub fn grid_len(end_s: f64) -> usize {
    (end_s * GRID_HZ).ceil() as usize + 1 + 2 * MARGIN
}

/// Time of a place, seconds.
pub fn grid_time(i: usize) -> f64 {
    (i as f64 - MARGIN as f64) / GRID_HZ
}

/// The place that a whole multiple of the grid's interval after 0 has.
pub fn grid_index(intervals: usize) -> usize {
    intervals + MARGIN
}

/// Second derivative of a course on the grid by differences of fourth order; at the two first and last places that of
/// their neighbour.
pub fn second_derivative(course: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let scale = GRID_HZ * GRID_HZ / 12.0;
    inner(course.len(), |i| {
        let sum = (course[i - 1] + course[i + 1]) * 16.0 - course[i] * 30.0 - course[i - 2] - course[i + 2];
        sum * scale
    })
}

impl RigidPath {
    /// Angular rate in `imu`, rad/s, by differences of fourth order.
    pub fn angular_rate(&self) -> Vec<Vector3<f64>> {
        let turn = |i: usize, width: usize| {
            attitude_from_quaternion(&(self.rotation[i - width].inverse() * self.rotation[i + width]))
        };
        inner(self.rotation.len(), |i| (turn(i, 1) * 8.0 - turn(i, 2)) * (GRID_HZ / 12.0))
    }

    /// What an ideal unit reads; `shock` is an acceleration in `world` that comes on top of the path's, m/s².
    pub fn readings(&self, shock: impl Fn(usize) -> Vector3<f64>) -> IdealReadings {
        let gravity = Vector3::y() * STANDARD_GRAVITY;
        let acceleration = second_derivative(&self.position).into_iter().enumerate();
        let force = acceleration.map(|(i, a)| self.rotation[i].inverse() * (a + gravity + shock(i))).collect();
        IdealReadings { force, rate: self.angular_rate() }
    }

    /// `world_from_imu` at `t` seconds.
    pub fn rotation_at(&self, t: f64) -> UnitQuaternion<f64> {
        let (i, u) = place(t, self.rotation.len());
        self.rotation[i].slerp(&self.rotation[i + 1], u)
    }
}

/// Value of a course at `t` seconds, by the polynomial of third order through the four places around it.
pub fn value_at(course: &[Vector3<f64>], t: f64) -> Vector3<f64> {
    let (i, u) = place(t, course.len());
    let weights = [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ];
    weights.iter().enumerate().map(|(k, weight)| course[i - 1 + k] * *weight).sum()
}

/// The place before a time and the share of the way to the next; times outside the grid are brought to its ends.
fn place(t: f64, len: usize) -> (usize, f64) {
    let x = (t * GRID_HZ + MARGIN as f64).clamp(1.0, len as f64 - 3.0);
    let i = (x as usize).min(len - 3);
    (i, x - i as f64)
}

/// Values of a function of the places that have two neighbours on both sides, and copies for those that do not.
fn inner(len: usize, value: impl Fn(usize) -> Vector3<f64>) -> Vec<Vector3<f64>> {
    (0..len).map(|i| value(i.clamp(2, len - 3))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit that turns about a tilted axis while it goes round a circle.
    fn circling(end_s: f64) -> RigidPath {
        let times = (0..grid_len(end_s)).map(grid_time);
        let (position, rotation) = times
            .map(|t| {
                let place = Vector3::new((5.0 * t).cos(), 0.3 * (7.0 * t).sin(), (5.0 * t).sin());
                (place, UnitQuaternion::new(Vector3::new(1.0, -2.0, 0.5) * t))
            })
            .unzip();
        RigidPath { position, rotation }
    }

    #[test]
    fn readings_are_the_derivatives_of_the_path() {
        let path = circling(2.0);
        let IdealReadings { force, rate } = path.readings(|_| Vector3::zeros());
        for i in 0..512 {
            let t = f64::from(i) / 256.0 + 0.001;
            let acceleration =
                -Vector3::new(25.0 * (5.0 * t).cos(), 0.3 * 49.0 * (7.0 * t).sin(), 25.0 * (5.0 * t).sin());
            let expected = path.rotation_at(t).inverse() * (acceleration + Vector3::y() * STANDARD_GRAVITY);
            assert!((value_at(&force, t) - expected).norm() < 1e-3, "{t}");
            assert!((value_at(&rate, t) - Vector3::new(1.0, -2.0, 0.5)).norm() < 1e-6, "{t}");
        }
    }
}
