//! The unscented Kalman filter of a posture whose rates change at random: sigma points in place of the derivative.
//!
//! The rates make the prediction linear, and a frame shows the posture alone. So neither needs sigma points of its own:
//! those of the posture say what an observation is like around it, and [`RateFilter`](super::rate_smoother::RateFilter)
//! does the rest exactly, rates through their covariance with the posture and the backward pass included. For a linear
//! prediction that pass is the unscented Rauch–Tung–Striebel smoother.
//!
//! ```text
//! r(x̄ ⊞ δ) ≈ r̄ − A δ + e,  e ~ N(0, Ω)      regression of the residual on 2D + 1 sigma points of N(x̄, P)
//! H = Aᵀ (Ω + R)⁻¹ A,  g = Aᵀ (Ω + R)⁻¹ r̄   what the filter asks for
//! ```
//!
//! `Ω` is what the observation bends within the uncertainty; a derivative has none. Each iteration of the filter takes its
//! sigma points from the latest posterior (García-Fernández, Svensson, Morelande and Särkkä 2015), and each row of the
//! residual is weighed by its expected square under it (Piché, Särkkä and Hartikainen 2012), so that one wild row does
//! not move the others.

use super::rate_smoother::RateModel;
use nalgebra::{SMatrix, SVector};

/// A model whose observation sigma points can look at.
pub trait UnscentedModel<const D: usize, const M: usize>: RateModel<D> {
    /// Residuals of an observation at a posture, each in its standard deviations. A row that was not seen is 0 at every
    /// posture, and so tells nothing.
    fn residuals(&self, observation: &Self::Observation, posture: &Self::Posture) -> SVector<f64, M>;

    /// Weight of each row, of which `squares` are the expected squares: 1 where errors are normal, less for outliers.
    fn weights(&self, squares: &SVector<f64, M>) -> SVector<f64, M>;
}

/// Where sigma points lie and what they weigh (Julier and Uhlmann 2004; van der Merwe 2004).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaScaling {
    /// α: spread of the sigma points, above 0, at most 1.
    pub alpha: f64,
    /// β: what is known of the distribution beside its covariance; 2 is best for a normal one.
    pub beta: f64,
    /// κ: second scale; with α = 1 sigma points lie `√(D + κ)` standard deviations away.
    pub kappa: f64,
}

impl SigmaScaling {
    /// Distance of the sigma points squared, in variances (`D + λ`), and the centre's weights in mean and covariance.
    fn coefficients(&self, dimension: usize) -> (f64, f64, f64) {
        let n = dimension as f64;
        let squared_distance = self.alpha.powi(2) * (n + self.kappa);
        let in_mean = 1.0 - n / squared_distance;
        (squared_distance, in_mean, in_mean + 1.0 - self.alpha.powi(2) + self.beta)
    }
}

/// A model seen through sigma points; a [`RateFilter`](super::rate_smoother::RateFilter) over it is the unscented filter.
#[derive(Debug, Clone, Copy)]
pub struct Unscented<'a, Model, const M: usize> {
    model: &'a Model,
    scaling: SigmaScaling,
}

impl<'a, Model, const M: usize> Unscented<'a, Model, M> {
    /// The model seen through sigma points of a scaling.
    pub fn new(model: &'a Model, scaling: SigmaScaling) -> Self {
        Self { model, scaling }
    }
}

impl<const D: usize, const M: usize, Model: UnscentedModel<D, M>> RateModel<D> for Unscented<'_, Model, M> {
    type Posture = Model::Posture;
    type Observation = Model::Observation;

    fn moved(&self, posture: &Self::Posture, step: &SVector<f64, D>) -> Self::Posture {
        self.model.moved(posture, step)
    }

    fn step_between(&self, from: &Self::Posture, to: &Self::Posture) -> SVector<f64, D> {
        self.model.step_between(from, to)
    }

    fn information(
        &self,
        observation: &Self::Observation,
        posture: &Self::Posture,
    ) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
        self.model.information(observation, posture)
    }

    /// By sigma points; where the covariance has no factor (it is not positive definite), by the tangent.
    fn information_around(
        &self,
        observation: &Self::Observation,
        posture: &Self::Posture,
        covariance: impl Fn() -> SMatrix<f64, D, D>,
    ) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
        let Some(factor) = covariance().cholesky().map(|c| c.unpack()) else {
            return self.model.information(observation, posture);
        };
        let regression = self.regression(observation, posture, &factor);
        regression.information(&factor, |squares| self.model.weights(squares)).unwrap_or_else(|| {
            // No number in the residuals: an observation that cannot be used counts as none.
            (SMatrix::zeros(), SVector::zeros())
        })
    }

    fn acceleration_density(&self) -> SVector<f64, D> {
        self.model.acceleration_density()
    }
}

