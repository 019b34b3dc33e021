//! Vertical jumps: crouch, push-off, flight, landing, standing up (\[fusion\] lets the subject do five of them, so that
//! every clock sees the same instants).
//!
//! The pelvis and the ankles go along courses of fifth order that join without a step in acceleration. Both leave with
//! the velocity `g T / 2` for a flight of `T` and the acceleration `−g`, so that nothing presses on anything while the
//! body is in the air.

use super::STANDARD_GRAVITY;
use crate::synthetic::motion::{Quintic, between};
use crate::synthetic::posture::Posture;
use rand::{Rng, RngExt};
use std::ops::Range;

/// Time to go down, seconds.
const CROUCH_S: f64 = 0.55;
/// Time from the deepest point to take-off, seconds.
const PUSH_OFF_S: f64 = 0.40;
/// Time from touching the floor to the deepest point, seconds.
const LANDING_S: f64 = 0.36;
/// Time to stand up again, seconds.
const STAND_UP_S: f64 = 0.70;
/// Depth before the jump and after it, metres for a stature of 1.7 m.
const DEPTH_M: f64 = 0.22;
const LANDING_DEPTH_M: f64 = 0.18;
/// How far the heels come up before the toes leave the floor, metres for a stature of 1.7 m.
const HEEL_RISE_M: f64 = 0.085;
/// Time in which the heels come up, and in which they come down after landing, seconds.
const HEEL_UP_S: f64 = 0.13;
const HEEL_DOWN_S: f64 = 0.11;
/// Shortest and longest flight, seconds.
const FLIGHT_S: [f64; 2] = [0.25, 0.35];
/// Shortest and longest quiet time before a jump, seconds: nobody jumps like a metronome.
const PAUSE_S: [f64; 2] = [0.3, 1.0];
/// Bending of trunk and arms in the deepest crouch.
const TRUNK_DEG: f64 = 24.0;
const ARMS_BACK_DEG: f64 = 25.0;
/// Way of the pelvis backwards for each metre of crouch.
const BACKWARD: f64 = 0.45;

/// One jump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// Beginning of the crouch, seconds.
    pub start_s: f64,
    /// The instant at which the feet leave the floor, seconds.
    pub take_off_s: f64,
    /// The instant at which they touch it again, seconds.
    pub touch_down_s: f64,
    /// The subject stands again, seconds.
    pub end_s: f64,
    /// Size of the body against a stature of 1.7 m.
    scale: f64,
}

/// Heights of one instant, metres above those in standing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Heights {
    pelvis: f64,
    ankles: f64,
}

impl Jump {
    /// A jump that starts at an instant and flies for a time, both in seconds, of a body of a stature in metres.
    pub fn new(start_s: f64, flight_s: f64, stature_m: f64) -> Self {
        let take_off_s = start_s + CROUCH_S + PUSH_OFF_S;
        let touch_down_s = take_off_s + flight_s;
        let end_s = touch_down_s + LANDING_S + STAND_UP_S;
        Self { start_s, take_off_s, touch_down_s, end_s, scale: stature_m / 1.7 }
    }

    /// Jumps with pauses before them, from an instant on, in seconds.
    pub fn series(count: usize, start_s: f64, stature_m: f64, rng: &mut impl Rng) -> Vec<Jump> {
        let mut end_s = start_s;
        let mut draw = || {
            let start_s = end_s + rng.random_range(PAUSE_S[0]..PAUSE_S[1]);
            let jump = Jump::new(start_s, rng.random_range(FLIGHT_S[0]..FLIGHT_S[1]), stature_m);
            end_s = jump.end_s;
            jump
        };
        (0..count).map(|_| draw()).collect()
    }

    /// Time in the air, seconds.
    pub fn flight(&self) -> Range<f64> {
        self.take_off_s..self.touch_down_s
    }

    /// Vertical velocity at take-off, m/s; the same downwards at touch-down.
    pub fn take_off_velocity(&self) -> f64 {
        STANDARD_GRAVITY * (self.touch_down_s - self.take_off_s) / 2.0
    }

