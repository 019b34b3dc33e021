//! The particle filter: propagate by the prior, weight by the likelihood, resample (\[angles\] Eqs. 2 and 3).
//!
//! The driver knows no body; a [`ParticleModel`] knows no driver. Particles are stored by coordinate, so that a model
//! handles many of them with one instruction.

use super::random::RandomStreams;
use super::resampling::{Resampler, Resampling};
use super::weights::{effective_sample_size, normalize_log_weights};
use crate::geometry::lanes::LANES;
use nalgebra::{DMatrix, DVector};
use pulp::{Arch, NullaryFnOnce};

/// Particles, coordinate by coordinate: coordinate `d` of particle `i` is element `d * count + i`.
#[derive(Debug, Clone, PartialEq)]
pub struct Particles {
    count: usize,
    dimension: usize,
    values: Vec<f32>,
}

impl Particles {
    /// `count` copies of one state.
    ///
    /// # Panics
    /// When `count` is not a multiple of [`LANES`].
    pub fn at(state: &[f64], count: usize) -> Self {
        assert!(count > 0 && count.is_multiple_of(LANES), "particles come in groups of {LANES}");
        let mut values = Vec::with_capacity(state.len() * count);
        for coordinate in state {
            values.extend(std::iter::repeat_n(*coordinate as f32, count));
        }
        Self { count, dimension: state.len(), values }
    }

    /// Number of particles.
    pub fn count(&self) -> usize {
        self.count
    }

    /// One coordinate of all particles.
    pub fn coordinate(&self, d: usize) -> &[f32] {
        &self.values[d * self.count..(d + 1) * self.count]
    }

    /// One coordinate of all particles, to be changed.
    pub fn coordinate_mut(&mut self, d: usize) -> &mut [f32] {
        &mut self.values[d * self.count..(d + 1) * self.count]
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Takes over new values and gives back the old ones, without a copy.
    ///
    /// # Panics
    /// When there are not as many as before.
    pub fn swap_values(&mut self, values: &mut Vec<f32>) {
        assert_eq!(values.len(), self.values.len(), "as many values as particles have coordinates");
        std::mem::swap(&mut self.values, values);
    }
}

/// A state-space model in the form that the particle filter needs.
pub trait ParticleModel {
    /// One observation.
    type Observation: ?Sized;

    /// Draws each particle's next state from the prior f(θt | θt−1), `interval_s` seconds later.
    fn propagate(&mut self, interval_s: f64, streams: &mut RandomStreams, particles: &mut Particles);

    /// Log-likelihood log g(y | θ) of each particle, up to a constant that all share.
    fn log_likelihood(&mut self, observation: &Self::Observation, particles: &Particles, log_likelihood: &mut [f32]);
}

/// Moments of the posterior at one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    /// Mean of the resampled particles (the paper's estimate).
    pub mean: DVector<f64>,
    /// Covariance of the resampled particles.
    pub covariance: DMatrix<f64>,
    /// Effective sample size before resampling, particles.
    pub effective_sample_size: f64,
}

/// The filter's state between frames. It does not grow with their number.
#[derive(Debug, Clone)]
pub struct ParticleFilter {
    particles: Particles,
    resampled: Particles,
    streams: RandomStreams,
    frame: u64,
    log_weights: Vec<f32>,
    weights: Vec<f32>,
    resampler: Resampler,
    siblings: Vec<Siblings>,
    deviation: Vec<f64>,
    moments: Moments,
    arch: Arch,
}

/// Particles that are equal because they descend from one parent.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Siblings {
    /// One of them.
    particle: usize,
    /// Their share of all particles.
    share: f64,
}

impl ParticleFilter {
    /// A filter whose particles all start in one state.
    ///
    /// # Panics
    /// When `count` is not a multiple of [`LANES`].
    pub fn new(initial: &[f64], count: usize, seed: u64) -> Self {
        let particles = Particles::at(initial, count);
        let dimension = initial.len();
        Self {
            resampled: particles.clone(),
            particles,
            streams: RandomStreams::new(seed),
            frame: 0,
            log_weights: vec![0.0; count],
            weights: vec![0.0; count],
            resampler: Resampler::new(Resampling::Multinomial, count),
            siblings: Vec::with_capacity(count),
            deviation: vec![0.0; dimension],
            moments: Moments {
                mean: DVector::from_row_slice(initial),
                covariance: DMatrix::zeros(dimension, dimension),
                effective_sample_size: count as f64,
            },
            arch: Arch::new(),
        }
    }

