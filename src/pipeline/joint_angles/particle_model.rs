//! The linked skeleton as a particle model: prior, likelihood, and the fast kernel of both.
//!
//! ```text
//! f(θt | θt−1) = N(θt−1, Σθ Δt·30), truncated to the range of motion
//! g(y | θ)     = N(K(θ), Σy)
//! ```
//!
//! Sixteen particles are handled together in `f32`. The residual is whitened with the inverse Cholesky factor of Σy,
//! restricted to the points that were seen; factors are kept per mask. The plain `f64` version stands in the tests.

use super::noise_model::{NoiseModel, ObservationCovariance, transition_sd_over};
use super::observation::{SeenMask, seen_mask};
use crate::body::pose::{POSE_DIMENSION, attitude_offset, hinge_offset};
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::skeleton::point_index;
use crate::body::{Limb, OBSERVATION_DIMENSION, POINT_COUNT, Skeleton};
use crate::estimation::particle_filter::{ParticleModel, Particles};
use crate::estimation::random::RandomStreams;
use crate::geometry::lanes::{LANES, Lanes, sin_cos};
use nalgebra::{DMatrix, Rotation3, Vector3};
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

/// Inverse of the Cholesky factor of Σy restricted to the rows that were seen.
#[derive(Debug, Clone)]
struct Whitening {
    rows: Vec<usize>,
    /// Row `i` holds `i + 1` factors.
    factors: Vec<f32>,
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
        let mut factors = Vec::with_capacity(rows.len() * (rows.len() + 1) / 2);
        for i in 0..inverse.nrows() {
            factors.extend((0..=i).map(|j| inverse[(i, j)] as f32));
        }
        Self { rows, factors }
    }
}

impl ParticleModel for SkeletonParticleModel {
    type Observation = [Vector3<f64>; POINT_COUNT];

    fn propagate(&mut self, interval_s: f64, streams: &mut RandomStreams, particles: &mut Particles) {
        let count = particles.count();
        self.drawn.resize(POSE_DIMENSION * count, 0.0);
        streams.fill_normal(&mut self.drawn);
        let sd = transition_sd_over(&self.noise, interval_s);
        for d in 0..POSE_DIMENSION {
            let (low, high) = (self.range.low[d] as f32, self.range.high[d] as f32);
            let step = sd[d] as f32;
            let drawn = &mut self.drawn[d * count..(d + 1) * count];
            let states = particles.coordinate_mut(d);
            self.arch.dispatch(|| {
                for (new, old) in drawn.iter_mut().zip(states.iter()) {
                    *new = old + step * *new;
                }
            });
            if drawn.iter().any(|new| !(low..=high).contains(new)) {
                for (new, old) in drawn.iter_mut().zip(states.iter()) {
                    *new = redraw_outside(*new, *old, step, low, high, streams);
                }
            }
            states.copy_from_slice(drawn);
        }
    }

    fn log_likelihood(&mut self, points: &Self::Observation, particles: &Particles, log_likelihood: &mut [f64]) {
        let mask = seen_mask(points);
        let observation = &self.observation;
        let whitening = self.whitenings.entry(mask).or_insert_with(|| Whitening::new(observation, mask));
        let observed = points.map(|p| [p.x as f32, p.y as f32, p.z as f32]);
        let kernel = &self.kernel;
        self.arch.dispatch(LikelihoodTask { kernel, particles, observed, whitening, log_likelihood });
    }
}

/// The likelihood of all particles, to be compiled for each instruction set. A closure would not do: it is not
/// compiled into the function that has the instruction set's features.
struct LikelihoodTask<'a> {
    kernel: &'a Kernel,
    particles: &'a Particles,
    observed: [[f32; 3]; POINT_COUNT],
    whitening: &'a Whitening,
    log_likelihood: &'a mut [f64],
}

impl pulp::NullaryFnOnce for LikelihoodTask<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (group, out) in self.log_likelihood.chunks_exact_mut(LANES).enumerate() {
            let distances =
                self.kernel.squared_mahalanobis(self.particles, group * LANES, &self.observed, self.whitening);
            for (log, distance) in out.iter_mut().zip(distances) {
                *log = -0.5 * f64::from(distance);
            }
        }
    }
}

/// A draw of the truncated prior: outside its range it is drawn again.
fn redraw_outside(new: f32, old: f32, step: f32, low: f32, high: f32, streams: &mut RandomStreams) -> f32 {
    let mut value = new;
    for _ in 0..MAX_DRAWS {
        if (low..=high).contains(&value) {
            return value;
        }
        value = old + step * streams.normal() as f32;
    }
    value.clamp(low, high)
}

