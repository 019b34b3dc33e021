//! Where the joint is from each unit, and what that tells.
//!
//! A unit at `r` from the joint, in its own frame, measures `a = a_joint + ω̇ × r + ω × (ω × r)`. Both units see the same
//! joint, so with attitudes in one frame
//!
//! ```text
//! R₁ (a₁ − K₁ r₁) = R₂ (a₂ − K₂ r₂)            K r = ω̇ × r + ω × (ω × r)
//! ```
//!
//! which is linear in both places. It holds for one heading between the units and not for the opposite one, so it tells
//! which ends of the two axes belong together; and from the joint, the units lie where their segments lie, so it tells
//! flexion from extension and upright from not.

use super::heading::Heading;
use super::pair::{Instant, Pair};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// Time over which accelerations are averaged, s: short beside a step, long beside the ringing of soft tissue.
const BLOCK_SECONDS: f64 = 0.1;
/// Standard deviation of the place beforehand, m: half a segment of the body.
const PLACE_SD: f64 = 0.3;
/// Standard deviation of averaged accelerations about the equation, m/s²; those far beyond it count less.
const ACCELERATION_SD: f64 = 1.0;
/// Repetitions with new weights; the tenth moves the place by less than 1 mm.
const ITERATIONS: usize = 10;
/// Nearest to the axis of the joint that a unit may be for its direction to mean something, m.
const MIN_DISTANCE: f64 = 0.03;
/// Least flexion that tells its sense, rad: counted from where the units lie opposite each other, which is up to 30° from
/// straight as they lie on the skin, and counted from quiet standing, where a knee bends backwards by 10° at most.
pub(super) const MIN_FLEXION_FROM_UNITS: f64 = FRAC_PI_4;
pub(super) const MIN_FLEXION_FROM_STANDING: f64 = PI / 9.0;
/// Share of the instants that may lie beyond the range of motion.
const BEYOND: f64 = 0.02;

/// The joint from both units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct JointCentre {
    /// From the joint to the proximal unit in its frame, m.
    pub proximal: Vector3<f64>,
    /// From the joint to the distal unit in its frame, m.
    pub distal: Vector3<f64>,
    /// What the two accelerations of the joint differ by, m/s²: root mean square, each at most a few
    /// [`ACCELERATION_SD`].
    pub disagreement: f64,
}

type Places = SVector<f64, 6>;

/// The matrix `K` of the module's doc between two neighbours of an instant.
fn lever_matrix(instant: &Instant, before: &Instant, after: &Instant, seconds: f64) -> Matrix3<f64> {
    let change = (after.rate - before.rate) / seconds;
    let rate = instant.rate.cross_matrix();
    change.cross_matrix() + rate * rate
}

/// The places from which the accelerations of the joint agree best.
pub(super) fn estimate(pair: &Pair, heading: &Heading) -> JointCentre {
    let equations = equations(pair, heading);
    let mut places = Places::zeros();
    let residual = |places: &Places, (rows, value): &(SMatrix<f64, 3, 6>, Vector3<f64>)| {
        (value - rows * places).norm_squared() / (ACCELERATION_SD * ACCELERATION_SD)
    };
    for _ in 0..ITERATIONS {
        let mut matrix = SMatrix::<f64, 6, 6>::identity() / (PLACE_SD * PLACE_SD);
        let mut right = Places::zeros();
        for equation in &equations {
            let (rows, value) = equation;
            let weighted = rows.transpose() / (ACCELERATION_SD * ACCELERATION_SD * (1.0 + residual(&places, equation)));
            matrix += weighted * rows;
            right += weighted * value;
        }
        // The prior keeps the matrix definite.
        if let Some(cholesky) = matrix.cholesky() {
            places = cholesky.solve(&right);
        }
    }
    let sum: f64 = equations.iter().map(|equation| residual(&places, equation).ln_1p()).sum();
    JointCentre {
        proximal: places.fixed_rows::<3>(0).into_owned(),
        distal: places.fixed_rows::<3>(3).into_owned(),
        disagreement: (sum / equations.len().max(1) as f64).sqrt() * ACCELERATION_SD,
    }
}

