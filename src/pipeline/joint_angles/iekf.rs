//! The default method: an iterated extended Kalman filter over posture and rates, and a backward pass over the whole
//! recording.

use super::observation::Observations;
use super::posterior::{Posterior, Summary};
use super::state_space::StateSpace;
use crate::assessment::settings::Pass;
use crate::body::kinematics::Points;
use crate::body::{POSE_DIMENSION, Pose};
use crate::estimation::rate_smoother::{RateFilter, RateHistory};
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};

/// The forward pass, frame by frame. Its size does not depend on the number of frames, and an estimate is there as soon
/// as its frame is: live use and the assessment of a recording run the same code.
#[derive(Debug, Clone)]
pub struct Tracker {
    model: StateSpace,
    filter: RateFilter<Pose, POSE_DIMENSION>,
}

impl Tracker {
    /// A tracker that starts around a posture at rest.
    pub fn new(model: StateSpace, initial: Pose) -> Self {
        let filter = RateFilter::new(initial, model.rate_settings());
        Self { model, filter }
    }

    /// The next frame: its points relative to the torso joint in `subject`, metres, NaN where not seen, `interval_s`
    /// seconds after the frame before (0 for the first).
    pub fn push(&mut self, points: &Points, interval_s: f64) -> Posterior {
        let estimate = self.filter.step(&self.model, points, interval_s);
        self.model.posterior(points, estimate.posture, &estimate.covariance)
    }
}

/// Runs the method over a recording; `emit` gets the frames in order.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn run(
    observations: &Observations,
    model: StateSpace,
    pass: Pass,
    monitor: &Monitor,
    mut emit: impl FnMut(&Summary),
) -> Result<(), PipelineError> {
    let n = observations.len();
    monitor.begin(Step::Estimating, n as u64)?;
    let initial = model.initial_pose(observations);
    let mut tracker = Tracker::new(model, initial);
    if pass == Pass::Filter {
        for (t, points) in observations.points.iter().enumerate() {
            emit(&tracker.push(points, observations.interval_s(t)).summarize());
            monitor.advance(1)?;
        }
        return Ok(());
    }
    let Tracker { model, mut filter } = tracker;
    let mut history = RateHistory::with_capacity(n);
    for (t, points) in observations.points.iter().enumerate() {
        filter.step(&model, points, observations.interval_s(t));
        history.push(&filter);
        monitor.advance(1)?;
    }
    monitor.begin(Step::Smoothing, n as u64)?;
    // A summary is a tenth of a posterior, and the history shrinks while they are made.
    let mut summaries = Vec::with_capacity(n);
    history.smooth(&model, |frame| {
        let points = &observations.points[n - 1 - summaries.len()];
        summaries.push(model.posterior(points, frame.posture, &frame.covariance).summarize());
    });
    for summary in summaries.iter().rev() {
        emit(summary);
        monitor.advance(1)?;
    }
    Ok(())
}