/// Linear regression of the residual on the posture.
struct Regression<const D: usize, const M: usize> {
    mean: SVector<f64, M>,
    /// `−A L` with `L` the factor of the posture's covariance: the residual's change along each of its columns.
    along: SMatrix<f64, M, D>,
    /// `Ω`: what no line explains.
    bending: SMatrix<f64, M, M>,
}

impl<Model, const M: usize> Unscented<'_, Model, M> {
    fn regression<const D: usize>(
        &self,
        observation: &Model::Observation,
        posture: &Model::Posture,
        factor: &SMatrix<f64, D, D>,
    ) -> Regression<D, M>
    where
        Model: UnscentedModel<D, M>,
    {
        let (squared_distance, centre_in_mean, centre_in_covariance) = self.scaling.coefficients(D);
        let distance = squared_distance.sqrt();
        let centre = self.model.residuals(observation, posture);
        let mut along = SMatrix::<f64, M, D>::zeros();
        let mut middles = SMatrix::<f64, M, D>::zeros();
        for column in 0..D {
            let step = factor.column(column) * distance;
            let ahead = self.model.residuals(observation, &self.model.moved(posture, &step));
            let behind = self.model.residuals(observation, &self.model.moved(posture, &-step));
            along.set_column(column, &((ahead - behind) / (2.0 * distance)));
            middles.set_column(column, &((ahead + behind) * 0.5));
        }
        // Each pair weighs 2 · 1 / (2 (D + λ)) in the mean.
        let mean = centre * centre_in_mean + middles.column_sum() / squared_distance;
        // A pair's differences are what the line explains; its middle's distance from the mean is bending.
        for mut middle in middles.column_iter_mut() {
            middle -= mean;
        }
        let mut bending = middles * middles.transpose() / squared_distance;
        bending.ger(centre_in_covariance, &(centre - mean), &(centre - mean), 1.0);
        Regression { mean, along, bending }
    }
}

impl<const D: usize, const M: usize> Regression<D, M> {
    /// Information and gradient for errors of unit variance over the rows' weights; `None` without a number.
    fn information(
        &self,
        factor: &SMatrix<f64, D, D>,
        weights: impl Fn(&SVector<f64, M>) -> SVector<f64, M>,
    ) -> Option<(SMatrix<f64, D, D>, SVector<f64, D>)> {
        let squares = SVector::<f64, M>::from_fn(|row, _| {
            self.mean[row].powi(2) + self.along.row(row).norm_squared() + self.bending[(row, row)].max(0.0)
        });
        let error = SMatrix::<f64, M, M>::from_diagonal(&weights(&squares).map(|weight| 1.0 / weight));
        // A negative weight of the centre may leave Ω indefinite; then the line alone has to do.
        let error = (error + self.bending).cholesky().or_else(|| error.cholesky())?;
        let triangle = error.l();
        let along = triangle.solve_lower_triangular(&self.along)?;
        let mean = triangle.solve_lower_triangular(&self.mean)?;
        // A = −along L⁻¹, so AᵀS⁻¹A = L⁻ᵀ (alongᵀ S⁻¹ along) L⁻¹.
        let slope = factor.tr_solve_lower_triangular(&along.transpose())?;
        let information = slope * slope.transpose();
        let gradient = -slope * mean;
        gradient.iter().all(|value| value.is_finite()).then_some((information, gradient))
    }
}

#[cfg(test)]
mod tests {
    use super::super::rate_smoother::tests::{LINE, Line, SETTINGS, batch, observations};
    use super::super::rate_smoother::{RateFilter, RateHistory};
    use super::*;

    impl UnscentedModel<2, 2> for Line {
        fn residuals(&self, observation: &Option<(f64, f64)>, posture: &SVector<f64, 2>) -> SVector<f64, 2> {
            observation.map_or_else(SVector::zeros, |(first, sum)| {
                SVector::<f64, 2>::new(first - posture[0], sum - posture[0] - posture[1]) / self.noise.sqrt()
            })
        }

        fn weights(&self, _squares: &SVector<f64, 2>) -> SVector<f64, 2> {
            SVector::repeat(1.0)
        }
    }

    const SCALINGS: [SigmaScaling; 2] =
        [SigmaScaling { alpha: 1.0, beta: 0.0, kappa: 1.0 }, SigmaScaling { alpha: 0.3, beta: 2.0, kappa: 0.0 }];

