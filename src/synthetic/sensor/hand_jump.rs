//! Hands that jump to something else that looks like a hand, with full confidence.

use super::episode::{Episodes, episodes};
use super::standard_normals;
use crate::body::Joint;
use crate::recording::SkeletonRecording;
use rand::{Rng, RngExt};

/// How often a hand jumps away, and for how long.
pub const USUAL: Episodes = Episodes { per_s: 0.15, shortest_s: 0.03, longest_s: 0.25 };

/// Shortest and longest jump, metres.
pub const DISTANCE_M: [f64; 2] = [0.3, 0.8];

/// Moves hands away for the length of each episode.
pub fn apply(skeleton: &mut SkeletonRecording, how: Episodes, rng: &mut impl Rng) {
    let n = skeleton.joints.len();
    for column in 0..n {
        let hands = [Joint::LeftHand, Joint::RightHand, Joint::LeftWrist, Joint::RightWrist];
        if !hands.contains(&skeleton.joints[column]) {
            continue;
        }
        for frames in episodes(&skeleton.time_ns, how, rng) {
            let distance = rng.random_range(DISTANCE_M[0]..DISTANCE_M[1]);
            let jump = standard_normals(rng).normalize() * distance;
            for t in frames {
                skeleton.positions[t * n + column] += jump;
            }
        }
    }
}
