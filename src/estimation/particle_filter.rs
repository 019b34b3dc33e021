//! The particle filter: propagate by the prior, weight by the likelihood, resample (\[angles\] Eqs. 2 and 3).
//!
//! The driver knows no body; a [`ParticleModel`] knows no driver. Particles are stored by coordinate, so that a model
//! handles many of them with one instruction.

use super::random::RandomStreams;
use super::resampling::{Resampling, resample};
use super::weights::{effective_sample_size, normalize_log_weights};
use crate::geometry::lanes::LANES;
use nalgebra::{DMatrix, DVector};

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
}

/// A state-space model in the form that the particle filter needs.
pub trait ParticleModel {
    /// One observation.
    type Observation: ?Sized;

    /// Draws each particle's next state from the prior f(θt | θt−1), `interval_s` seconds later.
    fn propagate(&mut self, interval_s: f64, streams: &mut RandomStreams, particles: &mut Particles);

    /// Log-likelihood log g(y | θ) of each particle, up to a constant that all share.
    fn log_likelihood(&mut self, observation: &Self::Observation, particles: &Particles, log_likelihood: &mut [f64]);
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

/// The filter's state between frames.
#[derive(Debug, Clone)]
pub struct ParticleFilter {
    particles: Particles,
    resampled: Particles,
    streams: RandomStreams,
    frame: u64,
    log_weights: Vec<f64>,
    weights: Vec<f64>,
    offspring: Vec<u32>,
    deviation: Vec<f64>,
    moments: Moments,
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
            offspring: vec![0; count],
            deviation: vec![0.0; dimension],
            moments: Moments {
                mean: DVector::from_row_slice(initial),
                covariance: DMatrix::zeros(dimension, dimension),
                effective_sample_size: count as f64,
            },
        }
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
                resample(Resampling::Multinomial, &self.weights, &mut self.streams, &mut self.offspring);
                self.survive();
            }
            None => {
                self.moments.effective_sample_size = self.particles.count as f64;
                self.offspring.fill(1);
            }
        }
        self.update_moments();
        &self.moments
    }

    /// Replaces the particles by their offspring.
    fn survive(&mut self) {
        let count = self.particles.count;
        for d in 0..self.particles.dimension {
            let parents = self.particles.coordinate(d);
            let children = self.resampled.coordinate_mut(d);
            let mut child = 0;
            for (parent, &n) in parents.iter().zip(&self.offspring) {
                children[child..child + n as usize].fill(*parent);
                child += n as usize;
            }
            debug_assert_eq!(child, count, "offspring sum to the number of particles");
        }
        // `offspring` still refers to the parents, which `update_moments` reads.
        std::mem::swap(&mut self.particles, &mut self.resampled);
    }

    /// Mean and covariance of the particles. Equal neighbours (siblings after resampling) are counted once with their
    /// number, which costs little when few parents survive.
    fn update_moments(&mut self) {
        let particles = &self.particles;
        let n = particles.count as f64;
        let (mean, covariance) = (&mut self.moments.mean, &mut self.moments.covariance);
        let siblings = || {
            let mut next = 0;
            self.offspring.iter().filter(|k| **k > 0).map(move |k| {
                let first = next;
                next += *k as usize;
                (first, f64::from(*k) / n)
            })
        };
        mean.fill(0.0);
        for (i, share) in siblings() {
            for d in 0..particles.dimension {
                mean[d] += share * f64::from(particles.values[d * particles.count + i]);
            }
        }
        covariance.fill(0.0);
        let deviation = &mut self.deviation;
        for (i, share) in siblings() {
            for d in 0..particles.dimension {
                deviation[d] = f64::from(particles.values[d * particles.count + i]) - mean[d];
            }
            for column in 0..particles.dimension {
                let scaled = share * deviation[column];
                for row in column..particles.dimension {
                    covariance[(row, column)] += scaled * deviation[row];
                }
            }
        }
        covariance.fill_upper_triangle_with_lower_triangle();
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
            for (value, noise) in particles.coordinate_mut(0).iter_mut().zip(noise) {
                *value += sd * noise;
            }
        }

        fn log_likelihood(&mut self, observation: &f64, particles: &Particles, log_likelihood: &mut [f64]) {
            for (log, value) in log_likelihood.iter_mut().zip(particles.coordinate(0)) {
                *log = -0.5 * ((observation - f64::from(*value)) / self.noise_sd).powi(2);
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
    fn without_an_observation_the_particles_spread() {
        let mut model = Walk { step_sd: 1.0, noise_sd: 0.5 };
        let mut filter = ParticleFilter::new(&[0.0], 1024, 1);
        filter.step(&mut model, 1.0, Some(&0.0));
        let before = filter.moments.covariance[(0, 0)];
        let after = filter.step(&mut model, 4.0, None).covariance[(0, 0)];
        assert!(after > before + 3.0, "{before} became {after}");
    }
}