    /// Changes what is asked of a standing body at `t` seconds.
    pub(super) fn shape(&self, posture: &mut Posture, t: f64) {
        let Heights { pelvis, ankles } = self.heights(t);
        let crouch = ankles - pelvis;
        posture.rise += pelvis - ankles;
        posture.pelvis[0] -= BACKWARD * crouch;
        let share = crouch / (DEPTH_M * self.scale);
        posture.trunk.flexion += (TRUNK_DEG * share).to_radians();
        for arm in &mut posture.arms {
            arm.flexion -= (ARMS_BACK_DEG * share).to_radians();
        }
        for leg in &mut posture.legs {
            leg.ankle.y += ankles;
        }
    }

    fn heights(&self, t: f64) -> Heights {
        let velocity = self.take_off_velocity();
        let heel = HEEL_RISE_M * self.scale;
        let leaving = [heel, velocity, -STANDARD_GRAVITY];
        let touching = [heel, -velocity, -STANDARD_GRAVITY];
        let lowest = |depth: f64| [-depth * self.scale, 0.0, 0.0];
        let floor = [0.0; 3];
        let landed_s = self.touch_down_s + LANDING_S;
        if t <= self.start_s || t >= self.end_s {
            Heights::default()
        } else if t < self.take_off_s {
            let pushing_s = self.take_off_s - PUSH_OFF_S;
            let heels_s = self.take_off_s - HEEL_UP_S;
            Heights {
                pelvis: match t < pushing_s {
                    true => lowest(DEPTH_M)[0] * between(self.start_s, pushing_s, t),
                    false => Quintic::between(pushing_s, lowest(DEPTH_M), self.take_off_s, leaving).at(t),
                },
                ankles: match t < heels_s {
                    true => 0.0,
                    false => Quintic::between(heels_s, floor, self.take_off_s, leaving).at(t),
                },
            }
        } else if t < self.touch_down_s {
            let u = t - self.take_off_s;
            let height = heel + velocity * u - STANDARD_GRAVITY * u * u / 2.0;
            Heights { pelvis: height, ankles: height }
        } else {
            let flat_s = self.touch_down_s + HEEL_DOWN_S;
            Heights {
                pelvis: match t < landed_s {
                    true => Quintic::between(self.touch_down_s, touching, landed_s, lowest(LANDING_DEPTH_M)).at(t),
                    false => lowest(LANDING_DEPTH_M)[0] * (1.0 - between(landed_s, self.end_s, t)),
                },
                ankles: match t < flat_s {
                    true => Quintic::between(self.touch_down_s, touching, flat_s, floor).at(t),
                    false => 0.0,
                },
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_smooth_and_the_body_falls_freely_in_flight() {
        for flight_s in FLIGHT_S {
            let jump = Jump::new(1.0, flight_s, 1.7);
            let h = 1e-3;
            let acceleration = |t: f64, of: fn(&Heights) -> f64| {
                let at = |t: f64| of(&jump.heights(t));
                (at(t + h) - 2.0 * at(t) + at(t - h)) / (h * h)
            };
            for i in 900..4500 {
                let t = f64::from(i) * h;
                let Heights { pelvis, ankles } = jump.heights(t);
                assert!(pelvis <= ankles + 1e-9, "legs longer than they are at {t}: {}", pelvis - ankles);
                assert!(ankles >= -1e-3, "ankles under the floor at {t}: {ankles}");
                let [up, heel] = [acceleration(t, |x| x.pelvis), acceleration(t, |x| x.ankles)];
                assert!(up.abs() < 30.0 && heel.abs() < 90.0, "{t}: {up} {heel}");
                if jump.flight().contains(&(t - h)) && jump.flight().contains(&(t + h)) {
                    assert!((up + STANDARD_GRAVITY).abs() < 1e-4 && (heel - up).abs() < 1e-4);
                }
            }
        }
    }

    #[test]
    fn jumps_follow_each_other_without_overlap() {
        use rand::SeedableRng;
        let jumps = Jump::series(5, 3.0, 1.6, &mut rand_chacha::ChaCha8Rng::seed_from_u64(3));
        assert_eq!(jumps.len(), 5);
        assert!(jumps[0].start_s >= 3.3 && jumps.windows(2).all(|w| w[1].start_s > w[0].end_s + 0.29));
    }
}
