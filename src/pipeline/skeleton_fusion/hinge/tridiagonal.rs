//! Smooth series by least squares: a value for each block, neighbours alike.

use std::ops::{Add, Mul, Sub};

/// Solves `(diag(weights) + tie · DᵀD) x = right` where `D` takes differences of neighbours.
///
/// Returns `x` and the diagonal of the inverse: the variances of `x` when weights are inverse variances. Every sum of
/// weights must be positive; values may be real or complex.
pub(super) fn smooth<T>(weights: &[f64], tie: f64, right: &[T]) -> (Vec<T>, Vec<f64>)
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let n = weights.len();
    // What the blocks before i, and those after it, say of block i: a value and its weight, softened by the tie.
    let sweep = |order: &mut dyn Iterator<Item = usize>| {
        let mut told: Vec<Option<(T, f64)>> = vec![None; n];
        let mut carried: Option<(T, f64)> = None;
        for i in order {
            told[i] = carried;
            let (sum, weight) = match carried {
                Some((sum, weight)) => (sum + right[i], weight + weights[i]),
                None => (right[i], weights[i]),
            };
            let soft = tie / (tie + weight);
            carried = Some((sum * soft, weight * soft));
        }
        told
    };
    let before = sweep(&mut (0..n));
    let after = sweep(&mut (0..n).rev());
    let mut values = Vec::with_capacity(n);
    let mut variances = Vec::with_capacity(n);
    for i in 0..n {
        let (mut sum, mut weight) = (right[i], weights[i]);
        for (told, its_weight) in [before[i], after[i]].into_iter().flatten() {
            sum = sum + told;
            weight += its_weight;
        }
        variances.push(1.0 / weight);
        values.push(sum * (1.0 / weight));
    }
    (values, variances)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn it_is_the_solution_of_the_full_equations() {
        let (weights, tie, right) = ([2.0, 0.0, 0.5, 3.0, 0.0], 1.7, [1.0, 0.0, -2.0, 0.3, 0.0]);
        let mut matrix = DMatrix::from_diagonal(&DVector::from_column_slice(&weights));
        for i in 0..4 {
            for (a, b, sign) in [(i, i, 1.0), (i + 1, i + 1, 1.0), (i, i + 1, -1.0), (i + 1, i, -1.0)] {
                matrix[(a, b)] += sign * tie;
            }
        }
        let inverse = matrix.try_inverse().unwrap();
        let (values, variances) = smooth(&weights, tie, &right);
        let expected = &inverse * DVector::from_column_slice(&right);
        for i in 0..5 {
            assert!((values[i] - expected[i]).abs() < 1e-12, "{i}");
            assert!((variances[i] - inverse[(i, i)]).abs() < 1e-12, "{i}");
        }
    }
}
