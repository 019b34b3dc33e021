//! When a sensor takes its frames.

use super::sensor::episode::{Episodes, episodes};
use rand::{Rng, RngExt};

/// Shortest and longest time between frames of a sensor that jitters, against the nominal time: 30 Hz becomes 35 to
/// 25 Hz.
const JITTER: [f64; 2] = [30.0 / 35.0, 30.0 / 25.0];

/// Time stamps of frames from 0 to `duration_s` at a nominal rate, nanoseconds, strictly increasing.
///
/// With `jitter` each interval is drawn anew; frames that fall into a gap are missing, the first one never is.
pub fn frame_times_ns(
    duration_s: f64,
    rate_hz: f64,
    jitter: bool,
    gaps: Option<Episodes>,
    rng: &mut impl Rng,
) -> Vec<i64> {
    let mut times = Vec::new();
    let mut t = 0.0;
    for number in 1.. {
        if t > duration_s {
            break;
        }
        times.push((t * 1e9).round() as i64);
        t = match jitter {
            true => t + rng.random_range(JITTER[0]..JITTER[1]) / rate_hz,
            false => f64::from(number) / rate_hz,
        };
    }
    if let Some(gaps) = gaps {
        let mut seen = vec![true; times.len()];
        for frames in episodes(&times, gaps, rng) {
            seen[frames].fill(false);
        }
        seen[0] = true;
        let mut flags = seen.into_iter();
        times.retain(|_| flags.next().unwrap_or(true));
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_steady_clock_does_not_drift() {
        let times = frame_times_ns(10.0, 30.0, false, None, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(times.len(), 301);
        assert_eq!((times[0], times[30], times[300]), (0, 1_000_000_000, 10_000_000_000));
    }

    #[test]
    fn a_jittering_clock_stays_between_25_and_35_hz_and_gaps_take_frames_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let times = frame_times_ns(60.0, 30.0, true, None, &mut rng);
        assert!(times.windows(2).all(|w| (28_571_428..=40_000_001).contains(&(w[1] - w[0]))));
        let gaps = Episodes { per_s: 0.2, shortest_s: 0.1, longest_s: 0.5 };
        let times = frame_times_ns(60.0, 30.0, true, Some(gaps), &mut rng);
        assert!(times.windows(2).any(|w| w[1] - w[0] > 100_000_000), "there are gaps");
        assert!(times.windows(2).all(|w| w[1] > w[0]));
    }
}
