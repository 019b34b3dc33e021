//! Least squares over the parameters of a calibration.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Parameters of a sensor (bias 3, gain 9, accelerometer 3, delay 1) and gravity in the first attitude's frame (3).
pub(super) const N_PARAMETERS: usize = 19;

/// Values or increments of the parameters.
pub(super) type Parameters = SVector<f64, N_PARAMETERS>;

/// Three equations `rows · x = values`, one for each axis.
pub(super) struct Equation {
    pub rows: SMatrix<f64, 3, N_PARAMETERS>,
    pub values: Vector3<f64>,
}

/// The sum of weighted equations.
pub(super) struct NormalEquations {
    matrix: SMatrix<f64, N_PARAMETERS, N_PARAMETERS>,
    right: Parameters,
}

impl NormalEquations {
    pub(super) fn new() -> Self {
        Self { matrix: SMatrix::zeros(), right: Parameters::zeros() }
    }

    /// Adds three equations whose values have the standard deviation `sd`.
    pub(super) fn add(&mut self, equation: &Equation, sd: f64) {
        let weighted = equation.rows.transpose() / (sd * sd);
        self.matrix += weighted * equation.rows;
        self.right += weighted * equation.values;
    }

    /// Adds that parameter `index` is `value`, give or take `sd`.
    pub(super) fn add_single(&mut self, index: usize, value: f64, sd: f64) {
        self.matrix[(index, index)] += 1.0 / (sd * sd);
        self.right[index] += value / (sd * sd);
    }

    /// The solution, and the covariance of the first three parameters; none when the equations contradict arithmetic.
    pub(super) fn solve(self) -> Option<(Parameters, Matrix3<f64>)> {
        let cholesky = self.matrix.cholesky()?;
        let solution = cholesky.solve(&self.right);
        let covariance = cholesky.inverse().fixed_view::<3, 3>(0, 0).into_owned();
        solution.iter().all(|value| value.is_finite()).then_some((solution, covariance))
    }
}
