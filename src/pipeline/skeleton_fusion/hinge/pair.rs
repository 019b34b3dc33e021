//! The two units of a joint at the same instants.

use super::{HingeError, UnitMotion};
use nalgebra::{UnitQuaternion, Vector3};

/// Shortest common time, s: a knee bends and stretches twice in it.
pub(super) const MIN_SECONDS: f64 = 5.0;

/// One unit at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    /// Specific force, m/s².
    pub acceleration: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate: Vector3<f64>,
    /// Rotation into the unit's `earth`, y up.
    pub attitude: UnitQuaternion<f64>,
}

impl Instant {
    /// The direction of up in the unit's frame.
    pub fn up(&self) -> Vector3<f64> {
        self.attitude.inverse_transform_vector(&Vector3::y())
    }
}

/// The proximal unit's samples, and the distal unit interpolated to them.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    pub time_ns: Vec<i64>,
    /// Time since the first common instant, s.
    pub seconds: Vec<f64>,
    /// Proximal, distal.
    pub units: [Vec<Instant>; 2],
}

impl Pair {
    pub fn new(units: &[UnitMotion<'_>; 2]) -> Result<Self, HingeError> {
        for unit in units {
            let n = unit.time_ns.len();
            if [unit.acceleration.len(), unit.angular_rate.len(), unit.earth_from_imu.len()] != [n; 3] {
                return Err(HingeError::UnequalLengths);
            }
        }
        let [proximal, distal] = units;
        let mut pair = Self { time_ns: Vec::new(), seconds: Vec::new(), units: [Vec::new(), Vec::new()] };
        let mut after = 0;
        for (i, &time) in proximal.time_ns.iter().enumerate() {
            while after < distal.time_ns.len() && distal.time_ns[after] < time {
                after += 1;
            }
            let [a, b] = [at(proximal, i, i, time), at(distal, after.saturating_sub(1), after, time)];
            let (Some(a), Some(b)) = (a, b) else { continue };
            let first = *pair.time_ns.first().unwrap_or(&time);
            pair.time_ns.push(time);
            pair.seconds.push((time - first) as f64 * 1e-9);
            pair.units[0].push(a);
            pair.units[1].push(b);
        }
        let seconds = pair.seconds.last().copied().unwrap_or(0.0);
        if seconds < MIN_SECONDS { Err(HingeError::NoOverlap { seconds }) } else { Ok(pair) }
    }

    pub fn len(&self) -> usize {
        self.time_ns.len()
    }

    /// Rotations of both units into the proximal unit's `earth` at an instant; `heading` turns the distal's into it.
    pub fn attitudes(&self, i: usize, heading: f64) -> [UnitQuaternion<f64>; 2] {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading);
        [self.units[0][i].attitude, turn * self.units[1][i].attitude]
    }

    /// Indices of instants at least `seconds` apart.
    pub fn thinned(&self, seconds: f64) -> Vec<usize> {
        let mut chosen: Vec<usize> = Vec::new();
        for (i, time) in self.seconds.iter().enumerate() {
            // Half a microsecond: sums of time stamps must not miss the spacing by rounding.
            if chosen.last().is_none_or(|&last| time - self.seconds[last] + 5e-7 >= seconds) {
                chosen.push(i);
            }
        }
        chosen
    }
}

/// A unit at a time between two of its samples; none outside them, or when a number is none.
fn at(unit: &UnitMotion<'_>, before: usize, after: usize, time_ns: i64) -> Option<Instant> {
    let later = *unit.time_ns.get(after)?;
    let earlier = unit.time_ns[before];
    if earlier > time_ns {
        return None;
    }
    let fraction = if later > earlier { (time_ns - earlier) as f64 / (later - earlier) as f64 } else { 0.0 };
    let instant = Instant {
        acceleration: unit.acceleration[before].lerp(&unit.acceleration[after], fraction),
        rate: unit.angular_rate[before].lerp(&unit.angular_rate[after], fraction),
        attitude: unit.earth_from_imu[before].nlerp(&unit.earth_from_imu[after], fraction),
    };
    let is_finite = instant.acceleration.iter().chain(&instant.rate).chain(instant.attitude.coords.iter());
    is_finite.into_iter().all(|value| value.is_finite()).then_some(instant)
}
