//! Joints that the sensor loses for a while.

use super::episode::{Episodes, episodes};
use crate::body::Joint;
use crate::recording::SkeletonRecording;
use nalgebra::Vector3;
use rand::Rng;

/// How often a joint is lost: the ends of limbs more often than their roots, the trunk never.
pub fn usual(joint: Joint) -> Episodes {
    let per_s = match joint {
        Joint::Torso | Joint::Neck | Joint::Head | Joint::Pelvis | Joint::SpineShoulder => 0.0,
        Joint::LeftShoulder | Joint::RightShoulder | Joint::LeftHip | Joint::RightHip => 0.005,
        Joint::LeftElbow | Joint::RightElbow | Joint::LeftKnee | Joint::RightKnee => 0.02,
        _ => 0.04,
    };
    Episodes { per_s, shortest_s: 0.1, longest_s: 1.2 }
}

/// Loses joints: their confidence becomes 0 and their place and turn unknown.
pub fn apply(skeleton: &mut SkeletonRecording, how: impl Fn(Joint) -> Episodes, rng: &mut impl Rng) {
    let n = skeleton.joints.len();
    for column in 0..n {
        for frames in episodes(&skeleton.time_ns, how(skeleton.joints[column]), rng) {
            for t in frames {
                let i = t * n + column;
                skeleton.positions[i] = Vector3::repeat(f64::NAN);
                skeleton.confidence[i] = 0.0;
                if let Some(orientation) = skeleton.orientations.get_mut(i) {
                    *orientation = None;
                }
            }
        }
    }
}
