//! Who does the exercise: build, tempo, habits.

use super::motion::Wander;
use crate::body::{Side, Skeleton};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random stream of the subject's habits; sensors use others.
const SUBJECT_STREAM: u64 = 1;

/// Part of the body that wanders on its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Habit {
    /// Bending forwards and back.
    TrunkFlexion,
    /// Bending sideways.
    TrunkLateral,
    /// Turning.
    TrunkAxial,
    /// Pelvis forwards and back.
    PelvisForward,
    /// Pelvis to the right and left.
    PelvisRight,
    /// Arm out, by side.
    ArmAbduction(Side),
    /// Arm forwards, by side.
    ArmFlexion(Side),
    /// Elbow, by side.
    Elbow(Side),
    /// Thigh about its axis, by side.
    HipAxial(Side),
    /// Lifted leg, by side.
    FreeLeg(Side),
}

const HABITS: usize = 15;

impl Habit {
    fn index(self) -> usize {
        match self {
            Habit::TrunkFlexion => 0,
            Habit::TrunkLateral => 1,
            Habit::TrunkAxial => 2,
            Habit::PelvisForward => 3,
            Habit::PelvisRight => 4,
            Habit::ArmAbduction(side) => 5 + side as usize,
            Habit::ArmFlexion(side) => 7 + side as usize,
            Habit::Elbow(side) => 9 + side as usize,
            Habit::HipAxial(side) => 11 + side as usize,
            Habit::FreeLeg(side) => 13 + side as usize,
        }
    }
}

/// One person, drawn from a seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    /// Height of the body, metres.
    pub stature_m: f64,
    /// Segment lengths, those of the average adult of this stature.
    pub skeleton: Skeleton,
    /// Factor of every amplitude, about 1.
    pub amplitude: f64,
    /// Factor of every duration, about 1.
    pub slowness: f64,
    /// Side that begins.
    pub leading: Side,
    /// Ratio of the left side's amplitude to the mean of both, about 1.
    left_share: f64,
    /// Phase of the variation between repetitions, radians.
    variation_phase: f64,
    /// Turn of the feet to the outside in standing, radians.
    pub toe_out: f64,
    /// Abduction of the hanging arms, radians.
    pub arm_hang: f64,
    wanders: [Wander; HABITS],
}

impl Subject {
    /// The person of a seed. Amplitudes differ between people by ±8 %, tempo by ±12 %, sides by ±6 %.
    pub fn of_seed(seed: u64, stature_m: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(SUBJECT_STREAM);
        let mut about_one = |spread: f64| 1.0 + spread * (2.0 * rng.random::<f64>() - 1.0);
        let [amplitude, slowness, left_share] = [about_one(0.08), about_one(0.12), about_one(0.06)];
        Self {
            stature_m,
            skeleton: Skeleton::of_stature(stature_m),
            amplitude,
            slowness,
            leading: if rng.random::<bool>() { Side::Right } else { Side::Left },
            left_share,
            variation_phase: std::f64::consts::TAU * rng.random::<f64>(),
            toe_out: (2.0 * rng.random::<f64>()).to_radians(),
            arm_hang: (9.0 + 6.0 * rng.random::<f64>()).to_radians(),
            wanders: std::array::from_fn(|_| Wander::draw(&mut rng)),
        }
    }

    /// Wandering of a part of the body at `t` seconds, with a root mean square of 1.
    pub fn wander(&self, habit: Habit, t: f64) -> f64 {
        self.wanders[habit.index()].at(t)
    }

    /// Side that moves in a repetition: sides alternate.
    pub fn side_of(&self, repetition: usize) -> Side {
        if repetition.is_multiple_of(2) { self.leading } else { self.leading.opposite() }
    }

    /// Factor of the amplitude in a repetition: the subject's own, the side's, and ±5 % from one to the next.
    pub fn amplitude_of(&self, repetition: usize) -> f64 {
        /// The golden angle, radians: successive sines never fall into a pattern.
        const GOLDEN_ANGLE: f64 = 2.399_963;
        let side = match self.side_of(repetition) {
            Side::Left => self.left_share,
            Side::Right => 2.0 - self.left_share,
        };
        let variation = 0.05 * (GOLDEN_ANGLE * repetition as f64 + self.variation_phase).sin();
        self.amplitude * side * (1.0 + variation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_a_person_and_another_seed_another_person() {
        assert_eq!(Subject::of_seed(3, 1.7), Subject::of_seed(3, 1.7));
        assert_ne!(Subject::of_seed(3, 1.7).amplitude, Subject::of_seed(4, 1.7).amplitude);
    }

    #[test]
    fn sides_alternate_and_amplitudes_stay_near_one() {
        for seed in 0..50 {
            let subject = Subject::of_seed(seed, 1.7);
            assert_ne!(subject.side_of(0), subject.side_of(1));
            // 8 % of the person, 6 % of the side and 5 % of the repetition on top of each other.
            assert!((0..20).all(|r| (0.8..1.22).contains(&subject.amplitude_of(r))));
        }
    }
}
