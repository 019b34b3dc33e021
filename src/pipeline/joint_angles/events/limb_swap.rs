//! `limb_swap`: left and right taken for each other, knee and foot or elbow and hand, for some frames.
//!
//! When a tracker exchanges two limbs, the vector `D` from the right to the left limb's point turns round from one
//! frame to the next, at hinge and end alike, and back again some frames later. With white noise and movement of variance
//! `s²` the logarithm of the likelihood ratio of such a turn is
//!
//! ```text
//! S(t) = Σ −2 D(t)·D(t−1) / s²
//! ```
//!
//! over the axes of hinge and end. The best sequence of the two states (as it should be, exchanged) is found by dynamic
//! programming; bones vote in it, since a knee is farther from the other side's hip than from its own.

use super::{Finding, Scene};
use crate::body::Limb;
use crate::body::skeleton::point_index;
use nalgebra::Vector3;

/// Limbs that are exchanged, and the event's subject.
const PAIRS: [(&str, [Limb; 2]); 2] =
    [("legs", [Limb::LeftLeg, Limb::RightLeg]), ("arms", [Limb::LeftArm, Limb::RightArm])];

/// Standard deviation of the speed of one limb against the other in each axis, m/s. Feet of a walker pass each other at
/// several times that, but side by side: across the body they stay apart, and nothing turns round.
const LIMB_SPEED: f64 = 1.0;
/// Log-likelihood that an exchange must overcome at each end: e⁻⁶ is one exchange in 13 s of a 30 Hz recording.
const TURN_COST: f64 = 6.0;
/// Least log-likelihood ratio at both ends of an exchange that is certain (22 000 to 1).
const CERTAIN: f64 = 10.0;
/// Hinge and end must agree: neither may speak against the exchange by more than this.
const CONTRADICTION: f64 = -4.0;
/// Cost of staying exchanged, per second. Together with `LONGEST_S` it makes the shorter state the exchanged one.
const COST_PER_S: f64 = 2.0;
/// Longest exchange that is certain, seconds: then continuity alone cannot say which state is the right one.
const LONGEST_S: f64 = 2.0;
/// Longest time over which a limb's place is compared with its last one, seconds.
const COMPARABLE_S: f64 = 0.3;
/// Most that the bones of one frame may say. Their errors last as long as a posture does.
const BONE_VOTE: f64 = 1.0;
/// Least standard deviation of a bone's length, metres.
const LEAST_BONE_SD: f64 = 0.01;

/// Exchanged limbs, which are exchanged back.
pub(super) fn find(scene: &mut Scene) -> Vec<Finding> {
    let mut found = Vec::new();
    for (name, limbs) in PAIRS {
        let turns = turns(scene, limbs);
        let bones = bone_votes(scene, limbs);
        for frames in exchanged_stretches(scene, &turns, &bones) {
            for t in frames.clone() {
                scene.exchange(t, limbs);
            }
            found.push(Finding::of_frames(name, frames));
        }
    }
    found
}

/// What speaks for a turn between frame `t` and the last one that shows the limbs: the log-likelihood ratio of hinge
/// and end together, and the lesser of the two.
#[derive(Debug, Clone, Copy, Default)]
struct Turn {
    both: f64,
    lesser: f64,
}

impl Turn {
    fn is_certain(self) -> bool {
        self.both >= CERTAIN && self.lesser >= CONTRADICTION
    }
}

fn turns(scene: &Scene, limbs: [Limb; 2]) -> Vec<Turn> {
    let mut turns = vec![Turn::default(); scene.len()];
    let mut last: [Option<(usize, Vector3<f64>)>; 2] = [None; 2];
    for (t, turn) in turns.iter_mut().enumerate() {
        let mut ratios = [0.0; 2];
        for level in 1..3 {
            let [left, right] = limbs.map(|limb| point_index(limb, level));
            let points = &scene.observations.points[t];
            let across = points[left] - points[right];
            if !across.x.is_finite() {
                continue;
            }
            if let Some((before, across_before)) = last[level - 1] {
                let elapsed = scene.seconds(t) - scene.seconds(before);
                if elapsed <= COMPARABLE_S {
                    let movement = 2.0 * (LIMB_SPEED * elapsed).powi(2);
                    ratios[level - 1] = (0..3)
                        .map(|axis| {
                            let white = scene.white[left][axis].powi(2) + scene.white[right][axis].powi(2);
                            -2.0 * across[axis] * across_before[axis] / (2.0 * white + movement)
                        })
                        .sum();
                }
            }
            last[level - 1] = Some((t, across));
        }
        *turn = Turn { both: ratios[0] + ratios[1], lesser: ratios[0].min(ratios[1]) };
    }
    turns
}

/// What the proximal bones of each frame say for an exchange: log-likelihood ratio, bounded by [`BONE_VOTE`].
fn bone_votes(scene: &Scene, limbs: [Limb; 2]) -> Vec<f64> {
    let length = |t: usize, root: Limb, hinge: Limb| {
        let points = &scene.observations.points[t];
        (points[point_index(hinge, 1)] - points[point_index(root, 0)]).norm()
    };
    let own = limbs.map(|limb| {
        let mut lengths: Vec<f64> = (0..scene.len()).map(|t| length(t, limb, limb)).filter(|l| l.is_finite()).collect();
        let middle = median(&mut lengths);
        let mut deviations: Vec<f64> = lengths.iter().map(|l| (l - middle).abs()).collect();
        // 1.4826 makes the median absolute deviation a standard deviation for a normal distribution.
        (middle, (1.4826 * median(&mut deviations)).max(LEAST_BONE_SD))
    });
    let misfit = |t: usize, hinges: [Limb; 2]| {
        let of = |side: usize| ((length(t, limbs[side], hinges[side]) - own[side].0) / own[side].1).powi(2);
        0.5 * (of(0) + of(1))
    };
    let vote = |t: usize| {
        let ratio = misfit(t, limbs) - misfit(t, [limbs[1], limbs[0]]);
        if ratio.is_finite() { ratio.clamp(-BONE_VOTE, BONE_VOTE) } else { 0.0 }
    };
    (0..scene.len()).map(vote).collect()
}

/// Stretches of the exchanged state in the best sequence that are certain and short enough.
fn exchanged_stretches(scene: &Scene, turns: &[Turn], bones: &[f64]) -> Vec<std::ops::Range<usize>> {
    let n = scene.len();
    // Score of the best sequence that ends as it should be, and exchanged; and whether it turned in frame t.
    let mut score = [0.0, f64::NEG_INFINITY];
    let mut turned = vec![[false; 2]; n];
    for t in 1..n {
        let price = turns[t].both - TURN_COST;
        let stay = COST_PER_S * scene.observations.interval_s(t);
        let before = score;
        for state in 0..2 {
            let turning = before[1 - state] + price;
            turned[t][state] = turning > before[state];
            score[state] = turning.max(before[state]);
        }
        score[1] += bones[t] - stay;
    }
    let mut state = usize::from(score[1] > score[0]);
    let mut exchanged = vec![false; n];
    for t in (0..n).rev() {
        exchanged[t] = state == 1;
        if turned[t][state] {
            state = 1 - state;
        }
    }
    let mut found = super::stretches(n, |t| exchanged[t]);
    found.retain(|frames| {
        let is_short = scene.seconds(frames.end - 1) - scene.seconds(frames.start) <= LONGEST_S;
        is_short && frames.end < n && turns[frames.start].is_certain() && turns[frames.end].is_certain()
    });
    found
}

/// Median of numbers, which are reordered; 0 of none.
fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
