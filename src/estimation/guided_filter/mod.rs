//! A particle filter that looks before it leaps, for a posture whose rates change at random.
//!
//! ```text
//! x'_i ~ q_i = multivariate Student-t around the mode of  p(x' | path_i) g(y | x') ψ(x', path_i)
//! w'_i ∝ w_i · p(x'_i | path_i) g(y | x'_i) ψ'_i / (ψ_i q_i(x'_i))
//! ```
//!
//! - **Proposal.** Each particle's step is linearised at its own predicted mode, by Gauss–Newton on prior times likelihood
//!   (Doucet, Godsill and Andrieu 2000). The Student-t tails are heavier than those of any likelihood times the normal
//!   prior, which bounds the weights. Where the system has no factor the particle is drawn from the prior.
//! - **Weights are exact**: the model's own likelihood over the density that was drawn from. The linearisation decides
//!   where particles go, never what they count.
//! - **Rates are not drawn.** Given a particle's path they are normal, with a mean of its own and a variance that all
//!   particles share, since it depends on times alone (Rao–Blackwell).
//! - **Looking ahead.** With a [`LookAhead`] ψ the particles stand for `p(x_t, y_1..t) ψ_t(x_t)`: every frame's estimate
//!   rests on the whole recording, its past by particles, its future by a linearised model. The last frame's is exact up to
//!   the number of particles. A filter that knows only the past is [`Instant`].
//!
//! Each pair of frame and particle has its own random numbers and sums run in the particles' order, so the bytes do not
//! depend on threads.

mod instant;
mod look_ahead;
mod proposal;
mod weights;

pub use instant::Instant;
pub use look_ahead::LookAhead;

use super::random::RandomStreams;
use super::rate_dynamics::RateStep;
use super::rate_smoother::{RateModel, RateSettings};
use super::resampling::{Resampler, Resampling};
use nalgebra::{SMatrix, SVector};
use proposal::Frame;
use rayon::prelude::*;
use weights::{effective_sample_size, normalize_log_weights};

/// A model whose likelihood can be asked for.
pub trait GuidedModel<const D: usize>: RateModel<D> {
    /// Log-likelihood of an observation at a posture, up to a constant of the observation. Its slope and curvature are
    /// about those of [`RateModel::information`]; the better they agree, the more particles count.
    fn log_likelihood(&self, observation: &Self::Observation, posture: &Self::Posture) -> f64;
}

/// How the filter runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuidedSettings {
    /// Number of particles.
    pub particles: usize,
    /// Seed of the random streams.
    pub seed: u64,
    /// Degrees of freedom of the proposal: few make tails that catch what the linearisation missed, many waste less.
    pub proposal_dof: usize,
    /// A Gauss–Newton step of which every component is below this is the last: the model is straight over such a step.
    pub straight_within: f64,
    /// How postures and rates start and decay; `iterations` bounds the Gauss–Newton steps.
    pub rates: RateSettings,
}

/// Share of the particles below which the effective sample size leads to resampling (Liu and Chen 1998).
const RESAMPLE_BELOW: f64 = 0.5;
/// Least variance of a step, squared step units: frames of one instant have distinct particles still.
const MIN_STEP_VARIANCE: f64 = 1e-12;

/// One path's end.
#[derive(Debug, Clone)]
struct Particle<P, const D: usize> {
    posture: P,
    /// Mean of the rate given the path.
    rate: SVector<f64, D>,
    log_weight: f64,
    /// `log ψ` that the weight contains.
    log_ahead: f64,
}

/// Covariance of posture and rate that all particles share, by coordinate. The posture's is 0 once it was drawn.
#[derive(Debug, Clone)]
struct Spread<const D: usize> {
    pp: SVector<f64, D>,
    pr: SVector<f64, D>,
    rr: SVector<f64, D>,
}

/// Estimate of one frame.
#[derive(Debug, Clone)]
pub struct GuidedFrame<P, const D: usize> {
    /// Mean posture.
    pub posture: P,
    /// Covariance of the posture's error.
    pub covariance: SMatrix<f64, D, D>,
    /// Effective sample size before resampling, particles.
    pub effective_sample_size: f64,
}

/// The filter's state between frames.
#[derive(Debug)]
pub struct GuidedFilter<P, const D: usize> {
    settings: GuidedSettings,
    particles: Vec<Particle<P, D>>,
    resampled: Vec<Particle<P, D>>,
    spread: Spread<D>,
    streams: RandomStreams,
    log_weights: Vec<f64>,
    weights: Vec<f64>,
    /// The weights as the resampler takes them.
    rounded: Vec<f32>,
    resampler: Resampler,
    errors: Vec<SVector<f64, D>>,
}

impl<P: Clone + Send + Sync, const D: usize> GuidedFilter<P, D> {
    /// A filter that starts around a posture at rest. At least one particle is made.
    pub fn new(initial: P, settings: GuidedSettings) -> Self {
        let count = settings.particles.max(1);
        let particle = Particle { posture: initial, rate: SVector::zeros(), log_weight: 0.0, log_ahead: 0.0 };
        let spread = Spread {
            pp: SVector::repeat(settings.rates.initial_sd.powi(2)),
            pr: SVector::zeros(),
            rr: SVector::repeat(settings.rates.initial_rate_sd.powi(2)),
        };
        Self {
            settings,
            particles: vec![particle; count],
            resampled: Vec::with_capacity(count),
            spread,
            streams: RandomStreams::new(settings.seed),
            log_weights: vec![0.0; count],
            weights: vec![1.0 / count as f64; count],
            rounded: vec![0.0; count],
            resampler: Resampler::new(Resampling::Systematic, count),
            errors: vec![SVector::zeros(); count],
        }
    }

