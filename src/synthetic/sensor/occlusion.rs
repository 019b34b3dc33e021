//! Limbs, or the whole body, that something hides for seconds.

use crate::body::{Joint, Limb};
use crate::recording::SkeletonRecording;
use nalgebra::Vector3;
use rand::{Rng, RngExt};
use std::ops::Range;

/// Shortest and longest stretch, seconds: somebody walks by, or the subject turns away.
const STRETCH_S: [f64; 2] = [2.0, 5.0];

/// Chance that a stretch hides the whole body, and that it hides both legs or both arms; otherwise one limb is hidden.
const WHOLE_BODY: f64 = 0.2;
const PAIR: f64 = 0.3;

/// Hides parts of the body for `total_s` seconds in all, in stretches that lie within `within` (seconds) and do not
/// overlap; the stretches, in order. A `total_s` longer than `within` hides all of it.
pub fn apply(
    skeleton: &mut SkeletonRecording,
    total_s: f64,
    within: Range<f64>,
    rng: &mut impl Rng,
) -> Vec<Range<f64>> {
    let found = stretches(total_s, within, rng);
    let n = skeleton.joints.len();
    for stretch in &found {
        let hidden = hidden_joints(rng);
        for t in 0..skeleton.len() {
            if !stretch.contains(&(skeleton.time_ns[t] as f64 * 1e-9)) {
                continue;
            }
            for column in (0..n).filter(|column| hidden.as_ref().is_none_or(|h| h.contains(&skeleton.joints[*column])))
            {
                let i = t * n + column;
                skeleton.positions[i] = Vector3::repeat(f64::NAN);
                skeleton.confidence[i] = 0.0;
                if let Some(orientation) = skeleton.orientations.get_mut(i) {
                    *orientation = None;
                }
            }
        }
    }
    found
}

/// Stretches of [`STRETCH_S`] that add up to `total_s`; the free time between them is shared at random.
fn stretches(total_s: f64, within: Range<f64>, rng: &mut impl Rng) -> Vec<Range<f64>> {
    let room = within.end - within.start;
    let mut left = total_s.min(room);
    let mut lengths = Vec::new();
    while left > 0.0 {
        let length = rng.random_range(STRETCH_S[0]..STRETCH_S[1]);
        // A rest that is too short for a stretch of its own belongs to this one.
        let length = if left - length < STRETCH_S[0] { left } else { length };
        lengths.push(length);
        left -= length;
    }
    let free = (room - lengths.iter().sum::<f64>()).max(0.0);
    let mut before: Vec<f64> = lengths.iter().map(|_| free * rng.random::<f64>()).collect();
    before.sort_by(f64::total_cmp);
    let mut hidden = 0.0;
    let place = |(length, before): (f64, f64)| {
        let start = within.start + before + hidden;
        hidden += length;
        start..start + length
    };
    lengths.into_iter().zip(before).map(place).collect()
}

/// The joints that a stretch hides: hinges and ends of limbs, or everything (`None`).
fn hidden_joints(rng: &mut impl Rng) -> Option<Vec<Joint>> {
    let kind: f64 = rng.random();
    let first = Limb::ALL[rng.random_range(0..Limb::ALL.len())];
    if kind < WHOLE_BODY {
        return None;
    }
    let is_hidden =
        |limb: &Limb| if kind < WHOLE_BODY + PAIR { limb.is_arm() == first.is_arm() } else { *limb == first };
    let of_limb = |limb: Limb| limb.joints().into_iter().skip(1).flat_map(|(a, b)| [a, b]);
    Some(Limb::ALL.into_iter().filter(is_hidden).flat_map(of_limb).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn stretches_add_up_to_the_time_asked_for_and_do_not_overlap() {
        for seed in 0..50 {
            let found = stretches(20.0, 5.0..65.0, &mut ChaCha8Rng::seed_from_u64(seed));
            let total: f64 = found.iter().map(|s| s.end - s.start).sum();
            assert!((total - 20.0).abs() < 1e-9, "{total}");
            assert!(found.windows(2).all(|w| w[0].end <= w[1].start + 1e-9));
            assert!(
                found.first().is_some_and(|s| s.start >= 5.0) && found.last().is_some_and(|s| s.end <= 65.0 + 1e-9)
            );
            assert!(found.iter().all(|s| (2.0 - 1e-9..7.0).contains(&(s.end - s.start))));
        }
    }

    #[test]
    fn more_than_there_is_hides_everything_and_nothing_hides_nothing() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let all: f64 = stretches(100.0, 0.0..10.0, &mut rng).iter().map(|s| s.end - s.start).sum();
        assert!((all - 10.0).abs() < 1e-9);
        assert!(stretches(0.0, 0.0..10.0, &mut rng).is_empty());
    }
}
