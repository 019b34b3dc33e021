//! Position, velocity and acceleration of noisy, irregularly sampled points.

use super::grid::Grid;
use super::interpolation::NS_PER_S;
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// Weights that give value, first and second derivative at one instant from the samples of a range.
///
/// They are those of the parabola that fits the samples around the instant by least squares with Gaussian weights.
/// On regular samples they are the Gaussian, its first and its second derivative, so that what comes out is the true
/// derivative smoothed by a Gaussian; on irregular ones a parabola is still differentiated exactly.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// The samples.
    pub samples: Range<usize>,
    /// Weights of each sample for value (in the samples' unit), first (per second) and second derivative (per s²).
    pub weights: Vec<[f64; 3]>,
}

/// Reach of the Gaussian, in its standard deviations.
const REACH: f64 = 3.0;

/// Samples within the reach below which a parabola says nothing of its own reliability.
const MIN_SAMPLES: usize = 4;

/// The weights at every node of a grid, `sd_s` being the standard deviation of the Gaussian in seconds; none where too
/// few samples are near, or an interval of more than two standard deviations lies at the node.
pub fn weights(grid: &Grid, time_ns: &[i64], sd_s: f64) -> Vec<Option<Weights>> {
    let reach_ns = (REACH * sd_s * NS_PER_S) as i64;
    let near_ns = (sd_s * NS_PER_S) as i64;
    let (mut start, mut end) = (0, 0);
    (0..grid.len)
        .map(|i| {
            let at = grid.time_ns(i);
            while start < time_ns.len() && time_ns[start] < at - reach_ns {
                start += 1;
            }
            while end < time_ns.len() && time_ns[end] <= at + reach_ns {
                end += 1;
            }
            let times = &time_ns[start..end];
            let after = times.partition_point(|&t| t < at);
            let is_surrounded = after > 0
                && after < times.len()
                && at - times[after - 1] <= 2 * near_ns
                && times[after] - at <= 2 * near_ns
                && times[after] - times[after - 1] <= 2 * near_ns;
            if times.len() < MIN_SAMPLES || !is_surrounded {
                return None;
            }
            Some(Weights { samples: start..end, weights: at_instant(at, times, sd_s)? })
        })
        .collect()
}

/// The weights of the samples at `times` for the instant `at`.
fn at_instant(at: i64, times: &[i64], sd_s: f64) -> Option<Vec<[f64; 3]>> {
    // Times in standard deviations keep the normal equations well scaled.
    let taus = times.iter().map(|&t| (t - at) as f64 / NS_PER_S / sd_s);
    let mut normal = Matrix3::zeros();
    for tau in taus.clone() {
        let row = Vector3::new(1.0, tau, 0.5 * tau * tau);
        normal += (-0.5 * tau * tau).exp() * row * row.transpose();
    }
    let inverse = normal.try_inverse()?;
    let weights = taus.map(|tau| {
        let row = (-0.5 * tau * tau).exp() * (inverse * Vector3::new(1.0, tau, 0.5 * tau * tau));
        [row.x, row.y / sd_s, row.z / (sd_s * sd_s)]
    });
    Some(weights.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_on_irregular_samples_is_differentiated_exactly() {
        let times: Vec<i64> = (0..60).map(|i| i * 33_000_000 + (i * i * 7919) % 9_000_000).collect();
        let seconds = |t: i64| t as f64 / NS_PER_S;
        let value = |s: f64| 0.3 - 1.2 * s + 4.0 * s * s;
        let grid = Grid::between(times[5], times[50], 10_000_000);
        for (i, weights) in weights(&grid, &times, 0.05).into_iter().enumerate() {
            let weights = weights.expect("surrounded by samples");
            let s = seconds(grid.time_ns(i));
            let mut found = [0.0; 3];
            for (t, row) in weights.samples.zip(&weights.weights) {
                for (found, weight) in found.iter_mut().zip(row) {
                    *found += weight * value(seconds(times[t]));
                }
            }
            for (found, truth) in found.iter().zip([value(s), -1.2 + 8.0 * s, 8.0]) {
                assert!((found - truth).abs() < 1e-8, "{found} instead of {truth}");
            }
        }
    }

    #[test]
    fn nothing_is_said_of_a_gap_or_an_end() {
        let times: Vec<i64> = (0..30).chain(60..90).map(|i| i * 33_000_000).collect();
        let grid = Grid::between(times[0], times[59], 33_000_000);
        let weights = weights(&grid, &times, 0.05);
        assert!(weights[10].is_some() && weights[80].is_some() && weights[45].is_none());
    }
}