    #[test]
    fn on_a_linear_model_the_smoother_is_the_least_squares_solution_also_through_a_gap() {
        let seen = observations();
        let intervals: Vec<f64> = (0..12).map(|t| if t == 0 { 0.0 } else { 0.03 + 0.01 * (t % 3) as f64 }).collect();
        for scaling in SCALINGS {
            let unscented = Unscented::new(&LINE, scaling);
            let mut filter = RateFilter::new(SVector::zeros(), SETTINGS);
            let mut history = RateHistory::with_capacity(12);
            for (observation, interval) in seen.iter().zip(&intervals) {
                filter.step(&unscented, observation, *interval);
                history.push(&filter);
            }
            let mut smoothed = Vec::new();
            history.smooth(&unscented, |frame| smoothed.push(frame));
            smoothed.reverse();
            for (t, (mean, covariance)) in batch(&LINE, &seen, &intervals).into_iter().enumerate() {
                assert!((smoothed[t].posture - mean).norm() < 1e-8, "frame {t}: {scaling:?}");
                assert!((smoothed[t].covariance - covariance).norm() < 1e-8, "covariance of frame {t}: {scaling:?}");
            }
        }
    }

    /// One coordinate of which the square is seen: y = x² + e.
    struct Square {
        noise_sd: f64,
        has_outliers: bool,
    }

    impl RateModel<1> for Square {
        type Posture = f64;
        type Observation = f64;

        fn moved(&self, posture: &f64, step: &SVector<f64, 1>) -> f64 {
            posture + step[0]
        }

        fn step_between(&self, from: &f64, to: &f64) -> SVector<f64, 1> {
            SVector::<f64, 1>::new(to - from)
        }

        fn information(&self, observed: &f64, posture: &f64) -> (SMatrix<f64, 1, 1>, SVector<f64, 1>) {
            let slope = 2.0 * posture / self.noise_sd;
            let residual = (observed - posture * posture) / self.noise_sd;
            (SMatrix::<f64, 1, 1>::new(slope * slope), SVector::<f64, 1>::new(slope * residual))
        }

        fn acceleration_density(&self) -> SVector<f64, 1> {
            SVector::zeros()
        }
    }

    impl UnscentedModel<1, 1> for Square {
        fn residuals(&self, observed: &f64, posture: &f64) -> SVector<f64, 1> {
            SVector::<f64, 1>::new((observed - posture * posture) / self.noise_sd)
        }

        fn weights(&self, squares: &SVector<f64, 1>) -> SVector<f64, 1> {
            squares.map(|square| if self.has_outliers { 5.0 / (4.0 + square) } else { 1.0 })
        }
    }

    #[test]
    fn the_regression_of_a_square_has_its_exact_mean_slope_and_bending() {
        // For x ~ N(m, s²): E x² = m² + s², regression slope 2m, and 2s⁴ of variance beside the line.
        let (mean, sd) = (0.7, 0.4);
        let square = Square { noise_sd: 1.0, has_outliers: false };
        let unscented = Unscented::new(&square, SigmaScaling { alpha: 1.0, beta: 0.0, kappa: 2.0 });
        let regression = unscented.regression(&0.0, &mean, &SMatrix::<f64, 1, 1>::new(sd));
        assert!((regression.mean[0] + mean * mean + sd * sd).abs() < 1e-12);
        assert!((regression.along[(0, 0)] + 2.0 * mean * sd).abs() < 1e-12);
        assert!((regression.bending[(0, 0)] - 2.0 * sd.powi(4)).abs() < 1e-12);
    }

    #[test]
    fn an_observation_without_a_number_counts_as_none_and_a_covariance_without_a_factor_leaves_the_tangent() {
        let scaling = SigmaScaling { alpha: 1.0, beta: 0.0, kappa: 2.0 };
        let square = Square { noise_sd: 1.0, has_outliers: false };
        let unscented = Unscented::new(&square, scaling);
        let none = unscented.information_around(&f64::NAN, &1.0, SMatrix::<f64, 1, 1>::identity);
        assert_eq!(none, (SMatrix::zeros(), SVector::zeros()));
        let tangent = unscented.information_around(&2.0, &1.0, || -SMatrix::<f64, 1, 1>::identity());
        assert_eq!(tangent, square.information(&2.0, &1.0));
    }

    #[test]
    fn an_outlier_moves_the_robust_filter_less_than_it_moves_the_normal_one() {
        let settings = super::super::rate_smoother::RateSettings { initial_sd: 0.2, iterations: 4, ..SETTINGS };
        let moved = |has_outliers: bool| {
            let square = Square { noise_sd: 0.3, has_outliers };
            let unscented = Unscented::new(&square, SCALINGS[0]);
            (RateFilter::new(1.0, settings).step(&unscented, &9.0, 0.0).posture - 1.0).abs()
        };
        assert!(moved(true) < 0.5 * moved(false), "{} against {}", moved(true), moved(false));
    }
}
