//! The linked skeleton as a particle model.
//!
//! ```text
//! f(θt | θt−1) = N(θt−1, Σθ Δt·30), truncated to the range of motion
//! g(y | θ)     = N(K(θ), Σy)
//! ```
//!
//! Particles are `f32`. The prior is drawn here, the likelihood in `likelihood_kernel`; its factors are kept per mask of
//! points that were seen.

use super::likelihood_kernel::{Kernel, LikelihoodTask, Whitening};
use super::noise_model::{NoiseModel, ObservationCovariance, transition_sd_over};
use super::observation::{SeenMask, seen_mask};
use crate::body::pose::POSE_DIMENSION;
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::{POINT_COUNT, Skeleton};
use crate::estimation::particle_filter::{ParticleModel, Particles};
use crate::estimation::random::RandomStreams;
use crate::geometry::lanes::Lanes;
use nalgebra::{Rotation3, Vector3};
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
        let observed = std::array::from_fn(|p| {
            let point = if mask >> p & 1 == 1 { points[p] } else { Vector3::zeros() };
            [point.x as f32, point.y as f32, point.z as f32]
        });
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::OBSERVATION_DIMENSION;
    use crate::body::Pose;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::pose::{PoseVector, hinge_offset};
    use crate::geometry::lanes::LANES;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    /// A subject who stands askew to the sensor, so that the sensor's axes of noise mix.
    fn subject_from_world() -> Rotation3<f64> {
        Rotation3::from_euler_angles(0.1, 0.7, -0.2)
    }

    fn model() -> SkeletonParticleModel {
        SkeletonParticleModel::new(&Skeleton::of_stature(1.7), NoiseModel::nite_table1(), &subject_from_world())
    }

    /// The log-likelihood as it is written in the paper, in `f64`, without a factor shared between particles.
    fn plain_log_likelihood(theta: &PoseVector, observed: &[Vector3<f64>; POINT_COUNT]) -> f64 {
        let points = forward_kinematics(&Skeleton::of_stature(1.7), &Pose::from_vector(theta));
        let rows: Vec<usize> = (0..OBSERVATION_DIMENSION).filter(|r| observed[r / 3].x.is_finite()).collect();
        let full = NoiseModel::nite_table1().observation_in(&subject_from_world());
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| full[(rows[i], rows[j])]);
        let residual =
            nalgebra::DVector::from_iterator(rows.len(), rows.iter().map(|r| (observed[r / 3] - points[r / 3])[r % 3]));
        let solved = covariance.cholesky().expect("positive definite").solve(&residual);
        -0.5 * residual.dot(&solved)
    }

    proptest! {
        #[test]
        fn the_fast_kernel_agrees_with_the_plain_one_for_each_particle_and_mask(
            thetas in prop::collection::vec(prop::array::uniform19(-1.5..1.5f64), 3 * LANES),
            shift in prop::array::uniform19(-0.3..0.3f64),
            seen in 1..1u16 << POINT_COUNT,
        ) {
            let skeleton = Skeleton::of_stature(1.7);
            let theta = PoseVector::from(thetas[0]) + PoseVector::from(shift);
            let mut observed = forward_kinematics(&skeleton, &Pose::from_vector(&theta));
            for point in (0..POINT_COUNT).filter(|p| seen >> p & 1 == 0) {
                observed[point] = Vector3::repeat(f64::NAN);
            }
            let mut particles = Particles::at(&[0.0; POSE_DIMENSION], thetas.len());
            for d in 0..POSE_DIMENSION {
                for (value, theta) in particles.coordinate_mut(d).iter_mut().zip(&thetas) {
                    *value = theta[d] as f32;
                }
            }
            let mut fast = [0.0; 3 * LANES];
            model().log_likelihood(&observed, &particles, &mut fast);
            for (theta, fast) in thetas.iter().zip(fast) {
                // The kernel sees the state rounded to f32 and sums up to 36 squares in f32.
                let rounded = PoseVector::from(*theta).map(|v| f64::from(v as f32));
                let (found, plain) = (f64::from(fast), plain_log_likelihood(&rounded, &observed));
                prop_assert!((found - plain).abs() < 1e-3 * plain.abs().max(1.0), "{found} against {plain}");
            }
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
        // Half of a normal distribution is left: its mean lies 0.798 SD inside, with a standard error of 0.0094 SD.
        let depth = particles.coordinate(knee).iter().map(|v| f64::from(v - low)).sum::<f64>() / 4096.0;
        let depth = depth.to_degrees() / 1.31;
        assert!((depth - 0.798).abs() < 0.05, "the knee lies {depth} SD inside its range");
        let elbow = particles.coordinate(hinge_offset(0));
        let sd = (elbow.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / 4096.0).sqrt().to_degrees();
        // The standard error of an SD over 4096 draws is 1.1 %.
        assert!((sd / 2.44 - 1.0).abs() < 0.05, "elbow SD {sd} degrees");
    }
}
