//! The linked skeleton as a particle model: prior, likelihood, and the fast kernel of both.
//!
//! ```text
//! f(θt | θt−1) = N(θt−1, Σθ Δt·30), truncated to the range of motion
//! g(y | θ)     = N(K(θ), Σy)
//! ```
//!
//! A register of particles is handled together, in `f32`. The residual is whitened with the inverse Cholesky factor of
//! Σy, restricted to the points that were seen; factors are kept per mask. The plain `f64` version stands in the tests.

use super::noise_model::{NoiseModel, ObservationCovariance, transition_sd_over};
use super::observation::{SeenMask, seen_mask};
use crate::body::pose::{POSE_DIMENSION, attitude_offset, hinge_offset};
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::{OBSERVATION_DIMENSION, POINT_COUNT, Skeleton};
use crate::estimation::particle_filter::{ParticleModel, Particles};
use crate::estimation::random::RandomStreams;
use crate::geometry::lanes::{Lanes, sin_cos};
use nalgebra::{DMatrix, Rotation3, Vector3};
use pulp::{Simd, WithSimd};
use std::collections::HashMap;

/// Draws after which a coordinate that keeps leaving its range is put on the bound. A coordinate on the bound leaves
/// it every other time, so 40 draws fail once in 10¹².
const MAX_DRAWS: u32 = 40;

/// Model of one subject in one recording.
#[derive(Debug, Clone)]
pub struct SkeletonParticleModel {
    kernel: Kernel,
    noise: NoiseModel,
    observation: ObservationCovariance,
    range: RangeOfMotion,
    whitenings: HashMap<SeenMask, Whitening>,
    drawn: Vec<f32>,
    arch: pulp::Arch,
}

/// Rows of the factor that are handled together, so that each residual is loaded once for all of them.
const TILE: usize = 4;

/// Inverse of the Cholesky factor of Σy restricted to the rows that were seen; the others are zero.
#[derive(Debug, Clone)]
struct Whitening {
    /// One tile of rows after the other: column by column, up to the tile's last row, the factors of the tile's rows.
    factors: Vec<[f32; TILE]>,
}

impl SkeletonParticleModel {
    /// Model of a calibrated subject. `subject_from_world` turns the sensor's noise into the observations' frame.
    pub fn new(skeleton: &Skeleton, noise: NoiseModel, subject_from_world: &Rotation3<f64>) -> Self {
        Self {
            kernel: Kernel::new(skeleton),
            observation: noise.observation_in(subject_from_world),
            noise,
            range: RangeOfMotion::healthy_adult(),
            whitenings: HashMap::new(),
            drawn: Vec::new(),
            arch: pulp::Arch::new(),
        }
    }
}

impl Whitening {
    fn new(observation: &ObservationCovariance, mask: SeenMask) -> Self {
        let rows: Vec<usize> = (0..OBSERVATION_DIMENSION).filter(|row| mask >> (row / 3) & 1 == 1).collect();
        let seen = DMatrix::from_fn(rows.len(), rows.len(), |i, j| observation[(rows[i], rows[j])]);
        // Σy is positive definite by construction, and so is every principal minor of it.
        let inverse = seen.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(|| DMatrix::zeros(0, 0));
        let mut whitening = DMatrix::zeros(OBSERVATION_DIMENSION, OBSERVATION_DIMENSION);
        for i in 0..inverse.nrows() {
            for j in 0..=i {
                whitening[(rows[i], rows[j])] = inverse[(i, j)] as f32;
            }
        }
        let mut factors = Vec::new();
        for tile in (0..OBSERVATION_DIMENSION).step_by(TILE) {
            factors.extend((0..tile + TILE).map(|column| std::array::from_fn(|row| whitening[(tile + row, column)])));
        }
        Self { factors }
    }
}

impl ParticleModel for SkeletonParticleModel {
    type Observation = [Vector3<f64>; POINT_COUNT];

    fn propagate(&mut self, interval_s: f64, streams: &mut RandomStreams, particles: &mut Particles) {
        let count = particles.count();
        self.drawn.resize(POSE_DIMENSION * count, 0.0);
        streams.fill_normal(&mut self.drawn);
        let sd = transition_sd_over(&self.noise, interval_s);
        for (d, drawn) in self.drawn.chunks_exact_mut(count).enumerate() {
            let bounds = [self.range.low[d] as f32, self.range.high[d] as f32];
            let (step, states) = (sd[d] as f32, particles.coordinate(d));
            if !self.arch.dispatch(RandomWalk { states, step, bounds, drawn }) {
                for (new, old) in drawn.iter_mut().zip(states) {
                    *new = redraw_outside(*new, *old, step, bounds, streams);
                }
            }
        }
        particles.swap_values(&mut self.drawn);
    }

