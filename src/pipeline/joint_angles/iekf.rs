//! The default method: an iterated extended Kalman filter over posture and rates, and a backward pass over the whole
//! recording.

use super::calibration::Calibration;
use super::observation::Observations;
use super::posterior::Posterior;
use super::state_space::{StateSpace, Tuning};
use crate::assessment::settings::Pass;
use crate::body::Pose;
use crate::body::pose::POSE_DIMENSION;
use crate::estimation::rate_smoother::{RateFilter, RateModel};
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};

/// Runs the method over a recording; `emit` gets the frames in order.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn run(
    observations: &Observations,
    calibration: &Calibration,
    tuning: &Tuning,
    pass: Pass,
    monitor: &Monitor,
    emit: impl FnMut(&Posterior),
) -> Result<(), PipelineError> {
    let model = StateSpace::new(observations, calibration, tuning);
    run_seen_through(&model, &model, observations, tuning, pass, monitor, emit)
}

/// The passes of any Gaussian method: `seen` is the model as the method linearises it.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub(super) fn run_seen_through(
    seen: &impl RateModel<POSE_DIMENSION, Posture = Pose>,
    model: &StateSpace<'_>,
    observations: &Observations,
    tuning: &Tuning,
    pass: Pass,
    monitor: &Monitor,
    mut emit: impl FnMut(&Posterior),
) -> Result<(), PipelineError> {
    monitor.begin(Step::Estimating, observations.len() as u64)?;
    let mut filter = RateFilter::new(model.initial_pose(), tuning.rates);
    for t in 0..observations.len() {
        let frame = filter.step(seen, t, observations.interval_s(t));
        if pass == Pass::Filter {
            emit(&model.posterior(t, frame.posture, frame.covariance));
        }
        monitor.advance(1)?;
    }
    if pass == Pass::Filter {
        return Ok(());
    }
    monitor.begin(Step::Smoothing, observations.len() as u64)?;
    let mut frames = Vec::with_capacity(observations.len());
    filter.smooth(seen, |frame| frames.push((frame.posture, frame.covariance)));
    for (t, (pose, covariance)) in frames.into_iter().rev().enumerate() {
        emit(&model.posterior(t, pose, covariance));
        monitor.advance(1)?;
    }
    Ok(())
}
