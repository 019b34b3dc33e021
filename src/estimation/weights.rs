//! Importance weights.

use crate::geometry::lanes::{LANES, Lanes, exp, sum_of};
use pulp::{Arch, Simd, WithSimd};

/// Turns log-weights into weights that sum to 1 within the rounding of `f32`. Returns the log of their mean before
/// normalisation (the evidence).
///
/// `None`, with equal weights, when no particle has a finite log-weight: the observation is impossible under all.
///
/// # Panics
/// When the lengths differ or are no multiple of [`LANES`].
pub fn normalize_log_weights(log_weights: &[f32], weights: &mut [f32]) -> Option<f64> {
    assert!(
        log_weights.len() == weights.len() && weights.len().is_multiple_of(LANES),
        "one log-weight for each weight"
    );
    let largest = log_weights.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    if !largest.is_finite() {
        weights.fill(1.0 / weights.len() as f32);
        return None;
    }
    Arch::new().dispatch(Exponentials { log_weights, largest, weights });
    let total = sum_of(weights, |w| w);
    let scale = (1.0 / total) as f32;
    for weight in weights.iter_mut() {
        *weight *= scale;
    }
    Some(f64::from(largest) + (total / weights.len() as f64).ln())
}

/// Weights relative to the largest, for any instruction set.
struct Exponentials<'a> {
    log_weights: &'a [f32],
    largest: f32,
    weights: &'a mut [f32],
}

impl WithSimd for Exponentials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let logs = S::as_simd_f32s(self.log_weights).0;
        for (weight, log) in S::as_mut_simd_f32s(self.weights).0.iter_mut().zip(logs) {
            *weight = exp(Lanes::new(simd, *log) - self.largest).values;
        }
    }
}

/// Effective sample size `1 / Σ w²` of normalised weights, in particles.
pub fn effective_sample_size(weights: &[f32]) -> f64 {
    1.0 / sum_of(weights, |w| w * w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn equal_weights_count_fully_and_a_single_one_counts_once() {
        assert!((effective_sample_size(&[0.25; 4]) - 4.0).abs() < 1e-12);
        assert!((effective_sample_size(&[1.0, 0.0, 0.0]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn impossible_observations_leave_equal_weights_and_say_so() {
        let mut weights = [0.0; LANES];
        assert_eq!(normalize_log_weights(&[f32::NEG_INFINITY; LANES], &mut weights), None);
        assert_eq!(weights, [1.0 / 16.0; LANES]);
    }

    proptest! {
        #[test]
        fn weights_are_those_of_plain_f64_and_sum_to_one_however_small_the_likelihoods(
            logs in prop::collection::vec(-1e6..0.0f32, LANES..13 * LANES),
            scale in prop::sample::select(vec![1.0f32, 1e-3, 1e-5]),
        ) {
            let logs: Vec<f32> = logs[..logs.len() / LANES * LANES].iter().map(|log| log * scale).collect();
            let mut weights = vec![0.0; logs.len()];
            let evidence = normalize_log_weights(&logs, &mut weights).expect("finite log-weights");
            let largest = logs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            let plain: Vec<f64> = logs.iter().map(|log| f64::from(log - largest).exp()).collect();
            let total: f64 = plain.iter().sum();
            // Each weight is rounded three times to f32 (6e-8) after an exponential good to 2e-7.
            for (weight, plain) in weights.iter().zip(&plain) {
                prop_assert!((f64::from(*weight) - plain / total).abs() < 5e-7 * plain / total + 1e-37);
            }
            prop_assert!((weights.iter().map(|w| f64::from(*w)).sum::<f64>() - 1.0).abs() < 5e-7);
            prop_assert!((evidence - f64::from(largest) - (total / logs.len() as f64).ln()).abs() < 1e-6);
        }
    }
}