    /// Moments after the last frame.
    pub fn moments(&self) -> &Moments {
        &self.moments
    }

    /// One frame: propagate, weight by the observation when there is one, resample. Allocates nothing.
    pub fn step<M: ParticleModel>(
        &mut self,
        model: &mut M,
        interval_s: f64,
        observation: Option<&M::Observation>,
    ) -> &Moments {
        self.frame += 1;
        self.streams.start_frame(self.frame);
        model.propagate(interval_s, &mut self.streams, &mut self.particles);
        match observation {
            Some(observation) => {
                model.log_likelihood(observation, &self.particles, &mut self.log_weights);
                normalize_log_weights(&self.log_weights, &mut self.weights);
                self.moments.effective_sample_size = effective_sample_size(&self.weights);
                self.resampler.draw(&self.weights, &mut self.streams);
                self.survive();
            }
            None => {
                self.moments.effective_sample_size = self.particles.count as f64;
                self.resampler.keep_all();
            }
        }
        self.update_moments();
        &self.moments
    }

    /// Replaces the particles by their offspring.
    fn survive(&mut self) {
        let ancestors = self.resampler.ancestors().as_chunks::<LANES>().0;
        for d in 0..self.particles.dimension {
            let parents = self.particles.coordinate(d);
            let children = self.resampled.coordinate_mut(d).as_chunks_mut::<LANES>().0;
            for (children, ancestors) in children.iter_mut().zip(ancestors) {
                // Ancestors ascend: a group between two equal ones has one parent, as most have when few survive.
                if ancestors[0] == ancestors[LANES - 1] {
                    *children = [parents[ancestors[0] as usize]; LANES];
                } else {
                    *children = ancestors.map(|ancestor| parents[ancestor as usize]);
                }
            }
        }
        std::mem::swap(&mut self.particles, &mut self.resampled);
    }

    /// Mean and covariance of the particles. Siblings are counted once with their share, which costs little when few
    /// parents survive.
    fn update_moments(&mut self) {
        let n = self.particles.count as f64;
        self.siblings.clear();
        let mut first = 0;
        for siblings in self.resampler.ancestors().chunk_by(|a, b| a == b) {
            self.siblings.push(Siblings { particle: first, share: siblings.len() as f64 / n });
            first += siblings.len();
        }
        let Moments { mean, covariance, .. } = &mut self.moments;
        self.arch.dispatch(SumMoments {
            particles: &self.particles,
            siblings: &self.siblings,
            deviation: &mut self.deviation,
            mean: mean.as_mut_slice(),
            covariance: covariance.as_mut_slice(),
        });
        covariance.fill_upper_triangle_with_lower_triangle();
    }
}

/// Sums of the moments, to be compiled for each instruction set. The covariance is stored by columns; its lower
/// triangle is filled.
struct SumMoments<'a> {
    particles: &'a Particles,
    siblings: &'a [Siblings],
    deviation: &'a mut [f64],
    mean: &'a mut [f64],
    covariance: &'a mut [f64],
}

