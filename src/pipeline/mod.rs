//! From a recording to an assessment: pure computation, no clock, no storage, no HTTP.

pub mod joint_angles;
pub mod leg_pose;
pub mod skeleton_fusion;

use crate::assessment::quality::CalibrationQuality;
use crate::assessment::{Assessment, JointTrack, NoiseModel, Settings};
use crate::progress::{Cancelled, Monitor};
use crate::recording::{DecodeError, Recording};
use uuid::Uuid;

/// Why a recording has no assessment.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// Somebody asked to stop.
    #[error("the work was cancelled")]
    Cancelled,
    /// The recording was read while it was assessed, and has a defect.
    #[error(transparent)]
    Defect(#[from] DecodeError),
    /// The recording cannot be assessed by this pipeline.
    #[error("{sentence}")]
    Unsuitable {
        /// Stable, documented code, for example `handedness_mismatch`.
        code: &'static str,
        /// Where in the recording, for example `frames[17]`.
        place: Option<String>,
        /// One sentence for a person that also says what to record differently.
        sentence: String,
    },
}

impl PipelineError {
    /// A recording that cannot be assessed.
    pub fn unsuitable(code: &'static str, sentence: impl Into<String>) -> Self {
        Self::Unsuitable { code, place: None, sentence: sentence.into() }
    }
}

impl From<Cancelled> for PipelineError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

/// What a pipeline needs beside the recording and that settings only name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inputs {
    /// The noise model that the settings name. Shipped models need not be given.
    pub noise_model: Option<NoiseModel>,
    /// The calibration of another recording of the same patient; used when the settings ask for it.
    pub patient_calibration: Option<PatientCalibration>,
}

/// How the body was measured in another recording of the same patient.
#[derive(Debug, Clone, PartialEq)]
pub struct PatientCalibration {
    /// The assessment that it is of.
    pub assessment_id: Uuid,
    /// Lengths and offsets with their uncertainty.
    pub quality: CalibrationQuality,
}

/// Runs the pipeline that the settings name, on what comes with the software. The recording's digest is added to the
/// provenance by the caller.
///
/// # Errors
/// See [`assess_with`].
pub fn assess(recording: &Recording, settings: &Settings, monitor: &Monitor) -> Result<Assessment, PipelineError> {
    assess_with(recording, settings, &Inputs::default(), monitor)
}

/// Runs the pipeline that the settings name, with what they refer to beside them.
///
/// # Errors
/// [`PipelineError::Unsuitable`] says what the recording lacks, or which input is missing;
/// [`PipelineError::Cancelled`] when the monitor was asked to stop.
pub fn assess_with(
    recording: &Recording,
    settings: &Settings,
    inputs: &Inputs,
    monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    let assessment = match settings {
        Settings::JointAngles(settings) => joint_angles::assess_with(recording, settings, inputs, monitor),
        Settings::SkeletonFusion(settings) => skeleton_fusion::assess(recording, settings, monitor),
        Settings::LegPose(_) => Err(PipelineError::unsuitable(
            "no_depth_images",
            "legs are tracked in depth images, and this recording was read without them",
        )),
        Settings::NoiseModel(_) => Err(PipelineError::unsuitable(
            "not_an_assessment",
            "a noise model is trained from several recordings; one recording alone is assessed by joint_angles",
        )),
    }?;
    // Places that were estimated survive what the camera did not see.
    let estimated = JointTrack::of_series(&assessment.time_ns, &assessment.series, [1.0; 3]);
    let seen = || recording.skeleton.as_ref().map(JointTrack::of_skeleton);
    Ok(Assessment { joints: estimated.or_else(seen), ..assessment })
}
