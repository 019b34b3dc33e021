//! The default method: an iterated extended Kalman filter over posture and rates, and a backward pass over the whole
//! recording. Its passes are those of every method that stands on the same model.

use super::observation::{Frame, Observations};
use super::posterior::{Posterior, Summary};
use super::state_space::StateSpace;
use crate::assessment::settings::Pass;
use crate::body::kinematics::Points;
use crate::body::{POSE_DIMENSION, Pose};
use crate::estimation::rate_smoother::{RateFilter, RateHistory, RateModel, RateSettings};
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};

/// The state-space model as a method linearises it.
pub(super) trait SeenModel: RateModel<POSE_DIMENSION, Posture = Pose, Observation = Frame> {}

impl<M: RateModel<POSE_DIMENSION, Posture = Pose, Observation = Frame>> SeenModel for M {}

type PoseFilter = RateFilter<Pose, POSE_DIMENSION>;

/// The forward pass, frame by frame. Its size does not depend on the number of frames, and an estimate is there as soon
/// as its frame is: live use and the assessment of a recording run the same code.
#[derive(Debug, Clone)]
pub struct Tracker {
    model: StateSpace,
    filter: PoseFilter,
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
        step(&self.model, &self.model, &mut self.filter, &Frame { points: *points, interval_s })
    }
}

/// One frame of the forward pass.
fn step(seen: &impl SeenModel, model: &StateSpace, filter: &mut PoseFilter, frame: &Frame) -> Posterior {
    let estimate = filter.step(seen, frame, frame.interval_s);
    model.posterior(&frame.points, estimate.posture, &estimate.covariance)
}

/// Runs the method over a recording; `emit` gets the frames in order.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn run(
    observations: &Observations,
    model: &StateSpace,
    pass: Pass,
    monitor: &Monitor,
    emit: impl FnMut(&Summary),
) -> Result<(), PipelineError> {
    run_seen_through(model, model, model.rate_settings(), observations, pass, monitor, emit)
}

/// The passes of any Gaussian method: `seen` is the model as the method linearises it, `rates` are the settings of its
/// filter.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub(super) fn run_seen_through(
    seen: &impl SeenModel,
    model: &StateSpace,
    rates: RateSettings,
    observations: &Observations,
    pass: Pass,
    monitor: &Monitor,
    mut emit: impl FnMut(&Summary),
) -> Result<(), PipelineError> {
    let n = observations.len();
    let mut filter = RateFilter::new(model.initial_pose(observations), rates);
    if pass == Pass::Filter {
        monitor.begin(Step::Estimating, n as u64)?;
        for t in 0..n {
            emit(&step(seen, model, &mut filter, &observations.frame(t)).summarize());
            monitor.advance(1)?;
        }
        return Ok(());
    }
    let history = filtered(seen, filter, observations, monitor)?;
    monitor.begin(Step::Smoothing, n as u64)?;
    // A summary is a tenth of a posterior, and the history shrinks while they are made.
    let mut summaries = Vec::with_capacity(n);
    history.smooth(seen, |frame| {
        let points = &observations.points[n - 1 - summaries.len()];
        summaries.push(model.posterior(points, frame.posture, &frame.covariance).summarize());
    });
    for summary in summaries.iter().rev() {
        emit(summary);
        monitor.advance(1)?;
    }
    Ok(())
}

/// The forward pass over a whole recording, for a backward pass to follow.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub(super) fn filtered(
    seen: &impl SeenModel,
    mut filter: PoseFilter,
    observations: &Observations,
    monitor: &Monitor,
) -> Result<RateHistory<Pose, POSE_DIMENSION>, PipelineError> {
    monitor.begin(Step::Estimating, observations.len() as u64)?;
    let mut history = RateHistory::with_capacity(observations.len());
    for t in 0..observations.len() {
        let frame = observations.frame(t);
        filter.step(seen, &frame, frame.interval_s);
        history.push(&filter);
        monitor.advance(1)?;
    }
    Ok(history)
}
