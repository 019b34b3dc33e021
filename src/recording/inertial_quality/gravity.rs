//! Do accelerometer and gyroscope of one unit agree on how gravity turns in the unit?
//!
//! Where the accelerometer reads gravity alone for 0.1 s, it shows the upward direction `u`. Between two such instants the
//! gyroscope is integrated once as it is and once for each [`Fault`] undone; what carries the first `u` to the second is
//! right. Movement in between does not matter, since the accelerometer is not read there. Sums only: constant memory.

use super::GRAVITY_M_S2;
use nalgebra::{UnitQuaternion, Vector3};

/// Length of a window, nanoseconds.
const WINDOW_NS: i64 = 100_000_000;

/// Farthest that any acceleration in the window may be from gravity, m/s²: 3 % of gravity.
const QUIET_M_S2: f64 = 0.03 * GRAVITY_M_S2;

/// Time between two instants that are compared, nanoseconds: long enough to turn, short enough for no gyroscope to drift.
const APART_NS: std::ops::RangeInclusive<i64> = 500_000_000..=5_000_000_000;

/// Longest interval between samples over which a rate is integrated, nanoseconds.
const MAX_INTERVAL_NS: i64 = 200_000_000;

/// Turn of `u` below which two instants are not compared, radians: 5°; a gyroscope that is stuck proves nothing.
const TURNED: f64 = 0.087;

/// Angle between the gyroscope's answer as it is and with a fault undone that tells the two apart, radians: 15°.
const TOLD_APART: f64 = 0.262;

/// Comparisons that tell a fault apart, below which nothing is said of it.
const MIN_COMPARED: u64 = 5;

/// Largest root mean square error of a fault undone that is believed, radians: 10°.
const EXPLAINED: f64 = 0.175;

/// The error of the gyroscope as it is must be larger than that of a fault undone by this factor.
const CLEARLY: f64 = 3.0;

/// What can be wrong with a gyroscope.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fault {
    /// Degrees per second instead of radians.
    Degrees,
    /// One axis has the wrong sign, by its index.
    Mirrored(usize),
    /// All axes have the wrong sign, which a left-handed frame shows as well.
    LeftHanded,
}

impl Fault {
    const ALL: [Fault; 5] =
        [Fault::Degrees, Fault::Mirrored(0), Fault::Mirrored(1), Fault::Mirrored(2), Fault::LeftHanded];

    /// What a turn as the gyroscope tells it is with the fault undone. `in_degrees` is the turn if the rates were in
    /// degrees; all others turn by the same angle about another axis.
    fn undone(self, turn: &UnitQuaternion<f64>, in_degrees: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        match self {
            Fault::Degrees => *in_degrees,
            Fault::Mirrored(axis) => {
                let mut mirrored = turn.into_inner();
                mirrored.coords[axis] = -mirrored.coords[axis];
                UnitQuaternion::new_unchecked(mirrored)
            }
            Fault::LeftHanded => turn.conjugate(),
        }
    }
}

/// Gravity carried along by the gyroscope as it is, and by each fault undone.
#[derive(Debug, Clone)]
pub(super) struct GravityAgreement {
    last_ns: Option<i64>,
    window_ns: i64,
    n: u32,
    sum: Vector3<f64>,
    is_quiet: bool,
    /// Time of the instant that was left, and `u` there carried to now.
    anchor: Option<(i64, Vector3<f64>, [Vector3<f64>; 6])>,
    evidence: [Evidence; 5],
}

impl Default for GravityAgreement {
    fn default() -> Self {
        Self {
            last_ns: None,
            window_ns: 0,
            n: 0,
            sum: Vector3::zeros(),
            is_quiet: true,
            anchor: None,
            evidence: Default::default(),
        }
    }
}

impl GravityAgreement {
    pub(super) fn push(&mut self, time_ns: i64, acceleration: &Vector3<f64>, angular_rate: &Vector3<f64>) {
        let interval_ns = self.last_ns.map_or(0, |last| time_ns.saturating_sub(last));
        self.last_ns = Some(time_ns);
        if interval_ns > MAX_INTERVAL_NS {
            (self.anchor, self.n) = (None, 0);
        }
        self.carry(time_ns, angular_rate, interval_ns as f64 * 1e-9);
        if self.n == 0 {
            (self.window_ns, self.sum, self.is_quiet) = (time_ns, Vector3::zeros(), true);
        }
        self.n += 1;
        self.sum += acceleration;
        self.is_quiet &= (acceleration.norm() - GRAVITY_M_S2).abs() < QUIET_M_S2;
        if time_ns - self.window_ns >= WINDOW_NS {
            if self.is_quiet {
                self.compare(time_ns);
            }
            self.n = 0;
        }
    }

