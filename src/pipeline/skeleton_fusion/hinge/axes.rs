//! The axis of the joint in the frame of each unit.
//!
//! ```text
//! | |ω₁ × j₁| − |ω₂ × j₂| |  is small              j₁ᵀ u₁ − j₂ᵀ u₂  is small
//! ```
//!
//! The part of both rates across the axis is the same, since the joint only turns about it (Seel, Schauer and Raisch 2012);
//! and the axis has the same inclination seen from both units, `u` being up in each unit's frame. Both hold whatever the
//! heading between the units is. Robust least squares over the four angles of the two directions, from many starts: the
//! principal axes of the rates.

use super::HingeError;
use super::pair::Pair;
use nalgebra::{Matrix3, Matrix4, SymmetricEigen, Unit, Vector3, Vector4};

/// Least time in movement, s.
pub(super) const MIN_MOVING_SECONDS: f64 = 3.0;
/// Time between the instants that are used, s: human movement is slower than half its inverse.
const SPACING_SECONDS: f64 = 0.04;
/// Sum of both rates above which the joint is in movement, rad/s.
const MIN_RATE: f64 = 0.4;
/// Standard deviation of the rates across the axis, rad/s, and what the rate adds to it, rad/s per rad/s: soft tissue and a
/// knee that also twists a little.
const RATE_SD: f64 = 0.1;
const RATE_SD_PER_RATE: f64 = 0.1;
/// Standard deviation of the axis' inclination between the units, rad.
const INCLINATION_SD: f64 = 0.05;
/// Instants from which the starts are compared.
const N_COMPARED: usize = 600;
/// Steps from each start, and from the best one with every instant.
const FIRST_STEPS: usize = 12;
const LAST_STEPS: usize = 40;
/// Starts that are followed to the end.
const N_FOLLOWED: usize = 3;
/// Time after which residuals are independent, s: half a movement.
const INDEPENDENT_SECONDS: f64 = 0.5;
/// A step shorter than this is the last, rad.
const CONVERGED: f64 = 1e-9;

/// Axes in the frames of the two units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Unit vectors; which ends belong together is not well known.
    pub axes: [Vector3<f64>; 2],
    /// Standard deviation of each in its worst direction, rad.
    pub sd: [f64; 2],
}

/// Rates and up of both units at one instant, with the inverse standard deviation of the rates.
#[derive(Debug, Clone, Copy)]
struct Row {
    rates: [Vector3<f64>; 2],
    up: [Vector3<f64>; 2],
    rate_weight: f64,
}

pub(super) fn estimate(pair: &Pair) -> Result<Found, HingeError> {
    let rows = rows(pair);
    let seconds = rows.len() as f64 * SPACING_SECONDS;
    if seconds < MIN_MOVING_SECONDS {
        return Err(HingeError::TooLittleMovement { seconds });
    }
    let few: Vec<Row> = rows.iter().step_by(rows.len().div_ceil(N_COMPARED)).copied().collect();
    let mut reached: Vec<(f64, [Vector3<f64>; 2])> =
        starts(&few).into_iter().map(|start| descend(&few, start, FIRST_STEPS)).collect();
    reached.sort_by(|a, b| a.0.total_cmp(&b.0));
    let followed = reached.iter().take(N_FOLLOWED).map(|(_, axes)| descend(&rows, *axes, LAST_STEPS));
    let Some((cost, axes)) = followed.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return Err(HingeError::TooLittleMovement { seconds });
    };
    let (_, matrix, _) = linearised(&rows, &axes);
    // Residuals that scatter more than assumed, and that come in runs, say less.
    let excess = (cost / rows.len() as f64).max(1.0) * (INDEPENDENT_SECONDS / SPACING_SECONDS);
    let covariance = matrix.try_inverse().map_or(Matrix4::identity(), |inverse| inverse * excess);
    let worst = |first: usize| {
        let block = covariance.fixed_view::<2, 2>(first, first).into_owned();
        block.symmetric_eigenvalues().max().max(0.0).sqrt().min(std::f64::consts::FRAC_PI_2)
    };
    Ok(Found { axes, sd: [worst(0), worst(2)] })
}

