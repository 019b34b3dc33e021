//! Out of the queue, for a while: claims, leases, heartbeats.

use super::job::{JOB_FORMAT, job_from_row};
use super::{Job, JobError, Queue, WORKER_LOST};
use crate::progress::Progress;
use crate::storage::clock::ms_from_time;
use crate::storage::database::{Transaction, dialects, query};
use crate::storage::{JobId, StorageError, row};
use time::OffsetDateTime;

/// What a worker learns when it renews its lease.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Renewal {
    /// The job is still the worker's.
    Held,
    /// The job is somebody else's or over: stop, and write nothing.
    Lost,
    /// The job is still the worker's, and somebody asks to stop it.
    CancelRequested,
}

impl Queue {
    /// Takes the due job whose turn it is and that this version can do, counts the attempt and starts its lease; `None` when none is due.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn claim(&self, worker: &str) -> Result<Option<Job>, StorageError> {
        let now = self.store.now();
        let mut transaction = self.store.begin().await?;
        let ended = end_lost_jobs(&mut transaction, now, now + self.settings.furthest_due()).await?;
        // One statement: between the choice and the change there is no moment for another worker.
        macro_rules! claim {
            ($lock:literal) => {
                concat!(
                    "UPDATE jobs SET state = 'running', attempt = attempt + 1, worker = $1, due_at = $2, started_at = $3,
                                     progress_step = 'waiting', progress_done = 0, progress_total = 0
                     WHERE id = (SELECT id FROM jobs
                                 WHERE due_at IS NOT NULL AND (due_at <= $3 OR due_at > $4) AND format <= $5
                                 ORDER BY turn_at, id LIMIT 1",
                    $lock,
                    ") RETURNING id"
                )
            };
        }
        let claimed: Option<JobId> = query(dialects! {
            sqlite: claim!(""),
            postgres: claim!(" FOR UPDATE SKIP LOCKED"),
        })
        .bind(worker)
        .bind(ms_from_time(now + self.settings.lease))
        .bind(ms_from_time(now))
        .bind(ms_from_time(now + self.settings.furthest_due()))
        .bind(JOB_FORMAT)
        .fetch_optional_value(&mut transaction)
        .await?;
        let Some(id) = claimed else {
            // Without lost jobs nothing was written: no commit, no sync of the disk on every idle look.
            if !ended.is_empty() {
                transaction.commit().await?;
            }
            ended.into_iter().for_each(|id| self.announce(id));
            return Ok(None);
        };
        let row = query(
            "SELECT j.*, NULL AS n_ahead, r.session_id, NULL AS assessment_id, NULL AS noise_model_id
             FROM jobs j JOIN recordings r ON r.id = j.recording_id WHERE j.id = $1",
        )
        .bind(id)
        .fetch_one(&mut transaction)
        .await?;
        let job = job_from_row(&row)?;
        transaction.commit().await?;
        ended.into_iter().chain([id]).for_each(|id| self.announce(id));
        Ok(Some(job))
    }

    /// Says that attempt `attempt` of a job is alive, and how far it is.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn renew(&self, id: JobId, attempt: u32, progress: Progress) -> Result<Renewal, StorageError> {
        let due_at = self.store.now() + self.settings.lease;
        let mut transaction = self.store.begin().await?;
        let row = query(
            "UPDATE jobs SET due_at = $3, progress_step = $4, progress_done = $5, progress_total = $6
             WHERE id = $1 AND attempt = $2 AND state = 'running' RETURNING cancel_requested",
        )
        .bind(id)
        .bind(attempt)
        .bind(ms_from_time(due_at))
        .bind(progress.step.name())
        .bind(i64::try_from(progress.done).unwrap_or(i64::MAX))
        .bind(i64::try_from(progress.total).unwrap_or(i64::MAX))
        .fetch_optional(&mut transaction)
        .await?;
        transaction.commit().await?;
        let Some(row) = row else { return Ok(Renewal::Lost) };
        self.announce(id);
        Ok(if row.try_get("cancel_requested")? { Renewal::CancelRequested } else { Renewal::Held })
    }

    /// Gives a claimed job back untouched: the worker is shutting down. The job may be begun once more instead, because
    /// an attempt's number is a fence and must never be given out twice.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn release(&self, id: JobId, attempt: u32) -> Result<(), StorageError> {
        let mut transaction = self.store.begin().await?;
        let released = query(
            "UPDATE jobs SET state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'queued' END,
                             due_at = CASE WHEN cancel_requested THEN NULL ELSE $3 END,
                             finished_at = CASE WHEN cancel_requested THEN $3 END,
                             max_attempts = max_attempts + 1, worker = NULL, started_at = NULL,
                             progress_step = 'waiting', progress_done = 0, progress_total = 0
             WHERE id = $1 AND attempt = $2 AND state = 'running'",
        )
        .bind(id)
        .bind(attempt)
        .bind(ms_from_time(self.store.now()))
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        if released > 0 {
            self.wake_worker(id);
            self.announce(id);
        }
        Ok(())
    }
}

/// Ends the jobs whose lease ran out and that must not run again: somebody asked to stop them, or they have been begun
/// as often as they may. All others with an expired lease are simply due.
async fn end_lost_jobs(
    connection: &mut Transaction,
    now: OffsetDateTime,
    furthest_due: OffsetDateTime,
) -> Result<Vec<JobId>, StorageError> {
    let error = JobError::new(
        WORKER_LOST,
        "the process that computed this recording stopped without an answer, at every attempt; \
         the recording may need more memory than the server has",
    );
    let ended = query(
        "UPDATE jobs SET state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'failed' END,
                         error = CASE WHEN cancel_requested THEN error ELSE $2 END,
                         due_at = NULL, finished_at = $1
         WHERE state = 'running' AND (due_at <= $1 OR due_at > $3) AND (cancel_requested OR attempt >= max_attempts)
         RETURNING id",
    )
    .bind(ms_from_time(now))
    .bind(row::readable_json("a job's error", &error)?)
    .bind(ms_from_time(furthest_due))
    .fetch_values(connection)
    .await?;
    Ok(ended)
}