    /// Turns what was seen at the anchor to now: a direction that rests in the world turns backwards in the unit.
    fn carry(&mut self, time_ns: i64, rate: &Vector3<f64>, dt: f64) {
        let Some((since_ns, _, carried)) = &mut self.anchor else { return };
        if time_ns - *since_ns > *APART_NS.end() {
            self.anchor = None;
            return;
        }
        let [as_it_is, undone @ ..] = carried;
        let turn = UnitQuaternion::from_scaled_axis(-rate * dt);
        let in_degrees = UnitQuaternion::from_scaled_axis(-rate.map(f64::to_radians) * dt);
        *as_it_is = turn * *as_it_is;
        for (up, fault) in undone.iter_mut().zip(Fault::ALL) {
            *up = fault.undone(&turn, &in_degrees) * *up;
        }
    }

    fn compare(&mut self, time_ns: i64) {
        // The window's mean belongs to its middle; half a window of a gentle turn is small beside 10 degrees.
        let up = self.sum.normalize();
        if let Some((since_ns, before, [as_it_is, undone @ ..])) = &self.anchor {
            let apart = time_ns - since_ns;
            if apart < *APART_NS.start() {
                return;
            }
            if before.angle(&up) > TURNED {
                for (evidence, undone) in self.evidence.iter_mut().zip(undone) {
                    if as_it_is.angle(undone) > TOLD_APART {
                        evidence.n += 1;
                        evidence.as_it_is += as_it_is.angle(&up).powi(2);
                        evidence.undone += undone.angle(&up).powi(2);
                    }
                }
            }
        }
        self.anchor = Some((time_ns, up, [up; 6]));
    }

    /// The fault that explains how gravity turned, when one does and the gyroscope as it is does not.
    pub(super) fn fault(&self) -> Option<Fault> {
        let faults = Fault::ALL.into_iter().zip(&self.evidence).filter(|(_, evidence)| evidence.is_clear());
        let least = faults.min_by(|(_, a), (_, b)| a.error().total_cmp(&b.error()));
        least.map(|(fault, _)| fault)
    }
}

/// Sums over the comparisons that tell one fault apart: squared errors of the gyroscope as it is and with it undone.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    n: u64,
    as_it_is: f64,
    undone: f64,
}

impl Evidence {
    /// Root mean square error with the fault undone, radians.
    fn error(&self) -> f64 {
        (self.undone / self.n as f64).sqrt()
    }

    fn is_clear(&self) -> bool {
        let as_it_is = (self.as_it_is / self.n as f64).sqrt();
        self.n >= MIN_COMPARED && self.error() < EXPLAINED && as_it_is > CLEARLY * self.error()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is found of a unit that turns about all axes for 20 s at 100 Hz, its gyroscope changed by `measured`, pushed
    /// about by up to `push` m/s².
    fn found(push: f64, measured: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Option<Fault> {
        let mut agreement = GravityAgreement::default();
        let mut world_from_imu = UnitQuaternion::identity();
        for i in 0..2000 {
            let t = f64::from(i) * 0.01;
            let rate = Vector3::new((1.3 * t).sin(), 0.8 * (0.9 * t + 1.0).cos(), 0.7 * (1.7 * t).sin());
            // Pushed every other second.
            let pushed = if i % 200 < 100 { push * (8.0 * t).sin() } else { 0.0 };
            let up = world_from_imu.inverse() * Vector3::new(pushed, GRAVITY_M_S2, pushed);
            agreement.push(i64::from(i) * 10_000_000, &up, &measured(rate));
            world_from_imu *= UnitQuaternion::from_scaled_axis(rate * 0.01);
        }
        agreement.fault()
    }

    #[test]
    fn a_sound_unit_has_no_fault_however_it_is_pushed() {
        for push in [0.0, 2.0, 20.0] {
            assert_eq!(found(push, |rate| rate), None, "{push} m/s²");
        }
    }

    #[test]
    fn every_fault_is_found_also_in_a_unit_that_is_pushed() {
        for push in [0.0, 2.0, 20.0] {
            assert_eq!(found(push, |rate| rate.map(f64::to_degrees)), Some(Fault::Degrees), "{push} m/s²");
            assert_eq!(found(push, |rate| -rate), Some(Fault::LeftHanded), "{push} m/s²");
            for axis in 0..3 {
                let mirrored = |mut rate: Vector3<f64>| {
                    rate[axis] = -rate[axis];
                    rate
                };
                assert_eq!(found(push, mirrored), Some(Fault::Mirrored(axis)), "{push} m/s²");
            }
        }
    }

    #[test]
    fn a_unit_that_does_not_turn_says_nothing() {
        let mut still = GravityAgreement::default();
        (0..2000).for_each(|i| still.push(i * 10_000_000, &Vector3::new(0.0, 9.8, 0.0), &Vector3::x()));
        assert_eq!(still.fault(), None);
    }
}
