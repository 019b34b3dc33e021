//! The unscented Kalman filter, the alternative that \[angles\] suggests: the model of the default method, its observation
//! seen through 39 postures in place of a derivative.

use super::iekf::run_seen_through;
use super::observation::{Frame, Observations};
use super::posterior::Summary;
use super::state_space::{RESIDUAL_DIMENSION, Residuals, StateSpace};
use crate::assessment::settings::Pass;
use crate::body::{POSE_DIMENSION, Pose};
use crate::estimation::unscented::{SigmaScaling, Unscented, UnscentedModel};
use crate::pipeline::PipelineError;
use crate::progress::Monitor;

/// Sigma points a tenth of the unscaled rule's √19 standard deviations away (van der Merwe recommends a small α), and β for a
/// normal distribution. Points farther out than a joint bends see an observation that has nothing to do with the posture:
/// with α = 0.4 and more a limb that was lost for a second drives its own uncertainty up until it is never found again.
pub const SCALING: SigmaScaling = SigmaScaling { alpha: 0.1, beta: 2.0, kappa: 0.0 };

impl UnscentedModel<POSE_DIMENSION, RESIDUAL_DIMENSION> for StateSpace {
    fn residuals(&self, frame: &Frame, pose: &Pose) -> Residuals {
        self.whitened_residuals(frame, pose)
    }

    fn weights(&self, squares: &Residuals) -> Residuals {
        self.row_weights(squares)
    }
}

/// Runs the method over a recording; `model` has no slacks. `emit` gets the frames in order.
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
    let unscented = Unscented::<_, RESIDUAL_DIMENSION>::new(model, SCALING);
    run_seen_through(&unscented, model, model.rate_settings(), observations, pass, monitor, emit)
}
