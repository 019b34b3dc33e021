//! Jobs: the work on one recording, or on several that make a noise model, as the queue sees it.

use crate::assessment::Settings;
use crate::progress::{Progress, Step};
use crate::storage::database::Row;
use crate::storage::{AssessmentId, JobId, NoiseModelId, RecordingId, SessionId, StorageError, row};
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::ToSchema;

/// What a worker must understand to do a job. Raised when settings begin to say what workers of the version before cannot read:
/// those leave such jobs to newer ones while a service is upgraded.
pub(super) const JOB_FORMAT: u32 = 1;

/// Where a job is in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waiting for a worker, or for the end of a back-off.
    Queued,
    /// A worker holds it.
    Running,
    /// Its result is stored.
    Done,
    /// Given up; its error says why.
    Failed,
    /// Somebody asked to stop it.
    Cancelled,
}

impl JobState {
    /// Every state, in the order of a job's life.
    pub const ALL: [JobState; 5] =
        [JobState::Queued, JobState::Running, JobState::Done, JobState::Failed, JobState::Cancelled];

    /// The word in the database and at the API.
    pub fn name(self) -> &'static str {
        match self {
            JobState::Queued => "queued",
            JobState::Running => "running",
            JobState::Done => "done",
            JobState::Failed => "failed",
            JobState::Cancelled => "cancelled",
        }
    }

    /// True when nothing more will happen.
    pub fn is_over(self) -> bool {
        matches!(self, JobState::Done | JobState::Failed | JobState::Cancelled)
    }
}

/// Why an attempt failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct JobError {
    /// Stable code, for example `no_skeleton`.
    pub code: String,
    /// Where in the recording, for example `frames[17].time_ns`.
    #[serde(default)]
    pub place: Option<String>,
    /// One sentence for a person.
    pub sentence: String,
}

impl JobError {
    /// An error without a place.
    pub fn new(code: &str, sentence: impl Into<String>) -> Self {
        Self { code: code.to_owned(), place: None, sentence: sentence.into() }
    }
}

/// A job's row.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// Identity.
    pub id: JobId,
    /// The recording to assess; of a training the first static one.
    pub recording_id: RecordingId,
    /// The recording's session.
    pub session_id: SessionId,
    /// Where it is in its life.
    pub state: JobState,
    /// How often it was begun.
    pub attempt: u32,
    /// How often it may be begun.
    pub max_attempts: u32,
    /// When a worker may take it: the end of a back-off, or of the lease while it runs; `None` once it is over.
    pub due_at: Option<OffsetDateTime>,
    /// The worker that holds or held it.
    pub worker: Option<String>,
    /// Whether somebody asked to stop it.
    pub cancel_requested: bool,
    /// How many waiting jobs have their turn before it; `None` unless it waits and was asked for by itself.
    pub n_ahead: Option<u64>,
    /// How far the latest attempt is.
    pub progress: Progress,
    /// What is to be computed.
    pub settings: Settings,
    /// Why the latest attempt failed.
    pub error: Option<JobError>,
    /// The assessment, once one is done.
    pub assessment_id: Option<AssessmentId>,
    /// The noise model, once a training is done.
    pub noise_model_id: Option<NoiseModelId>,
    /// When it was asked for.
    pub queued_at: OffsetDateTime,
    /// When its latest attempt began.
    pub started_at: Option<OffsetDateTime>,
    /// When it was over.
    pub finished_at: Option<OffsetDateTime>,
}

/// Which jobs are wanted; the default is all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct JobFilter {
    /// In this state.
    pub state: Option<JobState>,
    /// About this recording.
    pub recording_id: Option<RecordingId>,
}

/// A row of `jobs` with `session_id`, `assessment_id` and `noise_model_id` beside it.
pub(super) fn job_from_row(row: &Row) -> Result<Job, StorageError> {
    let step: Step = row::word(row, "progress_step")?;
    Ok(Job {
        id: row.try_get("id")?,
        recording_id: row.try_get("recording_id")?,
        session_id: row.try_get("session_id")?,
        state: row::word(row, "state")?,
        attempt: row::small(row, "attempt")?,
        max_attempts: row::small(row, "max_attempts")?,
        due_at: row::optional_time(row, "due_at")?,
        worker: row.try_get("worker")?,
        cancel_requested: row.try_get("cancel_requested")?,
        n_ahead: row::optional_small(row, "n_ahead")?,
        progress: Progress { step, done: row::count(row, "progress_done")?, total: row::count(row, "progress_total")? },
        settings: row::json(row, "settings")?,
        error: row::optional_json(row, "error")?,
        assessment_id: row.try_get("assessment_id")?,
        noise_model_id: row.try_get("noise_model_id")?,
        queued_at: row::time(row, "queued_at")?,
        started_at: row::optional_time(row, "started_at")?,
        finished_at: row::optional_time(row, "finished_at")?,
    })
}
