//! A particle filter on the model of the default method, whose particles go where the observation is: what remains of
//! \[angles\] when its particles no longer starve. Their weights are exact.
//!
//! The pass `smooth` runs the default method, looks back from the end along its path, then lets the particles go forwards
//! with that look ahead; a poor path costs particles, not truth. The pass `filter` draws the particles of each frame anew
//! from what the frames before it say, summed up as a normal distribution: kept paths of 38 dimensions lose themselves
//! without a look ahead (simulated sitting, white noise: 10° of mean error where 2° are reached, and 8192 instead of 96 of
//! them still leave 5°).

use super::iekf::{filtered, run_seen_through};
use super::observation::{Frame, Observations};
use super::posterior::Summary;
use super::state_space::StateSpace;
use crate::assessment::quality::EffectiveSampleSize;
use crate::assessment::settings::Pass;
use crate::body::{POSE_DIMENSION, Pose};
use crate::estimation::guided_filter::{GuidedFilter, GuidedModel, GuidedSettings, Instant, LookAhead};
use crate::estimation::rate_smoother::{RateFilter, RateSettings};
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};

/// Degrees of freedom of the proposal.
const PROPOSAL_DOF: usize = 29;
/// Rotation over which the model counts as straight, radians (3°): a segment of half a metre leaves its tangent by less than
/// a millimetre.
const STRAIGHT_WITHIN: f64 = 0.05;

impl GuidedModel<POSE_DIMENSION> for StateSpace {
    fn log_likelihood(&self, frame: &Frame, pose: &Pose) -> f64 {
        StateSpace::log_likelihood(self, frame, pose)
    }
}

/// How many particles, and which of their possible runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Number of particles.
    pub particles: u32,
    /// Seed of the random streams.
    pub seed: u64,
}

/// Runs the method over a recording; `model` has no slacks. `emit` gets the frames in order.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn run(
    observations: &Observations,
    model: &StateSpace,
    sampling: Sampling,
    pass: Pass,
    monitor: &Monitor,
    mut emit: impl FnMut(&Summary),
) -> Result<EffectiveSampleSize, PipelineError> {
    let rates = model.rate_settings();
    let settings = GuidedSettings {
        particles: sampling.particles as usize,
        seed: sampling.seed,
        proposal_dof: PROPOSAL_DOF,
        straight_within: STRAIGHT_WITHIN,
        rates,
    };
    if pass == Pass::Filter {
        // The particles find the mode themselves; each frame asks them once.
        let rates = RateSettings { iterations: 1, ..rates };
        let instant = Instant::new(model, settings);
        run_seen_through(&instant, model, rates, observations, pass, monitor, emit)?;
        return Ok(EffectiveSampleSize::of_frames(sampling.particles, instant.into_sizes()));
    }
    let frames: Vec<Frame> = (0..observations.len()).map(|t| observations.frame(t)).collect();
    let initial = model.initial_pose(observations);
    let look_ahead = look_ahead(model, initial.clone(), observations, &frames, monitor)?;
    monitor.begin(Step::Smoothing, frames.len() as u64)?;
    let mut filter = GuidedFilter::new(initial, settings);
    let mut sizes = Vec::with_capacity(frames.len());
    for (t, frame) in frames.iter().enumerate() {
        let found = filter.step(model, t, frame, frame.interval_s, &look_ahead);
        sizes.push(found.effective_sample_size);
        emit(&model.posterior(&frame.points, found.posture, &found.covariance).summarize());
        monitor.advance(1)?;
    }
    Ok(EffectiveSampleSize::of_frames(sampling.particles, sizes))
}

/// What later frames say, linearised along the path of the default method.
fn look_ahead(
    model: &StateSpace,
    initial: Pose,
    observations: &Observations,
    frames: &[Frame],
    monitor: &Monitor,
) -> Result<LookAhead<Pose, POSE_DIMENSION>, PipelineError> {
    let rates = model.rate_settings();
    let history = filtered(model, RateFilter::new(initial, rates), observations, monitor)?;
    let mut path = Vec::with_capacity(frames.len());
    history.smooth(model, |frame| path.push(frame.posture));
    path.reverse();
    Ok(LookAhead::along(model, &path, frames, |t| frames[t].interval_s, rates.rate_decay_s))
}