    /// The next frame, the recording's `t`th, `interval_s` seconds after the last, with the look ahead along the whole
    /// recording.
    pub fn step<M>(
        &mut self,
        model: &M,
        t: usize,
        observation: &M::Observation,
        interval_s: f64,
        look_ahead: &LookAhead<P, D>,
    ) -> GuidedFrame<P, D>
    where
        M: GuidedModel<D, Posture = P, Observation: Sync> + Sync,
    {
        let step = RateStep::over(interval_s, self.settings.rates.rate_decay_s);
        self.spread.predict(&step, &model.acceleration_density());
        self.draw(model, t, observation, &step, look_ahead);
        self.weigh();
        let frame = self.moments(model);
        if frame.effective_sample_size < RESAMPLE_BELOW * self.particles.len() as f64 {
            self.streams.start_frame(self.stream(t, self.particles.len()));
            self.survive();
        }
        frame
    }

    /// Moves every particle by its proposal and multiplies its weight.
    fn draw<M>(
        &mut self,
        model: &M,
        t: usize,
        observation: &M::Observation,
        step: &RateStep,
        look_ahead: &LookAhead<P, D>,
    ) where
        M: GuidedModel<D, Posture = P, Observation: Sync> + Sync,
    {
        let variance = self.spread.pp.map(|v| v.max(MIN_STEP_VARIANCE));
        let gain = self.spread.pr.component_div(&variance);
        let rate_variance = (self.spread.rr - gain.component_mul(&self.spread.pr)).map(|v| v.max(0.0));
        let guide = look_ahead.guide(t, &rate_variance, &gain);
        let (step, precision) = (*step, variance.map(f64::recip));
        let frame = Frame { model, observation, step, precision, gain, guide, settings: &self.settings };
        let drawn = D + self.settings.proposal_dof;
        let (streams, first) = (&self.streams, self.stream(t, 0));
        self.particles.par_iter_mut().enumerate().with_min_len(4).for_each_init(
            || (streams.clone(), vec![0.0; drawn]),
            |(streams, normals), (i, particle)| {
                streams.start_frame(first + i as u64);
                streams.fill_normal(normals);
                frame.advance(particle, normals);
            },
        );
        self.spread = Spread { pp: SVector::zeros(), pr: SVector::zeros(), rr: rate_variance };
    }

    /// Number of the random stream of a particle in a frame; the number after the last particle's is the resampling's.
    fn stream(&self, t: usize, particle: usize) -> u64 {
        (t * (self.particles.len() + 1) + particle) as u64
    }

    /// Normalises the weights. When none is finite, all particles count equally.
    fn weigh(&mut self) {
        for (log_weight, particle) in self.log_weights.iter_mut().zip(&self.particles) {
            *log_weight = particle.log_weight;
        }
        normalize_log_weights(&self.log_weights, &mut self.weights);
        for (particle, weight) in self.particles.iter_mut().zip(&self.weights) {
            particle.log_weight = weight.ln();
        }
    }

    /// Replaces the particles by their offspring, all of one weight.
    fn survive(&mut self) {
        for (rounded, weight) in self.rounded.iter_mut().zip(&self.weights) {
            *rounded = *weight as f32;
        }
        self.resampler.draw(&self.rounded, &mut self.streams);
        self.resampled.clear();
        self.resampled.extend(self.resampler.ancestors().iter().map(|parent| self.particles[*parent as usize].clone()));
        std::mem::swap(&mut self.particles, &mut self.resampled);
        for particle in &mut self.particles {
            particle.log_weight = 0.0;
        }
        self.weights.fill(1.0 / self.particles.len() as f64);
    }

    /// Mean and covariance of the weighted particles.
    fn moments<M: RateModel<D, Posture = P>>(&mut self, model: &M) -> GuidedFrame<P, D> {
        let heaviest =
            (0..self.weights.len()).fold(0, |best, i| if self.weights[i] > self.weights[best] { i } else { best });
        let base = &self.particles[heaviest].posture;
        let mut mean = SVector::zeros();
        for ((error, particle), weight) in self.errors.iter_mut().zip(&self.particles).zip(&self.weights) {
            *error = model.step_between(base, &particle.posture);
            mean += *error * *weight;
        }
        let mut covariance = SMatrix::<f64, D, D>::zeros();
        for (error, weight) in self.errors.iter().zip(&self.weights) {
            let deviation = error - mean;
            covariance.ger(*weight, &deviation, &deviation, 1.0);
        }
        GuidedFrame {
            posture: model.moved(base, &mean),
            covariance,
            effective_sample_size: effective_sample_size(&self.weights),
        }
    }
}

impl<const D: usize> Spread<D> {
    fn predict(&mut self, step: &RateStep, density: &SVector<f64, D>) {
        let (a, b) = (step.reach, step.decay);
        for d in 0..D {
            let (pp, pr, rr, q) = (self.pp[d], self.pr[d], self.rr[d], density[d]);
            self.pp[d] = pp + 2.0 * a * pr + a * a * rr + q * step.to_posture;
            self.pr[d] = b * (pr + a * rr) + q * step.to_both;
            self.rr[d] = b * b * rr + q * step.to_rate;
        }
    }
}

#[cfg(test)]
mod tests;
