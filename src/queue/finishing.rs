//! The end of an attempt: a result, a failure, a cancellation.

use super::{JobError, JobState, Queue};
use crate::assessment::{Assessment, NoiseModel};
use crate::storage::assessments::{self, EncodedAssessment};
use crate::storage::audit::{Actor, AuditEvent, Thing, ThingKind};
use crate::storage::clock::ms_from_time;
use crate::storage::database::{Transaction, query};
use crate::storage::{
    Access, AssessmentId, JobId, NoiseModelId, OrganisationId, RecordingId, StorageError, noise_models, row,
};
use time::OffsetDateTime;
use tokio::task::spawn_blocking;

/// What became of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// It is stored, and its job is done.
    Saved(AssessmentId),
    /// The job was no longer the worker's; nothing was written.
    Lost,
}

/// What became of a trained noise model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trained {
    /// It is stored, and its job is done.
    Saved(NoiseModelId),
    /// The job was no longer the worker's; nothing was written.
    Lost,
}

/// What became of a failed attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// The job will be tried again after a pause.
    WillRetry,
    /// The job is given up.
    GivenUp,
    /// Somebody had asked to stop the job anyway: it is cancelled.
    Cancelled,
    /// The job was no longer the worker's; nothing was written.
    Lost,
}

impl Queue {
    /// Stores the result of attempt `attempt` and ends its job, both or neither.
    ///
    /// # Errors
    /// `Corrupt` when the assessment contradicts itself (series of different lengths, numbers that JSON lacks); the
    /// job runs on then.
    pub async fn finish(&self, id: JobId, attempt: u32, assessment: Assessment) -> Result<Finish, StorageError> {
        let encoded = spawn_blocking(move || EncodedAssessment::encode(&assessment))
            .await
            .map_err(|panic| StorageError::Corrupt(format!("coding an assessment failed: {panic}")))??;
        let now = self.store.now();
        let mut transaction = self.store.begin().await?;
        let Some(ended) = end_as_done(&mut transaction, id, attempt, now).await? else { return Ok(Finish::Lost) };
        let assessment = assessments::insert(&mut transaction, ended.recording, id, &encoded, now).await?;
        let made = Thing { kind: ThingKind::Assessment, id: assessment.0 };
        self.store.audit_within(&mut transaction, ended.event("assessment", made, now)).await?;
        transaction.commit().await?;
        self.announce(id);
        Ok(Finish::Saved(assessment))
    }

    /// Stores the noise model that attempt `attempt` trained, as the next version of its name, and ends its job, both or
    /// neither.
    ///
    /// # Errors
    /// When the database fails; the job runs on then.
    pub async fn finish_training(&self, id: JobId, attempt: u32, model: NoiseModel) -> Result<Trained, StorageError> {
        let now = self.store.now();
        let mut transaction = self.store.begin().await?;
        let Some(ended) = end_as_done(&mut transaction, id, attempt, now).await? else { return Ok(Trained::Lost) };
        let model = noise_models::insert(&mut transaction, id, model, now).await?;
        let made = Thing { kind: ThingKind::NoiseModel, id: model.0 };
        self.store.audit_within(&mut transaction, ended.event("training", made, now)).await?;
        transaction.commit().await?;
        self.announce(id);
        Ok(Trained::Saved(model))
    }

