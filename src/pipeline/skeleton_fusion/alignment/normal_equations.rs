//! Weighted least squares over a vector of unknowns of which each equation touches a few.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The sum of weighted equations.
#[derive(Debug, Clone)]
pub(super) struct NormalEquations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// Unknowns that an equation touches, each with its coefficient.
pub(super) type Terms<'a> = &'a [(usize, f64)];

impl NormalEquations {
    /// No equation yet for `n` unknowns.
    pub(super) fn new(n: usize) -> Self {
        Self { matrix: DMatrix::zeros(n, n), right: DVector::zeros(n) }
    }

    /// Adds that the terms sum up to `value`, with an inverse variance.
    pub(super) fn add(&mut self, terms: Terms<'_>, value: f64, weight: f64) {
        for (row, a) in terms {
            let weighted = a * weight;
            self.right[*row] += weighted * value;
            for (column, b) in terms {
                self.matrix[(*row, *column)] += weighted * b;
            }
        }
    }

    /// Adds three equations that share their unknowns: `columns` holds each unknown's three coefficients.
    pub(super) fn add_vector(
        &mut self,
        columns: &[(usize, nalgebra::Vector3<f64>)],
        value: &nalgebra::Vector3<f64>,
        weight: f64,
    ) {
        for (row, a) in columns {
            self.right[*row] += weight * a.dot(value);
            for (column, b) in columns {
                self.matrix[(*row, *column)] += weight * a.dot(b);
            }
        }
    }

    /// The factor that solves the equations; none when some unknown is not determined.
    pub(super) fn factor(self) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
        let factor = self.matrix.cholesky()?;
        let solution = factor.solve(&self.right);
        solution.iter().all(|value| value.is_finite()).then_some((factor, solution))
    }
}
