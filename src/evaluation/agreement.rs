//! How well one series agrees with another.
//!
//! ```text
//! e = estimate − reference        MAE = mean |e|        RMSE = √ mean e²
//! RMSE without offset = √ mean (e − ē)²
//! r = Σ (a − ā)(b − b̄) / √(Σ (a − ā)² Σ (b − b̄)²)        NCC = Σ a b / √(Σ a² Σ b²)
//! ```

/// Agreement of one estimate with its reference, in the unit of both.
///
/// Several series (the two sides of a body) are pooled by their sums: offset and means are each series' own, so that a
/// constant difference between the sides is no correlation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Agreement {
    n: usize,
    absolute: f64,
    squares: f64,
    squares_without_offset: f64,
    covariance: f64,
    estimate_variance: f64,
    reference_variance: f64,
}

impl Agreement {
    /// Agreement over the samples in which both are finite.
    pub fn between(estimate: &[f64], reference: &[f64]) -> Self {
        let pairs = || estimate.iter().zip(reference).filter(|(a, b)| a.is_finite() && b.is_finite());
        let n = pairs().count();
        if n == 0 {
            return Self::default();
        }
        let share = 1.0 / n as f64;
        let estimate_mean = pairs().map(|(a, _)| a).sum::<f64>() * share;
        let reference_mean = pairs().map(|(_, b)| b).sum::<f64>() * share;
        let offset = estimate_mean - reference_mean;
        let mut sums = Self { n, ..Self::default() };
        for (a, b) in pairs() {
            let error = a - b;
            sums.absolute += error.abs();
            sums.squares += error * error;
            sums.squares_without_offset += (error - offset).powi(2);
            sums.covariance += (a - estimate_mean) * (b - reference_mean);
            sums.estimate_variance += (a - estimate_mean).powi(2);
            sums.reference_variance += (b - reference_mean).powi(2);
        }
        sums
    }

    /// Both together.
    #[must_use]
    pub fn pooled(self, other: Self) -> Self {
        Self {
            n: self.n + other.n,
            absolute: self.absolute + other.absolute,
            squares: self.squares + other.squares,
            squares_without_offset: self.squares_without_offset + other.squares_without_offset,
            covariance: self.covariance + other.covariance,
            estimate_variance: self.estimate_variance + other.estimate_variance,
            reference_variance: self.reference_variance + other.reference_variance,
        }
    }

    /// Samples compared.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Mean absolute error; none without samples.
    pub fn mae(&self) -> Option<f64> {
        self.mean(self.absolute)
    }

    /// Root mean square error; none without samples.
    pub fn rmse(&self) -> Option<f64> {
        self.mean(self.squares).map(f64::sqrt)
    }

    /// Root mean square error after each series' mean error is taken away; none without samples.
    pub fn rmse_without_offset(&self) -> Option<f64> {
        self.mean(self.squares_without_offset).map(f64::sqrt)
    }

    /// Pearson's correlation, −1 to 1; none when one of both does not vary.
    pub fn correlation(&self) -> Option<f64> {
        let scale = (self.estimate_variance * self.reference_variance).sqrt();
        (scale > 0.0).then(|| (self.covariance / scale).clamp(-1.0, 1.0))
    }

    fn mean(&self, sum: f64) -> Option<f64> {
        (self.n > 0).then(|| sum / self.n as f64)
    }
}

/// Normalised cross-correlation at lag zero over the samples in which both are finite, −1 to 1; none when one of both
/// is zero throughout.
pub fn normalized_cross_correlation(estimate: &[f64], reference: &[f64]) -> Option<f64> {
    let (mut product, mut a_squares, mut b_squares) = (0.0, 0.0, 0.0);
    for (a, b) in estimate.iter().zip(reference).filter(|(a, b)| a.is_finite() && b.is_finite()) {
        product += a * b;
        a_squares += a * a;
        b_squares += b * b;
    }
    let scale = (a_squares * b_squares).sqrt();
    (scale > 0.0).then(|| (product / scale).clamp(-1.0, 1.0))
}

/// Quantiles of the finite values at shares of 0 to 1, interpolated linearly between order statistics.
pub fn quantiles<const N: usize>(values: &[f64], shares: [f64; N]) -> Option<[f64; N]> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    Some(shares.map(|share| {
        let place = share * last as f64;
        let (below, fraction) = (place as usize, place.fract());
        let above = (below + 1).min(last);
        sorted[below] + (sorted[above] - sorted[below]) * fraction
    }))
}

/// First quartile, median and third quartile of the finite values.
pub fn quartiles(values: &[f64]) -> Option<[f64; 3]> {
    quantiles(values, [0.25, 0.5, 0.75])
}

/// Median of the finite values.
pub fn median(values: &[f64]) -> Option<f64> {
    quartiles(values).map(|[_, median, _]| median)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Option<f64>, b: f64) -> bool {
        a.is_some_and(|a| (a - b).abs() < 1e-12)
    }

    #[test]
    fn errors_and_correlation_of_a_small_series_are_those_computed_by_hand() {
        // Errors 1, −1, 3, 1: mean 1, mean square 3; deviations of a: −3, −3, 3, 3; of b: −3, −1, 1, 3.
        let found = Agreement::between(&[2.0, 2.0, 8.0, 8.0], &[1.0, 3.0, 5.0, 7.0]);
        assert_eq!(found.n(), 4);
        assert!(close(found.mae(), 1.5));
        assert!(close(found.rmse(), 3f64.sqrt()));
        assert!(close(found.rmse_without_offset(), 2f64.sqrt()));
        assert!(close(found.correlation(), 24.0 / (36.0f64 * 20.0).sqrt()));
    }

    #[test]
    fn samples_without_a_number_on_either_side_are_left_out() {
        let found = Agreement::between(&[1.0, f64::NAN, 3.0], &[2.0, 5.0, f64::NAN]);
        assert_eq!((found.n(), found.mae(), found.correlation()), (1, Some(1.0), None));
        assert_eq!(Agreement::between(&[], &[]).rmse(), None);
    }

    #[test]
    fn pooled_sides_keep_their_own_offsets() {
        let left = Agreement::between(&[11.0, 12.0, 13.0], &[1.0, 2.0, 3.0]);
        let right = Agreement::between(&[1.0, 2.0, 3.0], &[11.0, 12.0, 13.0]);
        let both = left.pooled(right);
        assert_eq!(both.n(), 6);
        assert!(close(both.rmse(), 10.0) && close(both.rmse_without_offset(), 0.0));
        assert!(close(both.correlation(), 1.0));
    }

    #[test]
    fn cross_correlation_sees_shape_but_not_scale() {
        assert!(close(normalized_cross_correlation(&[1.0, 2.0], &[2.0, 4.0]), 1.0));
        assert!(close(normalized_cross_correlation(&[1.0, 0.0], &[1.0, 1.0]), 0.5f64.sqrt()));
        assert_eq!(normalized_cross_correlation(&[0.0, 0.0], &[1.0, 1.0]), None);
    }

    #[test]
    fn quartiles_interpolate_between_order_statistics() {
        assert_eq!(quartiles(&[4.0, 1.0, f64::NAN, 3.0, 2.0]), Some([1.75, 2.5, 3.25]));
        assert_eq!(quartiles(&[7.0]), Some([7.0, 7.0, 7.0]));
        assert_eq!(quartiles(&[]), None);
    }
}
