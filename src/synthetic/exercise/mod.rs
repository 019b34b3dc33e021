//! The exercises of \[angles\]: each starts at rest in the T-posture, lowers the arms and then moves.
//!
//! A new exercise is one file with one function of the phase and one line in [`Exercise`].

mod back_knee;
mod near_tandem;
mod side_hip;
mod sit_front_knee;
mod step;

use super::motion::between;
use super::posture::{ANKLE_HEIGHT_SHARE, Arm, Leg, LegAngles, Posture, Stance, Trunk, limbs_of};
use super::subject::{Habit, Subject};
use crate::body::Side;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt;
use std::str::FromStr;

/// Time at rest in the T-posture at the start, seconds.
pub const REST_S: f64 = 2.0;

/// Time in which the arms come down, seconds.
pub const ARMS_DOWN_S: f64 = 1.4;

/// Quiet time before the end, seconds.
pub const END_S: f64 = 0.3;

/// One of the paper's five exercises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Exercise {
    /// Alternate knee flexion in standing.
    BackKnee,
    /// Sitting down, then alternate elevation of the shank.
    SitFrontKnee,
    /// Alternate elevation of the straight leg to the side, in standing.
    SideHip,
    /// Alternate stepping forward onto a low step and back.
    Step,
    /// Standing with one foot in front of the other.
    NearTandem,
}

impl Exercise {
    /// Every exercise, in the paper's order.
    pub const ALL: [Exercise; 5] =
        [Exercise::BackKnee, Exercise::SitFrontKnee, Exercise::SideHip, Exercise::Step, Exercise::NearTandem];

    /// Name in commands and as the recording's protocol.
    pub fn name(self) -> &'static str {
        match self {
            Exercise::BackKnee => "back_knee",
            Exercise::SitFrontKnee => "sit_front_knee",
            Exercise::SideHip => "side_hip",
            Exercise::Step => "step",
            Exercise::NearTandem => "near_tandem",
        }
    }

    /// The body at `t` seconds of an exercise that lasts `duration_s`.
    pub fn stance(self, subject: &Subject, duration_s: f64, t: f64) -> Stance {
        let active = ActiveTime { start_s: REST_S + ARMS_DOWN_S, end_s: duration_s - END_S };
        self.posture(subject, active, t).stand(&subject.skeleton)
    }

    /// What the exercise asks of the body at `t` seconds, when it may move in a given time only.
    pub(in crate::synthetic) fn posture(self, subject: &Subject, active: ActiveTime, t: f64) -> Posture {
        let sway = match self {
            Exercise::NearTandem => near_tandem::SWAY,
            _ => 1.0,
        };
        let mut posture = standing(subject, sway, t);
        match self {
            Exercise::BackKnee => back_knee::shape(&mut posture, subject, active, t),
            Exercise::SitFrontKnee => sit_front_knee::shape(&mut posture, subject, active, t),
            Exercise::SideHip => side_hip::shape(&mut posture, subject, active, t),
            Exercise::Step => step::shape(&mut posture, subject, active, t),
            Exercise::NearTandem => near_tandem::shape(&mut posture, subject, active, t),
        }
        posture
    }
}

/// A name that no exercise has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not an exercise; there are back_knee, sit_front_knee, side_hip, step and near_tandem")]
pub struct UnknownExercise(pub String);

impl FromStr for Exercise {
    type Err = UnknownExercise;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|e| e.name() == name).ok_or_else(|| UnknownExercise(name.to_owned()))
    }
}

impl fmt::Display for Exercise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Time in which an exercise may move, seconds.
#[derive(Debug, Clone, Copy)]
pub(in crate::synthetic) struct ActiveTime {
    pub(in crate::synthetic) start_s: f64,
    pub(in crate::synthetic) end_s: f64,
}

/// Sign of a side along Z.
pub(in crate::synthetic) fn outward(side: Side) -> f64 {
    if side == Side::Left { -1.0 } else { 1.0 }
}

/// Standing on both feet: the T-posture at first, then hanging arms; breathing and sway throughout.
///
/// Root mean square of the sway is `sway` times the values here, but a tenth of them while the subject holds still for the
/// calibration.
pub(in crate::synthetic) fn standing(subject: &Subject, sway: f64, t: f64) -> Posture {
    /// Breathing: 15 breaths a minute that tip the trunk by a quarter of a degree.
    const BREATH_HZ: f64 = 0.25;
    const BREATH_DEG: f64 = 0.25;
    /// Sway while holding the T-posture, share.
    const STILL: f64 = 0.1;

    let lowered = between(REST_S, REST_S + ARMS_DOWN_S, t);
    let sway = STILL + (sway - STILL) * lowered;
    let wander_deg = |habit: Habit, rms_deg: f64| sway * subject.wander(habit, t) * rms_deg.to_radians();
    let wander_m = |habit: Habit, rms_m: f64| sway * subject.wander(habit, t) * rms_m;
    let ankle_height = ANKLE_HEIGHT_SHARE * subject.stature_m;

    let arm = |side: Side| Arm {
        abduction: FRAC_PI_2 + (subject.arm_hang - FRAC_PI_2) * lowered + wander_deg(Habit::ArmAbduction(side), 1.5),
        flexion: 3f64.to_radians() * lowered + wander_deg(Habit::ArmFlexion(side), 2.0),
        elbow: (2.0 + 10.0 * lowered).to_radians() + wander_deg(Habit::Elbow(side), 1.5),
    };
    let leg = |side: Side| {
        let (_, limb) = limbs_of(side);
        Leg {
            ankle: Vector3::new(0.0, ankle_height, subject.skeleton.offsets[limb.index()].z),
            support: 1.0,
            axial: -subject.toe_out + wander_deg(Habit::HipAxial(side), 1.2),
            lifted: LegAngles::default(),
            lift: 0.0,
        }
    };
    let breath = BREATH_DEG.to_radians() * (TAU * BREATH_HZ * t).sin();
    Posture {
        trunk: Trunk {
            flexion: breath + wander_deg(Habit::TrunkFlexion, 0.8),
            lateral: wander_deg(Habit::TrunkLateral, 0.6),
            axial: wander_deg(Habit::TrunkAxial, 1.0),
        },
        pelvis: [wander_m(Habit::PelvisForward, 0.006), wander_m(Habit::PelvisRight, 0.005)],
        seat: (0.0, 0.0),
        rise: 0.0,
        arms: Side::BOTH.map(arm),
        legs: Side::BOTH.map(leg),
    }
}

#[cfg(test)]
mod tests;