/// Forward kinematics of sixteen particles.
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

    /// `(y − K(θ))ᵀ Σy⁻¹ (y − K(θ))` of the particles `start..start + 16`, over the rows that were seen.
    #[inline(always)]
    fn squared_mahalanobis(
        &self,
        particles: &Particles,
        start: usize,
        observed: &[[f32; 3]; POINT_COUNT],
        whitening: &Whitening,
    ) -> Lanes {
        let points = self.points(particles, start);
        let mut residuals = [[0.0; LANES]; OBSERVATION_DIMENSION];
        for (residual, &row) in residuals.iter_mut().zip(&whitening.rows) {
            let y = observed[row / 3][row % 3];
            for i in 0..LANES {
                residual[i] = y - points[row / 3][row % 3][i];
            }
        }
        let mut sum = [0.0; LANES];
        let mut next = 0;
        for row in 0..whitening.rows.len() {
            let mut whitened = [0.0; LANES];
            for (residual, &factor) in residuals.iter().zip(&whitening.factors[next..=next + row]) {
                for i in 0..LANES {
                    whitened[i] += factor * residual[i];
                }
            }
            next += row + 1;
            for i in 0..LANES {
                sum[i] += whitened[i] * whitened[i];
            }
        }
        sum
    }

    /// Points of the particles `start..start + 16`.
    #[inline(always)]
    fn points(&self, particles: &Particles, start: usize) -> [[Lanes; 3]; POINT_COUNT] {
        let coordinate = |d: usize| load(particles, d, start);
        let trunk = rotation([coordinate(0), coordinate(1), coordinate(2)]);
        let mut points = [[[0.0; LANES]; 3]; POINT_COUNT];
        for limb in Limb::ALL {
            let l = limb.index();
            let a = attitude_offset(l);
            let turn = rotation([coordinate(a), coordinate(a + 1), coordinate(a + 2)]);
            let (sine, cosine) = sin_cos(&coordinate(hinge_offset(l)));
            let (column, sign) = REFERENCE_COLUMN[l];
            let mut proximal = [[0.0; LANES]; 3];
            let mut distal = [[0.0; LANES]; 3];
            for axis in 0..3 {
                for i in 0..LANES {
                    let along = sign * turn[axis][column][i];
                    let flexed = FLEXED_SIGN[l] * turn[axis][0][i];
                    proximal[axis][i] = self.proximal[l] * along;
                    distal[axis][i] = self.distal[l] * (along * cosine[i] + flexed * sine[i]);
                }
            }
            let (to_middle, to_end) = (transform(&trunk, &proximal), transform(&trunk, &distal));
            for axis in 0..3 {
                for i in 0..LANES {
                    let root = trunk[axis][0][i] * self.offsets[l][0]
                        + trunk[axis][1][i] * self.offsets[l][1]
                        + trunk[axis][2][i] * self.offsets[l][2];
                    let middle = root + to_middle[axis][i];
                    points[point_index(limb, 0)][axis][i] = root;
                    points[point_index(limb, 1)][axis][i] = middle;
                    points[point_index(limb, 2)][axis][i] = middle + to_end[axis][i];
                }
            }
        }
        points
    }
}

#[inline(always)]
fn load(particles: &Particles, d: usize, start: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&particles.coordinate(d)[start..start + LANES]);
    lanes
}

/// Rodrigues' formula for sixteen attitude vectors: `matrix[row][column]`.
#[inline(always)]
fn rotation(v: [Lanes; 3]) -> [[Lanes; 3]; 3] {
    let (mut angle, mut squared) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        // The tiny term keeps the division finite at zero; it changes an angle of 1e-3 rad by 5e-13.
        squared[i] = v[0][i] * v[0][i] + v[1][i] * v[1][i] + v[2][i] * v[2][i] + 1e-15;
        angle[i] = squared[i].sqrt();
    }
    let (sine, cosine) = sin_cos(&angle);
    let mut m = [[[0.0; LANES]; 3]; 3];
    for i in 0..LANES {
        let s = sine[i] / angle[i];
        let c = (1.0 - cosine[i]) / squared[i];
        let (x, y, z) = (v[0][i], v[1][i], v[2][i]);
        m[0][0][i] = 1.0 - c * (y * y + z * z);
        m[1][1][i] = 1.0 - c * (x * x + z * z);
        m[2][2][i] = 1.0 - c * (x * x + y * y);
        m[0][1][i] = c * x * y - s * z;
        m[1][0][i] = c * x * y + s * z;
        m[0][2][i] = c * x * z + s * y;
        m[2][0][i] = c * x * z - s * y;
        m[1][2][i] = c * y * z - s * x;
        m[2][1][i] = c * y * z + s * x;
    }
    m
}

#[inline(always)]
fn transform(m: &[[Lanes; 3]; 3], v: &[Lanes; 3]) -> [Lanes; 3] {
    let mut out = [[0.0; LANES]; 3];
    for axis in 0..3 {
        for i in 0..LANES {
            out[axis][i] = m[axis][0][i] * v[0][i] + m[axis][1][i] * v[1][i] + m[axis][2][i] * v[2][i];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Pose;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::pose::PoseVector;
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
            let rounded = theta.map(|v| f64::from(v as f32));
            let plain = plain_log_likelihood(&rounded, &observed);
            prop_assert!((fast[5] - plain).abs() < 1e-3 * plain.abs().max(1.0), "{} against {plain}", fast[5]);
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
