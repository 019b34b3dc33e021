//! The default method: an iterated extended Kalman filter over posture and rates, and a backward pass over the whole
//! recording.

use super::calibration::Calibration;
use super::observation::Observations;
use super::posterior::Posterior;
use super::sensor_noise::SensorNoise;
use super::state_space::{StateSpace, Tuning};
use crate::assessment::settings::Pass;
use crate::estimation::rate_smoother::RateFilter;
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};

/// Runs the method over a recording; `emit` gets the frames in order.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn run(
    observations: &Observations,
    calibration: &Calibration,
    noise: &SensorNoise,
    tuning: &Tuning,
    pass: Pass,
    monitor: &Monitor,
    mut emit: impl FnMut(&Posterior),
) -> Result<(), PipelineError> {
    monitor.begin(Step::Estimating, observations.len() as u64)?;
    let model = StateSpace::new(observations, calibration, noise, tuning);
    let mut filter = RateFilter::new(model.initial_pose(), tuning.rates);
    for t in 0..observations.len() {
        let frame = filter.step(&model, t, observations.interval_s(t));
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
    filter.smooth(&model, |frame| frames.push((frame.posture, frame.covariance)));
    for (t, (pose, covariance)) in frames.into_iter().rev().enumerate() {
        emit(&model.posterior(t, pose, covariance));
        monitor.advance(1)?;
    }
    Ok(())
}
