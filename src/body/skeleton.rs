//! The linked skeleton: a rigid trunk with four limbs of two segments, hinged at elbow and knee (\[angles\] Figure 1).

use super::joint::{Joint, Side};
use nalgebra::Vector3;
use std::ops::Range;

/// Points that are observed, three for each limb.
pub const POINT_COUNT: usize = 12;

/// Length of the observation vector y: the coordinates of the observed points (\[angles\], y ∈ R³⁶).
pub const OBSERVATION_DIMENSION: usize = 3 * POINT_COUNT;

/// Segment lengths that a human body can have, metres; outside them the unit or the joints must be wrong.
pub const PLAUSIBLE_SEGMENT_M: Range<f64> = 0.05..0.90;

/// One limb; its number orders states and observations everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Limb {
    /// Left shoulder, elbow, hand.
    LeftArm,
    /// Right shoulder, elbow, hand.
    RightArm,
    /// Left hip, knee, foot.
    LeftLeg,
    /// Right hip, knee, foot.
    RightLeg,
}

impl Limb {
    /// Every limb in order.
    pub const ALL: [Limb; 4] = [Limb::LeftArm, Limb::RightArm, Limb::LeftLeg, Limb::RightLeg];

    /// Place in [`Limb::ALL`].
    pub fn index(self) -> usize {
        self as usize
    }

    /// Side of the body.
    pub fn side(self) -> Side {
        match self {
            Limb::LeftArm | Limb::LeftLeg => Side::Left,
            Limb::RightArm | Limb::RightLeg => Side::Right,
        }
    }

    /// True of an arm.
    pub fn is_arm(self) -> bool {
        matches!(self, Limb::LeftArm | Limb::RightArm)
    }

    /// Direction of the limb in the reference posture, in `trunk`.
    pub fn reference_direction(self) -> Vector3<f64> {
        match self {
            Limb::LeftArm => -Vector3::z(),
            Limb::RightArm => Vector3::z(),
            Limb::LeftLeg | Limb::RightLeg => -Vector3::y(),
        }
    }

    /// Where the distal segment points at 90° of hinge flexion in the reference posture, in `trunk`: hands come
    /// forward, feet go back.
    pub fn flexed_direction(self) -> Vector3<f64> {
        if self.is_arm() { Vector3::x() } else { -Vector3::x() }
    }

    /// The hinge axis in the reference posture; a positive turn about it flexes.
    pub fn hinge_axis(self) -> Vector3<f64> {
        self.reference_direction().cross(&self.flexed_direction())
    }

    /// The three joints of the limb, proximal first. The last has a stand-in for sensors that do not report it.
    pub fn joints(self) -> [(Joint, Joint); 3] {
        let same = |joint| (joint, joint);
        match self {
            Limb::LeftArm => [same(Joint::LeftShoulder), same(Joint::LeftElbow), (Joint::LeftWrist, Joint::LeftHand)],
            Limb::RightArm => {
                [same(Joint::RightShoulder), same(Joint::RightElbow), (Joint::RightWrist, Joint::RightHand)]
            }
            Limb::LeftLeg => [same(Joint::LeftHip), same(Joint::LeftKnee), (Joint::LeftAnkle, Joint::LeftFoot)],
            Limb::RightLeg => [same(Joint::RightHip), same(Joint::RightKnee), (Joint::RightAnkle, Joint::RightFoot)],
        }
    }

    /// Names of the proximal and distal segment, for example `left_thigh` and `left_shank`.
    pub fn segment_names(self) -> [String; 2] {
        let names = if self.is_arm() { ["upper_arm", "forearm"] } else { ["thigh", "shank"] };
        names.map(|name| format!("{}_{name}", self.side().name()))
    }
}

/// Lengths and offsets of one subject, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    /// Shoulder or hip of each limb from the torso joint, in `trunk`.
    pub offsets: [Vector3<f64>; 4],
    /// Upper arm or thigh of each limb.
    pub proximal: [f64; 4],
    /// Forearm or shank of each limb, to the hand or foot point that is observed.
    pub distal: [f64; 4],
}

/// Segment lengths as shares of stature: Drillis and Contini's averages as tabulated by Winter (2009), Figure 4.1.
mod share_of_stature {
    pub(super) const SHOULDER_HALF_WIDTH: f64 = 0.129;
    pub(super) const HIP_HALF_WIDTH: f64 = 0.0955 / 2.0;
    pub(super) const SHOULDER_HEIGHT: f64 = 0.818;
    pub(super) const HIP_HEIGHT: f64 = 0.530;
    pub(super) const UPPER_ARM: f64 = 0.186;
    pub(super) const FOREARM: f64 = 0.146;
    pub(super) const THIGH: f64 = 0.245;
    pub(super) const SHANK: f64 = 0.246;
}

impl Skeleton {
    /// The average adult of a stature in metres, with the torso joint half-way between shoulders and hips.
    pub fn of_stature(stature: f64) -> Self {
        use share_of_stature as share;
        let half_trunk = 0.5 * (share::SHOULDER_HEIGHT - share::HIP_HEIGHT) * stature;
        let shoulder = share::SHOULDER_HALF_WIDTH * stature;
        let hip = share::HIP_HALF_WIDTH * stature;
        Self {
            offsets: [
                Vector3::new(0.0, half_trunk, -shoulder),
                Vector3::new(0.0, half_trunk, shoulder),
                Vector3::new(0.0, -half_trunk, -hip),
                Vector3::new(0.0, -half_trunk, hip),
            ],
            proximal: [share::UPPER_ARM, share::UPPER_ARM, share::THIGH, share::THIGH].map(|s| s * stature),
            distal: [share::FOREARM, share::FOREARM, share::SHANK, share::SHANK].map(|s| s * stature),
        }
    }
}

/// Number of an observed point: `level` 0 is shoulder or hip, 1 elbow or knee, 2 hand or foot.
pub fn point_index(limb: Limb, level: usize) -> usize {
    3 * limb.index() + level
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hinges_flex_about_mirrored_axes() {
        assert_eq!(Limb::RightArm.hinge_axis(), Vector3::y());
        assert_eq!(Limb::LeftArm.hinge_axis(), -Vector3::y());
        assert_eq!(Limb::RightLeg.hinge_axis(), -Vector3::z());
        assert_eq!(Limb::LeftLeg.hinge_axis(), -Vector3::z());
    }

    #[test]
    fn the_average_adult_is_symmetric() {
        let skeleton = Skeleton::of_stature(1.7);
        for (left, right) in [(0, 1), (2, 3)] {
            let mirrored = skeleton.offsets[left].component_mul(&Vector3::new(1.0, 1.0, -1.0));
            assert_eq!(mirrored, skeleton.offsets[right]);
        }
    }
}