    /// Ends attempt `attempt` without a result. A `retryable` failure is tried again after a pause, until the job has
    /// been begun as often as it may; the error stays with the job.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn fail(
        &self,
        id: JobId,
        attempt: u32,
        error: &JobError,
        retryable: bool,
    ) -> Result<Failure, StorageError> {
        let now = self.store.now();
        let mut transaction = self.store.begin().await?;
        let row = query(
            "UPDATE jobs SET
                 state = CASE WHEN cancel_requested THEN 'cancelled'
                              WHEN $3 AND attempt < max_attempts THEN 'queued' ELSE 'failed' END,
                 due_at = CASE WHEN NOT cancel_requested AND $3 AND attempt < max_attempts THEN $4 END,
                 finished_at = CASE WHEN NOT cancel_requested AND $3 AND attempt < max_attempts THEN NULL ELSE $5 END,
                 error = $6
             WHERE id = $1 AND attempt = $2 AND state = 'running' RETURNING state",
        )
        .bind(id)
        .bind(attempt)
        .bind(retryable)
        .bind(ms_from_time(now + self.settings.pause_after(attempt)))
        .bind(ms_from_time(now))
        .bind(row::readable_json("a job's error", error)?)
        .fetch_optional(&mut transaction)
        .await?;
        transaction.commit().await?;
        let Some(row) = row else { return Ok(Failure::Lost) };
        self.announce(id);
        Ok(match row::word(&row, "state")? {
            JobState::Queued => Failure::WillRetry,
            JobState::Cancelled => Failure::Cancelled,
            _ => Failure::GivenUp,
        })
    }

    /// Ends attempt `attempt` because somebody asked to. `false` when the job was no longer the worker's.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn end_cancelled(&self, id: JobId, attempt: u32) -> Result<bool, StorageError> {
        let mut transaction = self.store.begin().await?;
        let ended = query(
            "UPDATE jobs SET state = 'cancelled', due_at = NULL, finished_at = $3
             WHERE id = $1 AND attempt = $2 AND state = 'running'",
        )
        .bind(id)
        .bind(attempt)
        .bind(ms_from_time(self.store.now()))
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        self.announce(id);
        Ok(ended > 0)
    }

    /// Asks to stop a job. One that waits is cancelled at once; one that runs is, as soon as its worker sees the
    /// request. Asking again changes nothing.
    ///
    /// # Errors
    /// `NotFound` when the job is out of the caller's reach; `Conflict` with code `job_over` when it is done or has
    /// failed.
    pub async fn cancel(&self, access: &Access, id: JobId) -> Result<super::Job, StorageError> {
        let before = self.job(access, id).await?;
        let mut transaction = self.store.begin().await?;
        let row = query(
            "UPDATE jobs SET cancel_requested = TRUE,
                 finished_at = CASE WHEN state = 'queued' THEN $2 ELSE finished_at END,
                 due_at = CASE WHEN state = 'queued' THEN NULL ELSE due_at END,
                 state = CASE WHEN state = 'queued' THEN 'cancelled' ELSE state END
             WHERE id = $1 AND state IN ('queued', 'running', 'cancelled') RETURNING id",
        )
        .bind(before.id)
        .bind(ms_from_time(self.store.now()))
        .fetch_optional(&mut transaction)
        .await?;
        transaction.commit().await?;
        let Some(row) = row else {
            return Err(StorageError::Conflict {
                code: "job_over",
                sentence: "the job is over, so it cannot be cancelled any more".into(),
            });
        };
        let id: JobId = row.try_get("id")?;
        self.announce(id);
        self.job(access, id).await
    }
}

/// A job whose result is being written.
struct Ended {
    recording: RecordingId,
    organisation: OrganisationId,
}

impl Ended {
    /// What the audit log says of it: the service made a result of the recording.
    fn event(&self, action: &str, made: Thing, now: OffsetDateTime) -> AuditEvent {
        let recording = Thing { kind: ThingKind::Recording, id: self.recording.0 };
        let actor = Actor::service(Some(self.organisation));
        let event = AuditEvent::of_command(now, actor, action, Some(recording), String::new());
        AuditEvent { made: Some(made), ..event }
    }
}

/// Ends an attempt with its result, which the caller writes in the same transaction; `None` when the job was no longer the
/// worker's.
async fn end_as_done(
    connection: &mut Transaction,
    id: JobId,
    attempt: u32,
    now: OffsetDateTime,
) -> Result<Option<Ended>, StorageError> {
    let row = query(
        "UPDATE jobs SET state = 'done', due_at = NULL, finished_at = $3, error = NULL, progress_step = 'saving',
                         progress_done = 1, progress_total = 1
         WHERE id = $1 AND attempt = $2 AND state = 'running' RETURNING recording_id, organisation_id",
    )
    .bind(id)
    .bind(attempt)
    .bind(ms_from_time(now))
    .fetch_optional(connection)
    .await?;
    let Some(row) = row else { return Ok(None) };
    Ok(Some(Ended { recording: row.try_get("recording_id")?, organisation: row.try_get("organisation_id")? }))
}
