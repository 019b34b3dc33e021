//! One attempt: stored bytes to an assessment, or to a noise model.

use crate::assessment::{Assessment, NoiseModel, NoiseModelSettings, Settings};
use crate::pipeline::joint_angles::training::{RecordingIdentity, Trainer};
use crate::pipeline::{self, Inputs, PipelineError, leg_pose};
use crate::progress::{Cancelled, Monitor, Step};
use crate::queue::JobError;
use crate::recording::decode::{DepthReader, Limits, decode};
use crate::recording::{DecodeError, Recording};
use crate::storage::{BlobReader, StorageError, StoredRecording};
use std::io::{self, BufReader, Read};

/// Why an attempt has no assessment.
#[derive(Debug, Clone, PartialEq)]
pub enum AttemptError {
    /// Somebody asked to stop.
    Cancelled,
    /// Another attempt would end in the same way; mostly it lies in the recording.
    Refused(JobError),
    /// It lies with the server: another attempt may succeed.
    Failed(JobError),
}

impl AttemptError {
    /// The computation panicked.
    pub(super) fn panicked() -> Self {
        Self::Failed(JobError::new(
            "internal_panic",
            "the computation stopped at a defect of the software; the operator finds the details in the log",
        ))
    }
}

impl From<Cancelled> for AttemptError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl From<DecodeError> for AttemptError {
    fn from(error: DecodeError) -> Self {
        let DecodeError { code, place, sentence } = error;
        // The only defect that is not of the bytes but of reading them.
        let of_the_server = code == "unreadable";
        let error = JobError { code: code.to_owned(), place, sentence };
        if of_the_server { Self::Failed(error) } else { Self::Refused(error) }
    }
}

impl From<PipelineError> for AttemptError {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Cancelled => Self::Cancelled,
            PipelineError::Defect(error) => error.into(),
            PipelineError::Unsuitable { code, place, sentence } => {
                Self::Refused(JobError { code: code.to_owned(), place, sentence })
            }
        }
    }
}

impl From<StorageError> for AttemptError {
    fn from(error: StorageError) -> Self {
        tracing::error!(%error, "the storage failed during an attempt");
        match error {
            StorageError::Corrupt(_) => Self::Refused(JobError::new(
                "result_not_storable",
                "the stored recording is damaged or its result contradicts itself; the operator finds the details in \
                 the log",
            )),
            _ => Self::Failed(JobError::new(
                "storage_failed",
                "the server could not read the recording or store the result; the operator finds the details in the log",
            )),
        }
    }
}

/// Decodes a stored recording and runs the pipeline that the settings name.
///
/// # Errors
/// See [`AttemptError`].
pub fn assess_recording(
    reader: impl Read,
    recording: &StoredRecording,
    settings: &Settings,
    inputs: &Inputs,
    limits: &Limits,
    monitor: &Monitor,
) -> Result<Assessment, AttemptError> {
    if let Settings::LegPose(settings) = settings {
        // Depth images are read while they are assessed: in memory there is never more than a few of them.
        let reader = DepthReader::open(BufReader::new(reader), limits)?;
        return Ok(leg_pose::assess(reader, settings, monitor)?);
    }
    let decoded = decode_stored(reader, recording, limits, monitor)?;
    Ok(pipeline::assess_with(&decoded, settings, inputs, monitor)?)
}

/// Stored recordings that a noise model is trained on, opened.
#[derive(Debug, Default)]
pub(super) struct TrainingRecordings {
    pub(super) still: Vec<(BlobReader, StoredRecording)>,
    pub(super) movement: Vec<(BlobReader, StoredRecording)>,
}

/// Decodes stored recordings, one after the other, and trains a noise model.
///
/// # Errors
/// See [`AttemptError`].
pub(super) fn train_noise_model(
    recordings: TrainingRecordings,
    settings: &NoiseModelSettings,
    limits: &Limits,
    monitor: &Monitor,
) -> Result<NoiseModel, AttemptError> {
    let identity = |stored: &StoredRecording| RecordingIdentity {
        name: stored.id.to_string(),
        sha256: stored.blob.sha256.clone(),
    };
    let mut trainer = Trainer::default();
    for (reader, stored) in recordings.still {
        let decoded = decode_stored(reader, &stored, limits, monitor)?;
        trainer.add_static(identity(&stored), &decoded, monitor)?;
    }
    for (reader, stored) in recordings.movement {
        let decoded = decode_stored(reader, &stored, limits, monitor)?;
        trainer.add_movement(identity(&stored), &decoded, monitor)?;
    }
    monitor.begin(Step::Summarizing, 0)?;
    Ok(trainer.finish(&settings.name, &settings.description)?)
}

fn decode_stored(
    reader: impl Read,
    recording: &StoredRecording,
    limits: &Limits,
    monitor: &Monitor,
) -> Result<Recording, AttemptError> {
    monitor.begin(Step::Decoding, recording.blob.size_bytes)?;
    let decoded = decode(Watched { reader, monitor }, recording.inspection.format, limits);
    // A reader that was stopped looks like one that failed.
    monitor.check()?;
    Ok(decoded?)
}

/// A reader that reports its progress and stops on request.
struct Watched<'a, R> {
    reader: R,
    monitor: &'a Monitor,
}

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.reader.read(buffer)?;
        self.monitor.advance(n as u64).map_err(io::Error::other)?;
        Ok(n)
    }
}
