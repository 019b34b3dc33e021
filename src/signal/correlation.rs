//! How alike two series are at each of many lags.

use std::ops::Range;

/// A series prepared for correlation at many lags: missing values replaced by the mean, sums taken once.
#[derive(Debug, Clone, PartialEq)]
pub struct Prepared {
    /// Deviations from the mean of the whole.
    values: Vec<f64>,
    /// Sum and sum of squares of everything before each place.
    before: Vec<[f64; 2]>,
}

/// Variance below which, relative to the mean square, a series is one number and its rounding.
const ROUNDING: f64 = 1e-20;

impl Prepared {
    /// Prepares a series in which NaN is missing; `None` when nothing in it varies.
    pub fn new(series: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = series.collect();
        let (n, sum) = values.iter().filter(|v| !v.is_nan()).fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
        let mean = sum / f64::max(n, 1.0);
        let mut before = Vec::with_capacity(values.len() + 1);
        let (mut sum, mut energy) = (0.0, 0.0);
        before.push([sum, energy]);
        for value in &mut values {
            *value = if value.is_nan() { 0.0 } else { *value - mean };
            sum += *value;
            energy += *value * *value;
            before.push([sum, energy]);
        }
        (energy > ROUNDING * mean * mean * n).then_some(Self { values, before })
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// True without any place.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Standard deviation of the series.
    pub fn sd(&self) -> f64 {
        let [_, energy] = self.before[self.values.len()];
        (energy / f64::max(self.values.len() as f64, 1.0)).sqrt()
    }

    /// Correlation of place `i + lag` of `self` with place `i` of `other`, over those of `places` for which both exist,
    /// −1 to 1; 0 when none do or one of the two does not vary there.
    pub fn correlation(&self, other: &Self, places: Range<usize>, lag: i64) -> f64 {
        let places = overlap(self.len(), other.len(), places, lag);
        if places.is_empty() {
            return 0.0;
        }
        let own = (places.start as i64 + lag) as usize..(places.end as i64 + lag) as usize;
        let n = places.len() as f64;
        let [own_sum, own_energy] = difference(self.before[own.end], self.before[own.start]);
        let [sum, energy] = difference(other.before[places.end], other.before[places.start]);
        let covariance = dot(&self.values[own], &other.values[places]) - own_sum * sum / n;
        let variances = (own_energy - own_sum * own_sum / n) * (energy - sum * sum / n);
        if variances > 0.0 { (covariance / variances.sqrt()).clamp(-1.0, 1.0) } else { 0.0 }
    }
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Those of `places` of a series of `len` at which a series of `own_len` has a place `lag` later; an empty range at its
/// start when there are none.
pub fn overlap(own_len: usize, len: usize, places: Range<usize>, lag: i64) -> Range<usize> {
    let start = places.start.max((-lag).max(0) as usize);
    let end = places.end.min(len).min((own_len as i64 - lag).max(0) as usize);
    start..end.max(start)
}

/// Sum of products, in lanes that the compiler turns into vector instructions.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// The top of the parabola through three neighbouring values of which the middle one is highest: its place, in steps
/// from the middle, and its curvature per step squared (negative). `None` when they have no top.
pub fn top_of_parabola(before: f64, middle: f64, after: f64) -> Option<(f64, f64)> {
    let curvature = before - 2.0 * middle + after;
    (middle >= before && middle >= after && curvature < 0.0).then(|| (0.5 * (before - after) / curvature, curvature))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, shift: i64) -> Vec<f64> {
        (0..n as i64).map(|i| (((i + shift) * (i + shift)) as f64 * 0.001).sin() + 5.0).collect()
    }

    #[test]
    fn a_shifted_copy_correlates_fully_at_its_lag_only() {
        let a = Prepared::new(wave(300, 0).into_iter()).expect("it varies");
        let b = Prepared::new(wave(300, 17).into_iter()).expect("it varies");
        for places in [0..300, 100..200] {
            assert!(a.correlation(&b, places.clone(), 17) > 1.0 - 1e-9);
            assert!((-40..40).filter(|&lag| a.correlation(&b, places.clone(), lag) > 0.95).eq([17]));
            assert_eq!(a.correlation(&b, places.clone(), 300), 0.0);
            assert_eq!(a.correlation(&b, places, -300), 0.0);
        }
    }

    #[test]
    fn a_constant_or_a_missing_series_has_nothing_to_correlate() {
        assert_eq!(Prepared::new([9.81; 50].into_iter()), None);
        assert_eq!(Prepared::new([f64::NAN; 50].into_iter()), None);
        assert_eq!(Prepared::new(std::iter::empty()), None);
    }

    #[test]
    fn the_top_of_a_parabola_is_found_between_the_steps() {
        let parabola = |x: f64| 2.0 - 3.0 * (x - 0.2) * (x - 0.2);
        let (place, curvature) = top_of_parabola(parabola(-1.0), parabola(0.0), parabola(1.0)).expect("a top");
        assert!((place - 0.2).abs() < 1e-12 && (curvature + 6.0).abs() < 1e-12);
        assert_eq!(top_of_parabola(3.0, 2.0, 1.0), None);
        assert_eq!(top_of_parabola(1.0, 1.0, 1.0), None);
    }
}
