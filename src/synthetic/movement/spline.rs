//! Smooth curves through noisy samples: cubic splines with evenly spaced knots and a penalty on their roughness
//! (P-splines, Eilers and Marx 1996). Their second derivative is continuous, so a body that moves along them has sane
//! accelerations.

use nalgebra::SVector;

/// Non-zero basis functions at any place.
const ORDER: usize = 4;

/// Weight of the penalty on second differences of neighbouring coefficients, in samples: far below what a knot
/// interval with samples weighs, enough to carry the curve across a gap.
const PENALTY: f64 = 0.05;

/// A curve in `D` dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct Spline<const D: usize> {
    start: f64,
    knot_interval: f64,
    coefficients: Vec<SVector<f64, D>>,
}

impl<const D: usize> Spline<D> {
    /// The spline that fits the samples best; there must be at least two, at increasing times, finite.
    pub fn fit(times: &[f64], samples: &[SVector<f64, D>], knot_interval: f64) -> Self {
        let (start, end) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
        let intervals = ((end - start) / knot_interval).ceil().max(1.0) as usize;
        let n = intervals + ORDER - 1;
        let mut spline = Self { start, knot_interval, coefficients: vec![SVector::zeros(); n] };
        // Normal equations: a symmetric band matrix, row i holding columns i to i + 3.
        let mut band = vec![[0.0; ORDER]; n];
        for (time, sample) in times.iter().zip(samples) {
            let (first, weights) = spline.basis(*time);
            for (a, weight) in weights.iter().enumerate() {
                spline.coefficients[first + a] += sample * *weight;
                for b in a..ORDER {
                    band[first + a][b - a] += weight * weights[b];
                }
            }
        }
        const SECOND_DIFFERENCE: [f64; 3] = [1.0, -2.0, 1.0];
        for first in 0..n.saturating_sub(2) {
            for a in 0..3 {
                for b in a..3 {
                    band[first + a][b - a] += PENALTY * SECOND_DIFFERENCE[a] * SECOND_DIFFERENCE[b];
                }
            }
        }
        solve_banded(&mut band, &mut spline.coefficients);
        spline
    }

    /// Place of the curve; before its start and after its end, the place there.
    pub fn at(&self, time: f64) -> SVector<f64, D> {
        let (first, weights) = self.basis(time);
        weights.iter().enumerate().map(|(a, weight)| self.coefficients[first + a] * *weight).sum()
    }

    /// The first basis function that is not zero at a time, and the values of the four.
    fn basis(&self, time: f64) -> (usize, [f64; ORDER]) {
        let intervals = self.coefficients.len() - (ORDER - 1);
        let place = ((time - self.start) / self.knot_interval).clamp(0.0, intervals as f64);
        let first = (place as usize).min(intervals - 1);
        let u = place - first as f64;
        let v = 1.0 - u;
        let weights = [
            v * v * v / 6.0,
            (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
            (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
            u * u * u / 6.0,
        ];
        (first, weights)
    }
}

/// Solves `A x = b` in place for a positive definite band matrix, by its Cholesky factor `A = L D Lᵀ`.
fn solve_banded<const D: usize>(band: &mut [[f64; ORDER]], x: &mut [SVector<f64, D>]) {
    let n = band.len();
    for i in 0..n {
        let row = band[i];
        for a in 1..ORDER.min(n - i) {
            let factor = row[a] / row[0];
            for b in a..ORDER.min(n - i) {
                band[i + a][b - a] -= factor * row[b];
            }
            let above = x[i];
            x[i + a] -= above * factor;
        }
    }
    for i in (0..n).rev() {
        for a in 1..ORDER.min(n - i) {
            let below = x[i + a];
            x[i] -= below * band[i][a];
        }
        x[i] /= band[i][0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector1;

    #[test]
    fn a_smooth_course_is_followed_and_its_derivatives_too() {
        let course = |t: f64| (3.0 * t).sin();
        let times: Vec<f64> = (0..300).map(|i| f64::from(i) / 30.0).collect();
        let samples: Vec<Vector1<f64>> = times.iter().map(|t| Vector1::new(course(*t))).collect();
        let spline = Spline::fit(&times, &samples, 0.1);
        for i in 10..980 {
            let (t, h) = (f64::from(i) / 100.0, 1e-3);
            let at = |t: f64| spline.at(t)[0];
            assert!((at(t) - course(t)).abs() < 2e-3, "{t}: {}", at(t) - course(t));
            let second = (at(t + h) - 2.0 * at(t) + at(t - h)) / (h * h);
            assert!((second + 9.0 * course(t)).abs() < 1.0, "{t}: {second}");
        }
    }

    #[test]
    fn a_gap_is_bridged_and_two_samples_are_a_line() {
        let times: Vec<f64> = (0..100).map(|i| f64::from(i) / 30.0).filter(|t| !(1.0..1.6).contains(t)).collect();
        let samples: Vec<Vector1<f64>> = times.iter().map(|t| Vector1::new(2.0 * t)).collect();
        let spline = Spline::fit(&times, &samples, 0.1);
        assert!((spline.at(1.3)[0] - 2.6).abs() < 0.05, "{}", spline.at(1.3)[0]);
        let two = Spline::fit(&[0.0, 1.0], &[Vector1::new(1.0), Vector1::new(3.0)], 0.1);
        assert!((two.at(0.5)[0] - 2.0).abs() < 1e-6 && two.at(3.0) == two.at(1.0));
    }
}