    fn log_likelihood(&mut self, points: &Self::Observation, particles: &Particles, log_likelihood: &mut [f32]) {
        let mask = seen_mask(points);
        let observation = &self.observation;
        let whitening = self.whitenings.entry(mask).or_insert_with(|| Whitening::new(observation, mask));
        // A point that was not seen has no factors: any finite residual will do for it.
        let observed = points.map(|p| [p.x, p.y, p.z].map(|y| if y.is_finite() { y as f32 } else { 0.0 }));
        let kernel = &self.kernel;
        self.arch.dispatch(LikelihoodTask { kernel, particles, observed, whitening, log_likelihood });
    }
}

/// A step of the random walk of one coordinate: normal numbers become new states. True when all are within bounds.
struct RandomWalk<'a> {
    states: &'a [f32],
    step: f32,
    bounds: [f32; 2],
    drawn: &'a mut [f32],
}

impl WithSimd for RandomWalk<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let [low, high] = self.bounds;
        let (mut lowest, mut highest) = (simd.splat_f32s(high), simd.splat_f32s(low));
        let states = S::as_simd_f32s(self.states).0;
        for (new, old) in S::as_mut_simd_f32s(self.drawn).0.iter_mut().zip(states) {
            *new = (Lanes::new(simd, *old) + Lanes::new(simd, *new) * self.step).values;
            lowest = simd.min_f32s(lowest, *new);
            highest = simd.max_f32s(highest, *new);
        }
        simd.reduce_min_f32s(lowest) >= low && simd.reduce_max_f32s(highest) <= high
    }
}

/// The likelihood of all particles, for any instruction set. No closures in what it calls: they are not compiled with
/// the instruction set's features.
struct LikelihoodTask<'a> {
    kernel: &'a Kernel,
    particles: &'a Particles,
    observed: [[f32; 3]; POINT_COUNT],
    whitening: &'a Whitening,
    log_likelihood: &'a mut [f32],
}

impl WithSimd for LikelihoodTask<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { kernel, particles, observed, whitening, log_likelihood } = self;
        let mut theta: [&[S::f32s]; POSE_DIMENSION] = [&[]; POSE_DIMENSION];
        for (d, coordinate) in theta.iter_mut().enumerate() {
            *coordinate = S::as_simd_f32s(particles.coordinate(d)).0;
        }
        // Two registers share the loads of the factors; the widest registers may leave a single one.
        let (pairs, single) = S::as_mut_simd_f32s(log_likelihood).0.as_chunks_mut::<2>();
        let last = 2 * pairs.len();
        for (i, pair) in pairs.iter_mut().enumerate() {
            let first = kernel.residuals(simd, &theta, 2 * i, &observed);
            let second = kernel.residuals(simd, &theta, 2 * i + 1, &observed);
            *pair = log_likelihoods(simd, &[first, second], whitening);
        }
        if let [single] = single {
            [*single] = log_likelihoods(simd, &[kernel.residuals(simd, &theta, last, &observed)], whitening);
        }
    }
}

/// Points of a register of particles, or their distance from those observed.
type PointLanes<S> = [[Lanes<S>; 3]; POINT_COUNT];

/// `−½ rᵀ Σy⁻¹ r` of the residuals of some registers of particles, over the rows that were seen.
#[inline(always)]
fn log_likelihoods<S: Simd, const REGISTERS: usize>(
    simd: S,
    residuals: &[PointLanes<S>; REGISTERS],
    whitening: &Whitening,
) -> [S::f32s; REGISTERS] {
    let zero = Lanes::splat(simd, 0.0);
    let mut squared = [zero; REGISTERS];
    let mut next = 0;
    for last in (TILE..=OBSERVATION_DIMENSION).step_by(TILE) {
        let mut whitened = [[zero; REGISTERS]; TILE];
        for (column, factors) in whitening.factors[next..next + last].iter().enumerate() {
            for register in 0..REGISTERS {
                let residual = residuals[register].as_flattened()[column];
                for row in 0..TILE {
                    whitened[row][register] += residual * factors[row];
                }
            }
        }
        next += last;
        for whitened in &whitened {
            for register in 0..REGISTERS {
                squared[register] += whitened[register] * whitened[register];
            }
        }
    }
    let mut logs = [zero.values; REGISTERS];
    for register in 0..REGISTERS {
        logs[register] = (squared[register] * -0.5).values;
    }
    logs
}

