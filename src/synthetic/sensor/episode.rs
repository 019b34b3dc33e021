//! Stretches of time in which something goes wrong.

use rand::{Rng, RngExt};
use std::ops::Range;

/// How often and how long something happens: a Poisson process with evenly spread lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Episodes {
    /// Beginnings per second.
    pub per_s: f64,
    /// Shortest length, seconds.
    pub shortest_s: f64,
    /// Longest length, seconds.
    pub longest_s: f64,
}

/// Frames of each episode, in order, never overlapping. An episode too short to hold a frame is left out.
pub fn episodes(time_ns: &[i64], what: Episodes, rng: &mut impl Rng) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let Some(last) = time_ns.last() else { return found };
    if what.per_s <= 0.0 {
        return found;
    }
    let end_s = *last as f64 * 1e-9;
    let frame_at = |t: f64| time_ns.partition_point(|time| (*time as f64) < t * 1e9);
    let mut t = 0.0;
    loop {
        // Exponential waiting time; 1 − u is never 0.
        t -= (1.0 - rng.random::<f64>()).ln() / what.per_s;
        if t > end_s {
            return found;
        }
        let length = what.shortest_s + (what.longest_s - what.shortest_s) * rng.random::<f64>();
        let frames = frame_at(t)..frame_at(t + length);
        if !frames.is_empty() {
            found.push(frames);
        }
        t += length;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn episodes_come_at_their_rate_do_not_overlap_and_have_their_length() {
        let times: Vec<i64> = (0..100_000).map(|i| i * 10_000_000).collect();
        let what = Episodes { per_s: 0.5, shortest_s: 0.2, longest_s: 0.4 };
        let found = episodes(&times, what, &mut ChaCha8Rng::seed_from_u64(2));
        // 1000 s with one beginning each 2.3 s on average: 435 ± 18 (one standard deviation of waiting times).
        assert!((363..507).contains(&found.len()), "{}", found.len());
        assert!(found.windows(2).all(|w| w[0].end <= w[1].start));
        assert!(found.iter().all(|f| (19..=41).contains(&f.len())));
    }

    #[test]
    fn nothing_happens_at_rate_zero_or_without_frames() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let what = Episodes { per_s: 0.0, shortest_s: 0.2, longest_s: 0.4 };
        assert!(episodes(&[0, 1_000_000_000], what, &mut rng).is_empty());
        assert!(episodes(&[], Episodes { per_s: 1.0, ..what }, &mut rng).is_empty());
    }
}