fn rows(pair: &Pair) -> Vec<Row> {
    let rows = pair.thinned(SPACING_SECONDS).into_iter().filter_map(|i| {
        let instants = [&pair.units[0][i], &pair.units[1][i]];
        let rates = instants.map(|instant| instant.rate);
        let magnitude = rates[0].norm() + rates[1].norm();
        (magnitude > MIN_RATE).then(|| Row {
            rates,
            up: instants.map(|instant| instant.up()),
            rate_weight: 1.0 / (RATE_SD + RATE_SD_PER_RATE * magnitude),
        })
    });
    rows.collect()
}

/// Pairs of principal axes of the two rates, both ends of the distal one.
fn starts(rows: &[Row]) -> Vec<[Vector3<f64>; 2]> {
    let [proximal, distal] = [0, 1].map(|unit| {
        let moments: Matrix3<f64> = rows.iter().map(|row| row.rates[unit] * row.rates[unit].transpose()).sum();
        SymmetricEigen::new(moments).eigenvectors
    });
    let mut starts = Vec::new();
    for a in proximal.column_iter() {
        for b in distal.column_iter() {
            starts.extend([1.0, -1.0].map(|sign| [a.into_owned(), b * sign]));
        }
    }
    starts
}

/// A unit vector across another.
pub(super) fn perpendicular(axis: &Vector3<f64>) -> Unit<Vector3<f64>> {
    let least = axis.iamin();
    Unit::new_normalize(axis.cross(&Vector3::ith(least, 1.0)))
}

/// Two unit vectors that span what is across an axis.
fn tangents(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = perpendicular(axis).into_inner();
    [first, axis.cross(&first)]
}

/// `|ω × j|`, and its change per change of `j`.
fn across(rate: &Vector3<f64>, axis: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let along = rate.dot(axis);
    let across = (rate.norm_squared() - along * along).max(0.0).sqrt();
    // On the axis the length has a kink; its mean slope is zero.
    let slope = if across > 1e-9 { rate * (-along / across) } else { Vector3::zeros() };
    (across, slope)
}

/// Robust cost, its weighted normal matrix and gradient over the four tangent directions (soft L1 of each residual).
fn linearised(rows: &[Row], axes: &[Vector3<f64>; 2]) -> (f64, Matrix4<f64>, Vector4<f64>) {
    let tangents = axes.map(|axis| tangents(&axis));
    let (mut cost, mut matrix, mut gradient) = (0.0, Matrix4::zeros(), Vector4::zeros());
    for row in rows {
        let (a, slope_a) = across(&row.rates[0], &axes[0]);
        let (b, slope_b) = across(&row.rates[1], &axes[1]);
        let inclination = row.up[0].dot(&axes[0]) - row.up[1].dot(&axes[1]);
        let equations = [
            ((a - b) * row.rate_weight, slope_a * row.rate_weight, -slope_b * row.rate_weight),
            (inclination / INCLINATION_SD, row.up[0] / INCLINATION_SD, -row.up[1] / INCLINATION_SD),
        ];
        for (residual, by_proximal, by_distal) in equations {
            let slope = Vector4::new(
                by_proximal.dot(&tangents[0][0]),
                by_proximal.dot(&tangents[0][1]),
                by_distal.dot(&tangents[1][0]),
                by_distal.dot(&tangents[1][1]),
            );
            let root = (1.0 + residual * residual).sqrt();
            cost += 2.0 * (root - 1.0);
            matrix += slope * slope.transpose() / root;
            gradient += slope * (residual / root);
        }
    }
    (cost, matrix, gradient)
}

/// Levenberg-Marquardt from a start; the cost and the axes that it reached.
fn descend(rows: &[Row], start: [Vector3<f64>; 2], n_steps: usize) -> (f64, [Vector3<f64>; 2]) {
    let mut axes = start;
    let (mut cost, mut matrix, mut gradient) = linearised(rows, &axes);
    let mut damping = 1e-3;
    for _ in 0..n_steps {
        let damped = matrix + Matrix4::from_diagonal(&matrix.diagonal().add_scalar(1e-9)) * damping;
        let Some(step) = damped.cholesky().map(|cholesky| -cholesky.solve(&gradient)) else { break };
        let moved = [0, 1].map(|unit| {
            let [first, second] = tangents(&axes[unit]);
            (axes[unit] + first * step[2 * unit] + second * step[2 * unit + 1]).normalize()
        });
        let next = linearised(rows, &moved);
        if next.0 < cost {
            (axes, (cost, matrix, gradient)) = (moved, next);
            damping *= 0.2;
            if step.norm() < CONVERGED {
                break;
            }
        } else {
            damping *= 8.0;
        }
    }
    (cost, axes)
}