/// The equation of each block of [`BLOCK_SECONDS`].
fn equations(pair: &Pair, heading: &Heading) -> Vec<(SMatrix<f64, 3, 6>, Vector3<f64>)> {
    let mut equations = Vec::new();
    let mut rows = SMatrix::<f64, 3, 6>::zeros();
    let mut value = Vector3::zeros();
    let (mut n, mut start) = (0.0, 0.0);
    for i in 1..pair.len() - 1 {
        let seconds = pair.seconds[i + 1] - pair.seconds[i - 1];
        // Over a gap the rates' slope is not their change.
        if seconds > 2.0 * BLOCK_SECONDS {
            continue;
        }
        for (unit, sign) in [(0, 1.0), (1, -1.0)] {
            let samples = &pair.units[unit];
            let attitude = pair.attitudes(i, heading.angle[i])[unit].to_rotation_matrix().into_inner();
            let lever = attitude * lever_matrix(&samples[i], &samples[i - 1], &samples[i + 1], seconds);
            let mut columns = rows.fixed_columns_mut::<3>(3 * unit);
            columns += lever * sign;
            value += attitude * samples[i].acceleration * sign;
        }
        n += 1.0;
        if pair.seconds[i] - start >= BLOCK_SECONDS {
            equations.push((rows / n, value / n));
            (rows, value, n, start) = (SMatrix::zeros(), Vector3::zeros(), 0.0, pair.seconds[i]);
        }
    }
    equations
}

/// The angle at which the limb is straight, as far as the units lie where their segments lie; none when a unit is too near
/// the axis of the joint.
///
/// Seen along the axis, the two units then lie opposite each other.
pub(super) fn straight_angle(
    pair: &Pair,
    axes: &[Vector3<f64>; 2],
    heading: &Heading,
    centre: &JointCentre,
    angles: &[f64],
) -> Option<f64> {
    let across = |place: &Vector3<f64>, axis: &Vector3<f64>| place - axis * axis.dot(place);
    let (a, b) = (across(&centre.proximal, &axes[0]), across(&centre.distal, &axes[1]));
    if a.norm().min(b.norm()) < MIN_DISTANCE {
        return None;
    }
    // The same at every instant but for the joint not being a perfect hinge.
    let (mut sine, mut cosine) = (0.0, 0.0);
    for i in pair.thinned(BLOCK_SECONDS) {
        let [proximal, distal] = pair.attitudes(i, heading.angle[i]);
        let (from, to) = (proximal * a, -(distal * b));
        let turn = f64::atan2((proximal * axes[0]).dot(&from.cross(&to)), from.dot(&to));
        sine += (angles[i] - turn).sin();
        cosine += (angles[i] - turn).cos();
    }
    Some(f64::atan2(sine, cosine))
}

/// +1 when the angle grows with flexion, −1 when it falls; none when the joint bent less than `min_flexion` to each side of
/// the angle at which it is straight, rad.
///
/// Knees and elbows bend much more to one side of straight than to the other.
pub(super) fn flexion_sense(angles: &[f64], straight: f64, min_flexion: f64) -> Option<f64> {
    let mut sorted = angles.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let quantile = |share: f64| sorted[(share * (sorted.len() - 1) as f64) as usize] - straight;
    let (low, high) = (quantile(BEYOND), quantile(1.0 - BEYOND));
    // Whole turns do not count: the middle of the range lies within half a turn of straight.
    let turns = ((0.5 * (low + high) + PI) / TAU).floor() * TAU;
    let (forwards, backwards) = (high - turns, turns - low);
    if forwards.max(backwards) < min_flexion {
        return None;
    }
    Some(if forwards >= backwards { 1.0 } else { -1.0 })
}
