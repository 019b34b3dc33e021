//! A normal variable that is known to lie between two bounds.

use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Standard deviations beyond a bound after which the mean is put on it: it would differ by less than a sixth of one.
const FAR: f64 = 6.0;

/// Mean of a normal variable that is known to lie within bounds. Inside and far from them it is `mean`; at a bound it
/// lies inside by 0.8 standard deviations, so that an estimate near a limit is not biased by those that the limit
/// excludes.
pub fn truncated_mean(mean: f64, sd: f64, [low, high]: [f64; 2]) -> f64 {
    let (a, b) = ((low - mean) / sd, (high - mean) / sd);
    // Written so that a standard deviation of zero or NaN goes this way too.
    if !(a < FAR && b > -FAR && sd > 0.0) {
        return if mean.is_finite() { mean.clamp(low, high) } else { mean };
    }
    if a < -FAR && b > FAR {
        return mean;
    }
    let normal = Normal::standard();
    let share = normal.cdf(b) - normal.cdf(a);
    mean + sd * (normal.pdf(a) - normal.pdf(b)) / share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_half_normal_variable_is_known() {
        let mean = truncated_mean(2.0, 3.0, [2.0, 1e9]);
        assert!((mean - (2.0 + 3.0 * (2.0 / std::f64::consts::PI).sqrt())).abs() < 1e-9);
    }

    #[test]
    fn the_mean_agrees_with_numerical_integration() {
        let (mean, sd, low, high) = (-0.5, 0.8_f64, -0.3, 1.1);
        let (mut mass, mut moment) = (0.0, 0.0);
        let n = 100_000;
        for i in 0..n {
            let x = low + (high - low) * (f64::from(i) + 0.5) / f64::from(n);
            let density = (-0.5 * ((x - mean) / sd).powi(2)).exp();
            mass += density;
            moment += density * x;
        }
        assert!((truncated_mean(mean, sd, [low, high]) - moment / mass).abs() < 1e-9);
    }

    #[test]
    fn far_from_the_bounds_nothing_changes_and_far_outside_the_bound_is_the_answer() {
        assert_eq!(truncated_mean(1.0, 0.1, [0.0, 3.0]), 1.0);
        assert_eq!(truncated_mean(-1.0, 0.1, [0.0, 3.0]), 0.0);
        assert_eq!(truncated_mean(4.0, 0.0, [0.0, 3.0]), 3.0);
        assert!(truncated_mean(f64::NAN, 0.1, [0.0, 3.0]).is_nan());
    }
}
