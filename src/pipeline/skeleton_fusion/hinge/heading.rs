//! Heading between the two units over time: the axis of the joint is one direction in the world.
//!
//! With the horizontal parts of the axis as complex numbers, `c₁` seen by the proximal and `c₂` by the distal unit, the
//! heading `δ` is what makes `c₁ = e^{iδ} c₂`. It is constant within a block and walks at random between blocks, so an
//! axis that stands upright, where both parts vanish, is bridged, and says in its variance that it was.

use super::HeadingModel;
use super::pair::{Instant, Pair};
use super::tridiagonal::smooth;
use nalgebra::{Complex, Vector3};
use std::f64::consts::{PI, TAU};

/// Time in which the heading is constant, and in which a deviation of the axis counts once, s: half a movement.
const BLOCK_SECONDS: f64 = 0.5;
/// Standard deviation by which the heading walks in one second, rad: a gyroscope's rest bias of 0.01 °/s and a gain error of
/// 0.05 % at 10 rad/s. Between 0.3 and 1 °/s^½ no joint of the data sets changes by more than 0.3°.
const WALK_SD: f64 = 0.5 * PI / 180.0;
/// The same for a heading that does not walk, rad: small beside anything, but no division by zero.
const CONSTANT_SD: f64 = 1e-9;
/// Standard deviation of a unit's axis about that of the joint, rad: soft tissue, and a knee that is not quite a hinge.
const AXIS_SD: f64 = 4.0 * PI / 180.0;
/// Deviations of the axis far beyond this many standard deviations do not count.
const OUTLIER: f64 = 3.0;
/// Time over which the first guess is averaged, s.
const GUESS_SECONDS: f64 = 10.0;
/// Linearisations; the fifth moves the heading by less than 0.001 rad on every joint that was tried.
const ITERATIONS: usize = 6;
/// Weight of no information, s⁻¹: keeps the equations definite where the axis stays upright.
const NOTHING: f64 = 1e-9;

/// Turn about up from the distal unit's `earth` to the proximal unit's, at each instant of a pair.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Heading {
    /// Rad, continuous.
    pub angle: Vec<f64>,
    /// Standard deviation, rad.
    pub sd: Vec<f64>,
}

pub(super) fn estimate(pair: &Pair, axes: &[Vector3<f64>; 2], model: HeadingModel) -> Heading {
    let horizontal: [Vec<Complex<f64>>; 2] = [0, 1].map(|unit| {
        let of_instant = |instant: &Instant| {
            let axis = instant.attitude * axes[unit];
            Complex::new(axis.x, -axis.z)
        };
        pair.units[unit].iter().map(of_instant).collect()
    });
    let block_of = |i: usize| (pair.seconds[i] / BLOCK_SECONDS) as usize;
    let n_blocks = block_of(pair.len() - 1) + 1;
    // How often each instant counts.
    let count = |i: usize| {
        let last = pair.len() - 1;
        let around = pair.seconds[(i + 1).min(last)] - pair.seconds[i.saturating_sub(1)];
        (0.5 * around / BLOCK_SECONDS).min(1.0)
    };
    let mut products = vec![Complex::new(0.0, 0.0); n_blocks];
    let mut weights = vec![NOTHING; n_blocks];
    for (i, (a, b)) in horizontal[0].iter().zip(&horizontal[1]).enumerate() {
        products[block_of(i)] += a * b.conj() * count(i);
        weights[block_of(i)] += a.norm() * b.norm() * count(i);
    }
    let mean = weights.iter().sum::<f64>() / n_blocks as f64;
    let (guess, _) = smooth(&weights, mean * (GUESS_SECONDS / BLOCK_SECONDS).powi(2), &products);
    let mut angles: Vec<f64> = guess.iter().map(|product| product.arg()).collect();
    for i in 1..n_blocks {
        angles[i] = angles[i - 1] + (angles[i] - angles[i - 1] + PI).rem_euclid(TAU) - PI;
    }
    let walk_sd = match model {
        HeadingModel::Tracked => WALK_SD,
        HeadingModel::Constant => CONSTANT_SD,
    };
    let tie = 1.0 / (walk_sd * walk_sd * BLOCK_SECONDS);
    let mut variances = vec![0.0; n_blocks];
    for _ in 0..ITERATIONS {
        let mut weights = vec![NOTHING; n_blocks];
        let mut right = vec![0.0; n_blocks];
        for (i, (a, b)) in horizontal[0].iter().zip(&horizontal[1]).enumerate() {
            let block = block_of(i);
            let turned = Complex::from_polar(1.0, angles[block]) * b;
            let relative = (a - turned).norm() / (OUTLIER * AXIS_SD);
            let weight = count(i) / (AXIS_SD * AXIS_SD * (1.0 + relative * relative));
            weights[block] += weight * b.norm_sqr();
            right[block] += weight * ((turned.conj() * a).im + b.norm_sqr() * angles[block]);
        }
        (angles, variances) = smooth(&weights, tie, &right);
    }
    let mut heading = Heading { angle: Vec::with_capacity(pair.len()), sd: Vec::with_capacity(pair.len()) };
    for seconds in &pair.seconds {
        let place = (seconds / BLOCK_SECONDS - 0.5).clamp(0.0, (n_blocks - 1) as f64);
        let (before, fraction) = (place as usize, place.fract());
        let after = (before + 1).min(n_blocks - 1);
        heading.angle.push(angles[before] + (angles[after] - angles[before]) * fraction);
        heading.sd.push((variances[before] + (variances[after] - variances[before]) * fraction).sqrt());
    }
    heading
}