/// A draw of the truncated prior: outside its range it is drawn again.
fn redraw_outside(new: f32, old: f32, step: f32, [low, high]: [f32; 2], streams: &mut RandomStreams) -> f32 {
    let mut value = new;
    for _ in 0..MAX_DRAWS {
        if (low..=high).contains(&value) {
            return value;
        }
        value = old + step * streams.normal() as f32;
    }
    value.clamp(low, high)
}

/// Forward kinematics of a register of particles.
#[derive(Debug, Clone)]
struct Kernel {
    offsets: [[f32; 3]; 4],
    proximal: [f32; 4],
    distal: [f32; 4],
}

/// Column of the limb's rotation matrix along its reference direction, with sign; the flexed direction is column X.
const REFERENCE_COLUMN: [(usize, f32); 4] = [(2, -1.0), (2, 1.0), (1, -1.0), (1, -1.0)];
/// Sign of the flexed direction on column X.
const FLEXED_SIGN: [f32; 4] = [1.0, 1.0, -1.0, -1.0];

impl Kernel {
    fn new(skeleton: &Skeleton) -> Self {
        Self {
            offsets: skeleton.offsets.map(|o| [o.x as f32, o.y as f32, o.z as f32]),
            proximal: skeleton.proximal.map(|l| l as f32),
            distal: skeleton.distal.map(|l| l as f32),
        }
    }

    /// K(θ) − y of a register of particles.
    #[inline(always)]
    fn residuals<S: Simd>(
        &self,
        simd: S,
        theta: &[&[S::f32s]; POSE_DIMENSION],
        register: usize,
        observed: &[[f32; 3]; POINT_COUNT],
    ) -> PointLanes<S> {
        let trunk = rotation(simd, attitude(simd, theta, 0, register));
        let [a, b, c] = self.limb_points::<S, 0>(simd, &trunk, theta, register);
        let [d, e, f] = self.limb_points::<S, 1>(simd, &trunk, theta, register);
        let [g, h, i] = self.limb_points::<S, 2>(simd, &trunk, theta, register);
        let [j, k, l] = self.limb_points::<S, 3>(simd, &trunk, theta, register);
        let mut points = [a, b, c, d, e, f, g, h, i, j, k, l];
        for (point, observed) in points.iter_mut().zip(observed) {
            for axis in 0..3 {
                point[axis] = point[axis] - observed[axis];
            }
        }
        points
    }

    /// Root, middle and end of a limb. The limb is a constant, so that its columns and signs are, too.
    #[inline(always)]
    fn limb_points<S: Simd, const LIMB: usize>(
        &self,
        simd: S,
        trunk: &[[Lanes<S>; 3]; 3],
        theta: &[&[S::f32s]; POSE_DIMENSION],
        register: usize,
    ) -> [[Lanes<S>; 3]; 3] {
        let turn = rotation(simd, attitude(simd, theta, attitude_offset(LIMB), register));
        let (sine, cosine) = sin_cos(Lanes::new(simd, theta[hinge_offset(LIMB)][register]));
        let (column, sign) = REFERENCE_COLUMN[LIMB];
        let along = sign * self.proximal[LIMB];
        let cosine = cosine * (sign * self.distal[LIMB]);
        let sine = sine * (FLEXED_SIGN[LIMB] * self.distal[LIMB]);
        let mut offset = [Lanes::splat(simd, 0.0); 3];
        let (mut to_middle, mut to_end) = (offset, offset);
        for axis in 0..3 {
            offset[axis] = Lanes::splat(simd, self.offsets[LIMB][axis]);
            to_middle[axis] = turn[axis][column] * along;
            to_end[axis] = to_middle[axis] + turn[axis][column] * cosine + turn[axis][0] * sine;
        }
        let root = transform(trunk, &offset);
        [root, sum(&root, &transform(trunk, &to_middle)), sum(&root, &transform(trunk, &to_end))]
    }
}

/// The attitude vector that starts at a coordinate.
#[inline(always)]
fn attitude<S: Simd>(simd: S, theta: &[&[S::f32s]; POSE_DIMENSION], start: usize, register: usize) -> [Lanes<S>; 3] {
    [
        Lanes::new(simd, theta[start][register]),
        Lanes::new(simd, theta[start + 1][register]),
        Lanes::new(simd, theta[start + 2][register]),
    ]
}

