//! Importance weights of few particles in double precision: their logarithms are sums along paths, which single
//! precision would round too much.

/// Turns log-weights into weights that sum to 1; equal ones when no particle has a finite log-weight.
pub(super) fn normalize_log_weights(log_weights: &[f64], weights: &mut [f64]) {
    let largest = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        weights.fill(1.0 / weights.len() as f64);
        return;
    }
    let mut sum = 0.0;
    for (weight, log_weight) in weights.iter_mut().zip(log_weights) {
        // exp(-700) is the smallest that still is a normal f64; below it the particle has no weight at all.
        let relative = log_weight - largest;
        *weight = if relative > -700.0 { relative.exp() } else { 0.0 };
        sum += *weight;
    }
    for weight in weights.iter_mut() {
        *weight /= sum;
    }
}

/// Effective sample size `1 / Σ w²` of normalised weights, in particles.
pub(super) fn effective_sample_size(weights: &[f64]) -> f64 {
    1.0 / weights.iter().map(|w| w * w).sum::<f64>()
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
    fn impossible_observations_leave_equal_weights() {
        let mut weights = [0.0; 4];
        normalize_log_weights(&[f64::NEG_INFINITY; 4], &mut weights);
        assert_eq!(weights, [0.25; 4]);
    }

    proptest! {
        #[test]
        fn weights_sum_to_one_however_small_the_likelihoods(logs in prop::collection::vec(-1e6..0.0f64, 1..200)) {
            let mut weights = vec![0.0; logs.len()];
            normalize_log_weights(&logs, &mut weights);
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
