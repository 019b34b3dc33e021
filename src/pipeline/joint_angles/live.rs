//! Joint angles while they happen: one frame in, one estimate out, for feedback during an exercise.
//!
//! It is the forward pass of the default method (`pass: filter` of an assessment). The subject's segments, facing
//! direction and the sensor's noise are learned from a short recording beforehand; memory does not grow.

use super::calibration::calibrate;
use super::iekf::Tracker;
use super::observation::{Observations, PointColumns};
use super::sensor_noise::SensorNoise;
use super::series_builder::{AngleReader, CHANNEL_COUNT, FrameRepairs, Reading};
use super::state_space::{StateSpace, Tuning};
use crate::assessment::JointAngleSettings;
use crate::pipeline::PipelineError;
use crate::recording::SkeletonRecording;
use nalgebra::{Rotation3, Vector3};

/// Estimates joint angles frame by frame, without delay.
#[derive(Debug, Clone)]
pub struct LiveJointAngles {
    tracker: Tracker,
    reader: AngleReader,
    columns: PointColumns,
    subject_from_world: Rotation3<f64>,
    n_joints: usize,
    min_confidence: f32,
    last_ns: Option<i64>,
}

/// A frame that cannot be taken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LiveError {
    /// The frame is not later than the one before it.
    #[error("the frame's time {time_ns} ns is not after that of the frame before, {last_ns} ns")]
    NotLater {
        /// Time of the frame.
        time_ns: i64,
        /// Time of the frame before.
        last_ns: i64,
    },
    /// Positions or confidences do not match the sensor's joints.
    #[error("the frame has {positions} positions and {confidences} confidences for {joints} joints")]
    WrongLength {
        /// Positions in the frame.
        positions: usize,
        /// Confidences in the frame.
        confidences: usize,
        /// Joints of the sensor.
        joints: usize,
    },
}

impl LiveJointAngles {
    /// An estimator for the subject and sensor of a recording: some seconds in which the whole body is seen, best at
    /// rest with straight legs.
    ///
    /// # Errors
    /// Those of an assessment of the recording (`joints_missing`, `too_few_frames`, ...).
    pub fn calibrated(recording: &SkeletonRecording, settings: &JointAngleSettings) -> Result<Self, PipelineError> {
        let mut observations = Observations::from_recording(recording, settings)?;
        let calibration = calibrate(&mut observations)?;
        let model = StateSpace::new(&calibration.skeleton, &SensorNoise::adaptive(&observations), &Tuning::default());
        let initial = model.initial_pose(&observations);
        Ok(Self {
            tracker: Tracker::new(model, initial),
            reader: AngleReader::default(),
            columns: PointColumns::of(&recording.joints)?,
            subject_from_world: observations.subject_from_world,
            n_joints: recording.joints.len(),
            min_confidence: settings.min_confidence,
            last_ns: None,
        })
    }

    /// Estimate of the next frame: positions of the sensor's joints in `world`, metres, and the sensor's confidence in
    /// each, in the order of the recording it was calibrated on. Channels come in the order of `AngleChannel::all`.
    ///
    /// # Errors
    /// [`LiveError`]; the frame is then as if it had not come.
    pub fn push(
        &mut self,
        time_ns: i64,
        positions: &[Vector3<f64>],
        confidence: &[f32],
    ) -> Result<[Reading; CHANNEL_COUNT], LiveError> {
        if positions.len() != self.n_joints || confidence.len() != self.n_joints {
            let (positions, confidences) = (positions.len(), confidence.len());
            return Err(LiveError::WrongLength { positions, confidences, joints: self.n_joints });
        }
        let interval_s = match self.last_ns {
            Some(last_ns) if time_ns <= last_ns => return Err(LiveError::NotLater { time_ns, last_ns }),
            Some(last_ns) => time_ns.saturating_sub(last_ns) as f64 * 1e-9,
            None => 0.0,
        };
        self.last_ns = Some(time_ns);
        let points = self.columns.points(positions, confidence, self.min_confidence);
        let posterior = self.tracker.push(&points.map(|point| self.subject_from_world * point), interval_s);
        Ok(self.reader.read(&posterior.summarize(), FrameRepairs::default()))
    }
}
