//! One attempt: stored bytes to an assessment.

use crate::assessment::{Assessment, Settings};
use crate::pipeline::{self, PipelineError};
use crate::progress::{Cancelled, Monitor, Step};
use crate::queue::JobError;
use crate::recording::DecodeError;
use crate::recording::decode::{Limits, decode};
use crate::storage::{StorageError, StoredRecording};
use std::io::{self, Read};

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
    limits: &Limits,
    monitor: &Monitor,
) -> Result<Assessment, AttemptError> {
    monitor.begin(Step::Decoding, recording.blob.size_bytes)?;
    let decoded = decode(Watched { reader, monitor }, recording.inspection.format, limits);
    // A reader that was stopped looks like one that failed.
    monitor.check()?;
    Ok(pipeline::assess(&decoded?, settings, monitor)?)
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
