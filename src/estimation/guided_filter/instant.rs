//! Particles that last one frame: the Gaussian particle filter (Kotecha and Djurić 2003).
//!
//! What is known before a frame is taken as normal, over posture and rate; particles are drawn around the mode of prior
//! times likelihood, in pairs on either side of it, and their exact weights give the mean posture. Paths of particles are
//! not kept: one frame hardly shows a rate, so without a look ahead the paths' rates run wild before a frame can choose
//! among them.

use super::proposal::Proposal;
use super::weights::{effective_sample_size, normalize_log_weights};
use super::{GuidedModel, GuidedSettings};
use crate::estimation::random::RandomStreams;
use crate::estimation::rate_smoother::RateModel;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;
use std::cell::{Cell, RefCell};

/// Share of the particles that must count for their mean to replace the mode.
const MEAN_FROM: f64 = 0.5;

/// A model whose observations are weighed by particles. A [`RateFilter`](crate::estimation::rate_smoother::RateFilter) with
/// one iteration over it is the Gaussian particle filter.
#[derive(Debug)]
pub struct Instant<'a, Model> {
    model: &'a Model,
    settings: GuidedSettings,
    streams: RandomStreams,
    /// Frames so far, which number the random streams.
    n_frames: Cell<usize>,
    sizes: RefCell<Vec<f64>>,
}

impl<'a, Model> Instant<'a, Model> {
    /// The model seen through particles.
    pub fn new(model: &'a Model, settings: GuidedSettings) -> Self {
        let streams = RandomStreams::new(settings.seed);
        Self { model, settings, streams, n_frames: Cell::new(0), sizes: RefCell::default() }
    }

    /// Effective sample size of every frame so far.
    pub fn into_sizes(self) -> Vec<f64> {
        self.sizes.into_inner()
    }

    /// Weighted mean step from the predicted posture, or the step to the mode when the particles starve.
    fn mean_step<const D: usize>(
        &self,
        t: usize,
        observation: &Model::Observation,
        predicted: &Model::Posture,
        precision: &SMatrix<f64, D, D>,
    ) -> Option<SVector<f64, D>>
    where
        Model: GuidedModel<D> + Sync,
        Model::Posture: Sync,
        Model::Observation: Sync,
    {
        let proposal = Proposal::at_mode(&self.settings, |step: &SVector<f64, D>| {
            let (information, gradient) = self.model.information(observation, &self.model.moved(predicted, step));
            (information + precision, gradient - precision * step)
        })?;
        let (pairs, dof) = (self.settings.particles.div_ceil(2), self.settings.proposal_dof);
        let (model, streams) = (self.model, &self.streams);
        let weigh = |step: &SVector<f64, D>, log_proposal: f64| {
            let log_likelihood = model.log_likelihood(observation, &model.moved(predicted, step));
            let log_weight = log_likelihood - 0.5 * step.dot(&(precision * step)) - log_proposal;
            if log_weight.is_nan() { f64::NEG_INFINITY } else { log_weight }
        };
        let mut drawn = vec![(SVector::<f64, D>::zeros(), [0.0; 2]); pairs];
        drawn.par_iter_mut().enumerate().with_min_len(16).for_each_init(
            || (streams.clone(), vec![0.0; D + dof]),
            |(streams, normals), (i, (step, log_weights))| {
                streams.start_frame((t * pairs + i) as u64);
                streams.fill_normal(normals);
                let log_proposal;
                (*step, log_proposal) = proposal.draw(normals, dof);
                // The proposal is symmetric: the point on the mode's other side has the same density.
                let opposite = proposal.mean * 2.0 - *step;
                *log_weights = [weigh(step, log_proposal), weigh(&opposite, log_proposal)];
            },
        );
        let log_weights: Vec<f64> = drawn.iter().flat_map(|(_, logs)| *logs).collect();
        let mut weights = vec![0.0; log_weights.len()];
        normalize_log_weights(&log_weights, &mut weights);
        let size = effective_sample_size(&weights);
        self.sizes.borrow_mut().push(size);
        // Few particles that count mean several modes or tails that the draws miss: a normal distribution around their mean
        // would lie between the modes, so the found mode stands.
        if size < MEAN_FROM * weights.len() as f64 {
            return Some(proposal.mean);
        }
        let mut mean = SVector::zeros();
        for ((step, _), weights) in drawn.iter().zip(weights.chunks_exact(2)) {
            mean += *step * weights[0] + (proposal.mean * 2.0 - step) * weights[1];
        }
        Some(mean)
    }
}

impl<const D: usize, Model> RateModel<D> for Instant<'_, Model>
where
    Model: GuidedModel<D> + Sync,
    Model::Posture: Sync,
    Model::Observation: Sync,
{
    type Posture = Model::Posture;
    type Observation = Model::Observation;

    fn moved(&self, posture: &Self::Posture, step: &SVector<f64, D>) -> Self::Posture {
        self.model.moved(posture, step)
    }

    fn step_between(&self, from: &Self::Posture, to: &Self::Posture) -> SVector<f64, D> {
        self.model.step_between(from, to)
    }

    fn information(
        &self,
        observation: &Self::Observation,
        posture: &Self::Posture,
    ) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
        self.model.information(observation, posture)
    }

    /// Information at the particles' mean, and the gradient that leads there. Where the covariance or the system has no
    /// factor, those of the posture itself.
    fn information_around(
        &self,
        observation: &Self::Observation,
        posture: &Self::Posture,
        covariance: impl Fn() -> SMatrix<f64, D, D>,
    ) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
        let t = self.n_frames.replace(self.n_frames.get() + 1);
        let precision = covariance().cholesky().map(|factor| factor.inverse());
        let found =
            precision.and_then(|precision| Some((precision, self.mean_step(t, observation, posture, &precision)?)));
        let Some((precision, mean)) = found else {
            return self.model.information(observation, posture);
        };
        let (information, _) = self.model.information(observation, &self.model.moved(posture, &mean));
        (information, (precision + information) * mean)
    }

    fn acceleration_density(&self) -> SVector<f64, D> {
        self.model.acceleration_density()
    }
}
