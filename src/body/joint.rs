//! Names of the anatomical points that depth sensors report.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;

/// Side of the body, the subject's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The subject's left.
    Left,
    /// The subject's right.
    Right,
}

impl Side {
    /// Both sides, left first.
    pub const BOTH: [Side; 2] = [Side::Left, Side::Right];

    /// `left` or `right`.
    pub fn name(self) -> &'static str {
        match self {
            Side::Left => "left",
            Side::Right => "right",
        }
    }

    /// The other side.
    pub fn opposite(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        }
    }
}

macro_rules! joints {
    ($($(#[$doc:meta])* $variant:ident = $name:literal),+ $(,)?) => {
        /// An anatomical point of a skeleton as sensors name it; the union of NITE, Kinect v1 and Kinect v2.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum Joint { $($(#[$doc])* $variant),+ }

        impl Joint {
            /// Every joint, in the order of declaration.
            pub const ALL: &'static [Joint] = &[$(Joint::$variant),+];

            /// The joint's name in recordings, for example `left_knee`.
            pub fn name(self) -> &'static str {
                match self { $(Joint::$variant => $name),+ }
            }
        }
    };
}

joints! {
    /// Centre of the head.
    Head = "head",
    /// Base of the neck.
    Neck = "neck",
    /// Between the shoulders (Kinect v1 `shoulder_center`, v2 `SpineShoulder`).
    SpineShoulder = "spine_shoulder",
    /// Middle of the trunk (NITE `torso`, Kinect v1 `spine`, v2 `SpineMid`).
    Torso = "torso",
    /// Middle of the pelvis (Kinect v1 `hip_center`, v2 `SpineBase`).
    Pelvis = "pelvis",
    /// Left shoulder joint centre.
    LeftShoulder = "left_shoulder",
    /// Left elbow joint centre.
    LeftElbow = "left_elbow",
    /// Left wrist joint centre.
    LeftWrist = "left_wrist",
    /// Left hand.
    LeftHand = "left_hand",
    /// Left finger tips.
    LeftHandTip = "left_hand_tip",
    /// Left thumb.
    LeftThumb = "left_thumb",
    /// Left hip joint centre.
    LeftHip = "left_hip",
    /// Left knee joint centre.
    LeftKnee = "left_knee",
    /// Left ankle joint centre.
    LeftAnkle = "left_ankle",
    /// Left foot: toes with Kinect, the end of the leg with NITE.
    LeftFoot = "left_foot",
    /// Right shoulder joint centre.
    RightShoulder = "right_shoulder",
    /// Right elbow joint centre.
    RightElbow = "right_elbow",
    /// Right wrist joint centre.
    RightWrist = "right_wrist",
    /// Right hand.
    RightHand = "right_hand",
    /// Right finger tips.
    RightHandTip = "right_hand_tip",
    /// Right thumb.
    RightThumb = "right_thumb",
    /// Right hip joint centre.
    RightHip = "right_hip",
    /// Right knee joint centre.
    RightKnee = "right_knee",
    /// Right ankle joint centre.
    RightAnkle = "right_ankle",
    /// Right foot: toes with Kinect, the end of the leg with NITE.
    RightFoot = "right_foot",
}

/// A joint name that no sensor vocabulary knows.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a joint name")]
pub struct UnknownJoint(pub String);

impl FromStr for Joint {
    type Err = UnknownJoint;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let found = Joint::ALL.iter().find(|joint| joint.name() == name);
        found.copied().ok_or_else(|| UnknownJoint(name.to_owned()))
    }
}

impl fmt::Display for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_parses_back_and_is_the_name_in_json() {
        for &joint in Joint::ALL {
            assert_eq!(joint.name().parse(), Ok(joint));
            assert_eq!(serde_json::json!(joint), serde_json::json!(joint.name()));
        }
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_name() {
        assert_eq!("left_tail".parse::<Joint>(), Err(UnknownJoint("left_tail".into())));
    }
}
