//! One particle's step: where it should go, where it goes, and what it then counts.

use super::look_ahead::Guide;
use super::{GuidedModel, GuidedSettings, Particle};
use crate::estimation::rate_dynamics::RateStep;
use nalgebra::{SMatrix, SVector};

/// What all particles of a frame share.
pub(super) struct Frame<'a, M: GuidedModel<D>, const D: usize> {
    pub(super) model: &'a M,
    pub(super) observation: &'a M::Observation,
    pub(super) step: RateStep,
    /// Inverse variance of the prior's step, by coordinate.
    pub(super) precision: SVector<f64, D>,
    /// How a step of the posture moves the rate's mean, by coordinate.
    pub(super) gain: SVector<f64, D>,
    pub(super) guide: Option<Guide<'a, M::Posture, D>>,
    pub(super) settings: &'a GuidedSettings,
}

/// A multivariate Student-t distribution of steps: its mean, and the factor of its precision.
pub(super) struct Proposal<const D: usize> {
    pub(super) mean: SVector<f64, D>,
    factor: SMatrix<f64, D, D>,
}

impl<M: GuidedModel<D>, const D: usize> Frame<'_, M, D> {
    /// Moves a particle with the given standard normal numbers, at least `D` and the proposal's degrees of freedom.
    pub(super) fn advance(&self, particle: &mut Particle<M::Posture, D>, normals: &[f32]) {
        let predicted = self.model.moved(&particle.posture, &(particle.rate * self.step.reach));
        let rate = particle.rate * self.step.decay;
        let proposal = self.proposal(&predicted, &rate);
        let (step, log_proposal) = proposal.draw(normals, self.settings.proposal_dof);
        particle.posture = self.model.moved(&predicted, &step);
        particle.rate = rate + self.gain.component_mul(&step);
        let log_prior = -0.5 * step.component_mul(&step).dot(&self.precision);
        let log_likelihood = self.model.log_likelihood(self.observation, &particle.posture);
        let log_ahead = self.guide.as_ref().map_or(0.0, |guide| {
            guide.value(&self.model.step_between(guide.reference, &particle.posture), &particle.rate)
        });
        let log_weight =
            particle.log_weight + log_prior + log_likelihood + log_ahead - particle.log_ahead - log_proposal;
        // What is no number counts as impossible.
        particle.log_weight = if log_weight.is_nan() { f64::NEG_INFINITY } else { log_weight };
        particle.log_ahead = log_ahead;
    }

    /// Gauss–Newton to the mode of prior times likelihood times look ahead, in steps from the prediction.
    fn proposal(&self, predicted: &M::Posture, rate: &SVector<f64, D>) -> Proposal<D> {
        let found = Proposal::at_mode(self.settings, |mean| {
            let posture = self.model.moved(predicted, mean);
            let (mut system, gradient) = self.model.information(self.observation, &posture);
            let mut slope = gradient - self.precision.component_mul(mean);
            for d in 0..D {
                system[(d, d)] += self.precision[d];
            }
            if let Some(guide) = &self.guide {
                let error = self.model.step_between(guide.reference, &posture);
                let rate = rate + self.gain.component_mul(mean);
                slope += guide.gradient(&error, &rate, &self.gain);
                system += guide.curvature;
            }
            (system, slope)
        });
        let prior = || SMatrix::from_diagonal(&self.precision.map(f64::sqrt));
        found.unwrap_or_else(|| Proposal { mean: SVector::zeros(), factor: prior() })
    }
}

impl<const D: usize> Proposal<D> {
    /// Gauss–Newton from a step of zero; `linearized` gives the negative second derivative of the logarithm of the density at
    /// a step, and its slope. `None` where it has no factor.
    pub(super) fn at_mode(
        settings: &GuidedSettings,
        linearized: impl Fn(&SVector<f64, D>) -> (SMatrix<f64, D, D>, SVector<f64, D>),
    ) -> Option<Self> {
        let mut mean = SVector::zeros();
        let mut found = None;
        for _ in 0..settings.rates.iterations.max(1) {
            let (system, slope) = linearized(&mean);
            let Some(factor) = system.cholesky() else { break };
            let change = factor.solve(&slope);
            if !change.iter().all(|c| c.is_finite()) {
                break;
            }
            mean += change;
            found = Some(Self { mean, factor: factor.unpack_dirty() });
            if change.amax() < settings.straight_within {
                break;
            }
        }
        found
    }

    /// A draw and the logarithm of its density, up to a constant that all proposals share.
    ///
    /// `mean + L⁻ᵀ z √(ν/u)` with `z` from the first `D` numbers and `u`, a χ² of ν degrees, from the squares of the next ν.
    pub(super) fn draw(&self, normals: &[f32], dof: usize) -> (SVector<f64, D>, f64) {
        let z = SVector::<f64, D>::from_fn(|d, _| f64::from(normals[d]));
        let chi_squared: f64 = normals[D..D + dof].iter().map(|n| f64::from(*n).powi(2)).sum();
        let dof = dof as f64;
        let stretch = (dof / chi_squared.max(f64::MIN_POSITIVE)).sqrt();
        let distance = z.norm_squared() * stretch * stretch;
        // L has a positive diagonal, so the system has a solution.
        let direction = self.factor.tr_solve_lower_triangular(&z).unwrap_or_else(SVector::zeros);
        let log_determinant: f64 = (0..D).map(|d| self.factor[(d, d)].ln()).sum();
        let log_density = log_determinant - 0.5 * (dof + D as f64) * (distance / dof).ln_1p();
        (self.mean + direction * stretch, log_density)
    }
}
