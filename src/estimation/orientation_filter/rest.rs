//! Where a sensor rests.

use super::samples::Sample;
use nalgebra::Vector3;
use std::ops::Range;

/// Shortest rest, s, and the largest deviations from its mean, rad/s (2 °/s) and m/s²: the defaults of VQF (Laidig and
/// Seel, Information Fusion 91, 2023, table 2).
const MIN_SECONDS: f64 = 1.5;
const MAX_RATE_DEVIATION: f64 = 2.0 * std::f64::consts::PI / 180.0;
const MAX_ACCELERATION_DEVIATION: f64 = 0.5;
/// Largest bias of a gyroscope that still counts as one, rad/s (2 °/s, same source): a faster steady turn is a turn.
const MAX_BIAS: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// Time over which a sensor either rests or does not, s: a rest is found to this accuracy.
const PIECE_SECONDS: f64 = 0.25;

/// A stretch in which the sensor did not move.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rest {
    /// Samples of the stretch.
    pub samples: Range<usize>,
    /// Mean angular rate: what the gyroscope says when it should say zero, rad/s.
    pub rate: Vector3<f64>,
    /// Standard deviation that noise leaves in each component of the mean, rad/s.
    pub rate_sd: f64,
}

/// The rests of a recording, each of [`MIN_SECONDS`] and less than twice that; a longer one is several.
pub(super) fn rests(samples: &[Sample]) -> Vec<Rest> {
    let mut rests = Vec::new();
    let mut current: Option<Stretch> = None;
    let (mut start, mut elapsed) = (0, 0.0);
    for (i, sample) in samples.iter().enumerate() {
        elapsed += sample.seconds;
        let is_last = i + 1 == samples.len();
        if elapsed < PIECE_SECONDS && !is_last {
            continue;
        }
        let piece = Stretch::of(samples, start..i + 1, elapsed);
        (start, elapsed) = (i + 1, 0.0);
        let joined = match (&current, &piece) {
            (Some(so_far), Some(piece)) if so_far.is_near(piece) => Some(so_far.with(piece)),
            _ => None,
        };
        if joined.is_none() {
            rests.extend(current.iter().flat_map(|stretch| stretch.rests(samples)));
        }
        current = joined.or(piece);
        if is_last {
            rests.extend(current.iter().flat_map(|stretch| stretch.rests(samples)));
        }
    }
    rests
}

/// Samples that are all near their mean.
#[derive(Debug, Clone)]
struct Stretch {
    samples: Range<usize>,
    seconds: f64,
    rate: Vector3<f64>,
    acceleration: Vector3<f64>,
}

impl Stretch {
    /// A stretch of some samples; none when the sensor moved.
    fn of(samples: &[Sample], range: Range<usize>, seconds: f64) -> Option<Self> {
        let inside = &samples[range.clone()];
        let n = inside.len() as f64;
        let rate = inside.iter().map(|s| s.rate).sum::<Vector3<f64>>() / n;
        if rate.amax() > MAX_BIAS {
            return None;
        }
        let acceleration = inside.iter().map(|s| s.acceleration).sum::<Vector3<f64>>() / n;
        let near = |s: &Sample| s.has_gravity() && is_near(&(s.rate - rate), &(s.acceleration - acceleration));
        inside.iter().all(near).then_some(Self { samples: range, seconds, rate, acceleration })
    }

    /// True when another stretch has about the same means.
    fn is_near(&self, other: &Self) -> bool {
        is_near(&(self.rate - other.rate), &(self.acceleration - other.acceleration))
    }

    /// This stretch and the one after it.
    fn with(&self, next: &Self) -> Self {
        let share = next.samples.len() as f64 / (self.samples.len() + next.samples.len()) as f64;
        Self {
            samples: self.samples.start..next.samples.end,
            seconds: self.seconds + next.seconds,
            rate: self.rate.lerp(&next.rate, share),
            acceleration: self.acceleration.lerp(&next.acceleration, share),
        }
    }

    /// Rests of equal length; none when the stretch is too short for one.
    fn rests(&self, samples: &[Sample]) -> Vec<Rest> {
        let n = self.samples.len();
        // One sample deviates from nothing.
        let n_rests = ((self.seconds / MIN_SECONDS) as usize).min(n / 2);
        let rest = |k: usize| {
            let range = self.samples.start + k * n / n_rests..self.samples.start + (k + 1) * n / n_rests;
            let inside = &samples[range.clone()];
            let n = inside.len() as f64;
            let rate = inside.iter().map(|s| s.rate).sum::<Vector3<f64>>() / n;
            let scatter = inside.iter().map(|s| (s.rate - rate).norm_squared()).sum::<f64>() / n;
            // Three components share the scatter.
            Rest { samples: range, rate, rate_sd: (scatter / (3.0 * n)).sqrt() }
        };
        (0..n_rests).map(rest).collect()
    }
}

/// True for deviations of rate and acceleration as at rest.
fn is_near(rate: &Vector3<f64>, acceleration: &Vector3<f64>) -> bool {
    rate.norm_squared() < MAX_RATE_DEVIATION * MAX_RATE_DEVIATION
        && acceleration.norm_squared() < MAX_ACCELERATION_DEVIATION * MAX_ACCELERATION_DEVIATION
}