/// Rodrigues' formula for attitude vectors: `matrix[row][column]`.
#[inline(always)]
fn rotation<S: Simd>(simd: S, [x, y, z]: [Lanes<S>; 3]) -> [[Lanes<S>; 3]; 3] {
    // The tiny term keeps the division finite at zero; it changes an angle of 1e-3 rad by 5e-13.
    let one = Lanes::splat(simd, 1.0);
    let squared = x * x + y * y + z * z + 1e-15;
    let angle = squared.sqrt();
    let (sine, cosine) = sin_cos(angle);
    let s = sine / angle;
    let c = (one - cosine) / squared;
    let (cx, cy, cz) = (c * x, c * y, c * z);
    let (sx, sy, sz) = (s * x, s * y, s * z);
    let (xx, yy, zz) = (cx * x, cy * y, cz * z);
    let (xy, xz, yz) = (cx * y, cx * z, cy * z);
    [[one - (yy + zz), xy - sz, xz + sy], [xy + sz, one - (xx + zz), yz - sx], [xz - sy, yz + sx, one - (xx + yy)]]
}

#[inline(always)]
fn transform<S: Simd>(m: &[[Lanes<S>; 3]; 3], v: &[Lanes<S>; 3]) -> [Lanes<S>; 3] {
    let mut out = *v;
    for axis in 0..3 {
        out[axis] = m[axis][0] * v[0] + m[axis][1] * v[1] + m[axis][2] * v[2];
    }
    out
}

#[inline(always)]
fn sum<S: Simd>(a: &[Lanes<S>; 3], b: &[Lanes<S>; 3]) -> [Lanes<S>; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Pose;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::pose::PoseVector;
    use crate::geometry::lanes::LANES;
    use proptest::prelude::*;

    fn model() -> SkeletonParticleModel {
        SkeletonParticleModel::new(&Skeleton::of_stature(1.7), NoiseModel::nite_table1(), &Rotation3::identity())
    }

    /// The log-likelihood as it is written in the paper, in `f64`, without a factor shared between particles.
    fn plain_log_likelihood(theta: &PoseVector, observed: &[Vector3<f64>; POINT_COUNT]) -> f64 {
        let points = forward_kinematics(&Skeleton::of_stature(1.7), &Pose::from_vector(theta));
        let rows: Vec<usize> = (0..OBSERVATION_DIMENSION).filter(|r| observed[r / 3].x.is_finite()).collect();
        let full = NoiseModel::nite_table1().observation;
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| full[(rows[i], rows[j])]);
        let residual =
            nalgebra::DVector::from_iterator(rows.len(), rows.iter().map(|r| (observed[r / 3] - points[r / 3])[r % 3]));
        let solved = covariance.cholesky().expect("positive definite").solve(&residual);
        -0.5 * residual.dot(&solved)
    }

    proptest! {
        #[test]
        fn the_fast_kernel_agrees_with_the_plain_one(
            theta in prop::array::uniform19(-1.5..1.5f64),
            shift in prop::array::uniform19(-0.3..0.3f64),
            lost in 0..POINT_COUNT,
        ) {
            let (theta, shift) = (PoseVector::from(theta), PoseVector::from(shift));
            let skeleton = Skeleton::of_stature(1.7);
            let mut observed = forward_kinematics(&skeleton, &Pose::from_vector(&(theta + shift)));
            observed[lost] = Vector3::repeat(f64::NAN);
            let particles = Particles::at(theta.as_slice(), LANES);
            let mut fast = [0.0; LANES];
            model().log_likelihood(&observed, &particles, &mut fast);
            // The kernel sees the state rounded to f32 and sums 36 squares in f32.
            let found = f64::from(fast[5]);
            let rounded = theta.map(|v| f64::from(v as f32));
            let plain = plain_log_likelihood(&rounded, &observed);
            prop_assert!((found - plain).abs() < 1e-3 * plain.abs().max(1.0), "{found} against {plain}");
        }
    }

    #[test]
    fn the_prior_has_the_models_spread_and_stays_in_the_range_of_motion() {
        let mut model = model();
        let mut streams = RandomStreams::new(1);
        let mut theta = PoseVector::zeros();
        let knee = hinge_offset(3);
        theta[knee] = model.range.low[knee];
        let mut particles = Particles::at(theta.as_slice(), 4096);
        model.propagate(1.0 / 30.0, &mut streams, &mut particles);
        let low = model.range.low[knee] as f32;
        assert!(particles.coordinate(knee).iter().all(|v| *v >= low));
        let elbow = particles.coordinate(hinge_offset(0));
        let sd = (elbow.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / 4096.0).sqrt().to_degrees();
        // The standard error of an SD over 4096 draws is 1.1 %.
        assert!((sd / 2.44 - 1.0).abs() < 0.05, "elbow SD {sd} degrees");
    }
}