impl NullaryFnOnce for SumMoments<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Particles { count, dimension, values } = self.particles;
        let value = |siblings: &Siblings, d: usize| f64::from(values[d * count + siblings.particle]);
        for (d, mean) in self.mean.iter_mut().enumerate() {
            *mean = self.siblings.iter().map(|siblings| siblings.share * value(siblings, d)).sum();
        }
        self.covariance.fill(0.0);
        for siblings in self.siblings {
            for (d, deviation) in self.deviation.iter_mut().enumerate() {
                *deviation = value(siblings, d) - self.mean[d];
            }
            for (column, sums) in self.covariance.chunks_exact_mut(*dimension).enumerate() {
                let scaled = siblings.share * self.deviation[column];
                for (sum, deviation) in sums[column..].iter_mut().zip(&self.deviation[column..]) {
                    *sum += scaled * deviation;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A random walk of one coordinate seen with noise: the Kalman filter is the exact answer.
    struct Walk {
        step_sd: f64,
        noise_sd: f64,
    }

    impl ParticleModel for Walk {
        type Observation = f64;

        fn propagate(&mut self, interval_s: f64, streams: &mut RandomStreams, particles: &mut Particles) {
            let mut noise = vec![0.0; particles.count()];
            streams.fill_normal(&mut noise);
            let sd = (self.step_sd * interval_s.sqrt()) as f32;
            for d in 0..particles.dimension() {
                for (value, noise) in particles.coordinate_mut(d).iter_mut().zip(&noise) {
                    *value += sd * noise / (d + 1) as f32;
                }
            }
        }

        fn log_likelihood(&mut self, observation: &f64, particles: &Particles, log_likelihood: &mut [f32]) {
            for (log, value) in log_likelihood.iter_mut().zip(particles.coordinate(0)) {
                *log = (-0.5 * ((observation - f64::from(*value)) / self.noise_sd).powi(2)) as f32;
            }
        }
    }

    fn run(count: usize, seed: u64) -> Vec<(f64, f64)> {
        let mut model = Walk { step_sd: 1.0, noise_sd: 0.5 };
        let mut filter = ParticleFilter::new(&[0.0], count, seed);
        let observed = |t: u32| (f64::from(t) * 0.3).sin() * 2.0;
        (0..40)
            .map(|t| {
                let moments = filter.step(&mut model, 1.0, Some(&observed(t)));
                (moments.mean[0], moments.covariance[(0, 0)])
            })
            .collect()
    }

    #[test]
    fn the_filter_agrees_with_the_kalman_filter_on_a_linear_model() {
        let (mut mean, mut variance) = (0.0, 0.0);
        for (t, (found, found_variance)) in run(8192, 5).into_iter().enumerate() {
            variance += 1.0;
            let gain = variance / (variance + 0.25);
            mean += gain * ((t as f64 * 0.3).sin() * 2.0 - mean);
            variance *= 1.0 - gain;
            // The posterior SD is 0.45; over 8192 particles its mean is known to about 0.01.
            assert!((found - mean).abs() < 0.04, "frame {t}: {found} instead of {mean}");
            assert!((found_variance / variance - 1.0).abs() < 0.2, "frame {t}: variance {found_variance}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
        assert_eq!(run(64, 1), run(64, 1));
        assert_ne!(run(64, 1), run(64, 2));
    }

    #[test]
    fn the_moments_are_those_of_the_particles_one_by_one() {
        let mut model = Walk { step_sd: 1.0, noise_sd: 0.5 };
        let mut filter = ParticleFilter::new(&[0.0, 3.0, -1.0], 256, 9);
        for observation in [Some(&0.3), Some(&-0.4), None] {
            filter.step(&mut model, 1.0, observation);
            let drawn = |d: usize| filter.particles.coordinate(d).iter().map(|v| f64::from(*v));
            let mean: Vec<f64> = (0..3).map(|d| drawn(d).sum::<f64>() / 256.0).collect();
            for a in 0..3 {
                assert!((filter.moments.mean[a] - mean[a]).abs() < 1e-12);
                for b in 0..3 {
                    let products = drawn(a).zip(drawn(b)).map(|(x, y)| (x - mean[a]) * (y - mean[b]));
                    assert!((filter.moments.covariance[(a, b)] - products.sum::<f64>() / 256.0).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn without_an_observation_the_particles_spread() {
        let mut model = Walk { step_sd: 1.0, noise_sd: 0.5 };
        let mut filter = ParticleFilter::new(&[0.0], 1024, 1);
        filter.step(&mut model, 1.0, Some(&0.0));
        let before = filter.moments.covariance[(0, 0)];
        let after = filter.step(&mut model, 4.0, None).covariance[(0, 0)];
        assert!(after > before + 3.0, "{before} became {after}");
    }
}
