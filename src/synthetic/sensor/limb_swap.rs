//! Left and right limbs that the middleware takes for each other.

use super::episode::{Episodes, episodes};
use crate::body::Joint;
use crate::recording::SkeletonRecording;
use rand::Rng;

/// How often the legs, and how often the arms, are exchanged, and for how long.
pub const USUAL: Episodes = Episodes { per_s: 0.06, shortest_s: 0.1, longest_s: 0.5 };

/// Pairs that are exchanged together: hips and shoulders stay, the trunk holds them apart.
const LIMBS: [&[(Joint, Joint)]; 2] = [
    &[(Joint::LeftKnee, Joint::RightKnee), (Joint::LeftAnkle, Joint::RightAnkle), (Joint::LeftFoot, Joint::RightFoot)],
    &[
        (Joint::LeftElbow, Joint::RightElbow),
        (Joint::LeftWrist, Joint::RightWrist),
        (Joint::LeftHand, Joint::RightHand),
    ],
];

/// Exchanges left and right in the frames of each episode.
pub fn apply(skeleton: &mut SkeletonRecording, how: Episodes, rng: &mut impl Rng) {
    let n = skeleton.joints.len();
    for pairs in LIMBS {
        let columns: Vec<(usize, usize)> =
            pairs.iter().filter_map(|(l, r)| Some((skeleton.column(*l)?, skeleton.column(*r)?))).collect();
        for t in episodes(&skeleton.time_ns, how, rng).into_iter().flatten() {
            for (left, right) in &columns {
                skeleton.positions.swap(t * n + left, t * n + right);
                if !skeleton.orientations.is_empty() {
                    skeleton.orientations.swap(t * n + left, t * n + right);
                }
            }
        }
    }
}
