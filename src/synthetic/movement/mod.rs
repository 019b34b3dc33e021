//! What a subject does: an exercise of \[angles\], a movement of \[fusion\], or a motion that was recorded.

mod elbow;
mod kick;
pub mod recorded;
mod spline;

use super::exercise::{ActiveTime, Exercise, UnknownExercise, standing};
use super::motion::between;
use super::posture::{Posture, Stance};
use super::subject::Subject;
use crate::body::pose::PoseVector;
use crate::body::{Pose, Side};
use recorded::RecordedMotion;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// Time in which a subject goes over from standing into a recorded motion, seconds.
const JOINING_S: f64 = 1.5;

/// A movement that starts and, unless it was recorded, ends in standing.
#[derive(Debug, Clone, PartialEq)]
pub enum Movement {
    /// One of the five exercises of \[angles\].
    Exercise(Exercise),
    /// Standing on one leg while the knee of the other, whose side is given, flexes and extends (\[fusion\]).
    Kick(Side),
    /// Flexing the elbows in turn (\[fusion\]).
    Elbow,
    /// What somebody else did, forth and back.
    Recorded(Arc<RecordedMotion>),
}

impl Movement {
    /// The movements of \[fusion\].
    pub const OF_FUSION: [Movement; 3] = [Movement::Kick(Side::Right), Movement::Kick(Side::Left), Movement::Elbow];

    /// Name in commands and as the recording's protocol.
    pub fn name(&self) -> &'static str {
        match self {
            Movement::Exercise(exercise) => exercise.name(),
            Movement::Kick(Side::Right) => "kick",
            Movement::Kick(Side::Left) => "kick_left",
            Movement::Elbow => "elbow",
            Movement::Recorded(_) => "recorded_motion",
        }
    }

    /// The person of a seed who does it: for a recorded motion, with the lengths of the one who was recorded.
    pub fn subject(&self, seed: u64, stature_m: f64) -> Subject {
        let mut subject = Subject::of_seed(seed, stature_m);
        if let Movement::Recorded(motion) = self {
            subject.skeleton = motion.skeleton().clone();
            subject.stature_m = motion.stature_m();
        }
        subject
    }

    /// The body at `t` seconds when it may move in a given time; `shape` changes what is asked of the standing body
    /// before that.
    pub(in crate::synthetic) fn stance(
        &self,
        subject: &Subject,
        active: ActiveTime,
        t: f64,
        shape: impl Fn(&mut Posture),
    ) -> Stance {
        let mut posture = match self {
            Movement::Exercise(exercise) => exercise.posture(subject, active, t),
            _ => standing(subject, 1.0, t),
        };
        match self {
            Movement::Kick(side) => kick::shape(&mut posture, subject, *side, active, t),
            Movement::Elbow => elbow::shape(&mut posture, subject, active, t),
            Movement::Exercise(_) | Movement::Recorded(_) => {}
        }
        shape(&mut posture);
        let stance = posture.stand(&subject.skeleton);
        match self {
            Movement::Recorded(motion) if t > active.start_s => {
                let share = between(active.start_s, active.start_s + JOINING_S, t);
                blend(&stance, &motion.forth_and_back(t - active.start_s), share)
            }
            _ => stance,
        }
    }
}

/// The stance between two, along the straight line between their attitude vectors: unlike the shortest turn, it stays
/// smooth in time when the two are half a turn apart.
fn blend(from: &Stance, to: &Stance, share: f64) -> Stance {
    if share >= 1.0 {
        return to.clone();
    }
    let [start, end] = [from, to].map(|stance| stance.pose.to_vector(&PoseVector::zeros()));
    Stance {
        pose: Pose::from_vector(&(start + (end - start) * share)),
        torso: from.torso + (to.torso - from.torso) * share,
    }
}

/// A name that no movement has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a movement; there are back_knee, sit_front_knee, side_hip, step, near_tandem, kick, kick_left and elbow"
)]
pub struct UnknownMovement(pub String);

impl FromStr for Movement {
    type Err = UnknownMovement;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let of_fusion = Self::OF_FUSION.into_iter().find(|movement| movement.name() == name);
        of_fusion
            .map_or_else(|| name.parse().map(Self::Exercise).map_err(|UnknownExercise(name)| UnknownMovement(name)), Ok)
    }
}

impl fmt::Display for Movement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests;
