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

/// A stretch in which the sensor did not move.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rest {
    /// Samples of the stretch.
    pub samples: Range<usize>,
    /// Mean angular rate: what the gyroscope says when it should say zero, rad/s.
    pub rate: Vector3<f64>,
}

/// The rests of a recording, each of [`MIN_SECONDS`]; a longer one is several.
pub(super) fn rests(samples: &[Sample]) -> Vec<Rest> {
    let mut rests = Vec::new();
    let (mut start, mut elapsed) = (0, 0.0);
    for i in 0..samples.len() {
        elapsed += if i > start { samples[i].seconds } else { 0.0 };
        if elapsed >= MIN_SECONDS {
            let stretch = start..i + 1;
            if let Some(rate) = rate_at_rest(&samples[stretch.clone()]) {
                rests.push(Rest { samples: stretch, rate });
            }
            (start, elapsed) = (i + 1, 0.0);
        }
    }
    rests
}

/// Mean rate of a stretch when all of it is near its mean.
fn rate_at_rest(samples: &[Sample]) -> Option<Vector3<f64>> {
    let n = samples.len() as f64;
    let rate = samples.iter().map(|s| s.rate).sum::<Vector3<f64>>() / n;
    if rate.amax() > MAX_BIAS {
        return None;
    }
    let acceleration = samples.iter().map(|s| s.acceleration).sum::<Vector3<f64>>() / n;
    let near = |s: &Sample| {
        s.has_gravity()
            && (s.rate - rate).norm_squared() < MAX_RATE_DEVIATION * MAX_RATE_DEVIATION
            && (s.acceleration - acceleration).norm_squared() < MAX_ACCELERATION_DEVIATION * MAX_ACCELERATION_DEVIATION
    };
    samples.iter().all(near).then_some(rate)
}
