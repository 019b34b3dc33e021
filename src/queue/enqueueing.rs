//! Into the queue.

use super::job::{JOB_FORMAT, job_from_row};
use super::turn::expected_cost;
use super::{Job, Queue};
use crate::assessment::Settings;
use crate::storage::clock::ms_from_time;
use crate::storage::database::{Transaction, query};
use crate::storage::idempotency::{KeptAnswer, keep_answer, kept_answer};
use crate::storage::{
    Access, JobId, NewRecording, RecordingId, ResumableUploadId, StorageError, StoredRecording, StoredResponse,
    recordings, resumable, row,
};

/// What became of an upload that may have been sent before.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Submission {
    /// It is stored, and this is the answer.
    Stored(StoredResponse),
    /// It was stored before, and this was the answer.
    Replayed(StoredResponse),
    /// The key belongs to an upload of another content; nothing was stored.
    KeyReused,
}

impl Queue {
    /// Stores a recording and the job to assess it, both or neither, and wakes a worker.
    ///
    /// # Errors
    /// `NotFound` (`session`) when the session is out of the caller's reach; `NoConsent`.
    pub async fn submit(
        &self,
        access: &Access,
        new: &NewRecording,
        settings: &Settings,
    ) -> Result<(StoredRecording, Job), StorageError> {
        let mut transaction = self.store.begin().await?;
        self.store.blobs().require(&new.blob).await?;
        let recording = recordings::insert(&mut transaction, access, new, self.store.now()).await?;
        let job = self.insert(&mut transaction, access, recording.id, settings).await?;
        transaction.commit().await?;
        self.wake_worker(job.id);
        self.announce(job.id);
        Ok((recording, job))
    }

    /// Like [`Queue::submit`], once per `key` of the client: recording, job and the `answer` made of them are stored
    /// together, and whoever brings the key again gets that answer. `fingerprint` stands for the content of the
    /// request.
    ///
    /// # Errors
    /// `NotFound` (`session`) when the session is out of the caller's reach.
    pub async fn submit_once(
        &self,
        access: &Access,
        key: &str,
        fingerprint: String,
        new: &NewRecording,
        settings: &Settings,
        answer: impl FnOnce(StoredRecording, Job) -> serde_json::Result<StoredResponse>,
    ) -> Result<Submission, StorageError> {
        let now = self.store.now();
        let mut transaction = self.store.begin().await?;
        transaction.exclusively(&format!("idempotency {} {key}", access.client)).await?;
        if let Some(kept) = kept_answer(&mut transaction, access.client, key, now).await? {
            let same = kept.fingerprint == fingerprint;
            return Ok(if same { Submission::Replayed(kept.response) } else { Submission::KeyReused });
        }
        self.store.blobs().require(&new.blob).await?;
        let recording = recordings::insert(&mut transaction, access, new, now).await?;
        let job = self.insert(&mut transaction, access, recording.id, settings).await?;
        let id = job.id;
        let unwritable = |error| StorageError::Corrupt(format!("an answer cannot be written: {error}"));
        let response = answer(recording, job).map_err(unwritable)?;
        let kept = KeptAnswer { fingerprint, response };
        keep_answer(&mut transaction, access.client, key, &kept, now).await?;
        transaction.commit().await?;
        self.wake_worker(id);
        self.announce(id);
        Ok(Submission::Stored(kept.response))
    }

    /// Like [`Queue::submit`], once per resumable upload, which is over with it; false when it was over already, and nothing
    /// was stored.
    ///
    /// # Errors
    /// `NotFound` (`session`) when the session is out of the caller's reach.
    pub async fn submit_resumed(
        &self,
        access: &Access,
        upload: ResumableUploadId,
        new: &NewRecording,
        settings: &Settings,
    ) -> Result<bool, StorageError> {
        let now = self.store.now();
        let mut transaction = self.store.begin().await?;
        if !resumable::is_receiving(&mut transaction, upload).await? {
            return Ok(false);
        }
        let recording = recordings::insert(&mut transaction, access, new, now).await?;
        let job = self.insert(&mut transaction, access, recording.id, settings).await?;
        resumable::set_stored(&mut transaction, upload, recording.id, job.id, now).await?;
        transaction.commit().await?;
        self.wake_worker(job.id);
        self.announce(job.id);
        Ok(true)
    }

    /// Asks for another assessment of a recording that is already stored.
    ///
    /// # Errors
    /// `NotFound` (`recording`) when the recording is out of the caller's reach.
    pub async fn enqueue(
        &self,
        access: &Access,
        recording: RecordingId,
        settings: &Settings,
    ) -> Result<Job, StorageError> {
        let mut transaction = self.store.begin().await?;
        let job = self.insert(&mut transaction, access, recording, settings).await?;
        transaction.commit().await?;
        self.wake_worker(job.id);
        self.announce(job.id);
        Ok(job)
    }

    async fn insert(
        &self,
        connection: &mut Transaction,
        access: &Access,
        recording: RecordingId,
        settings: &Settings,
    ) -> Result<Job, StorageError> {
        self.check_consent(&mut *connection, recording, settings).await?;
        recordings::require_content(&mut *connection, recording).await?;
        for other in settings.training_recordings() {
            recordings::require_content(&mut *connection, RecordingId(other)).await?;
        }
        let now = ms_from_time(self.store.now());
        let id = JobId::new();
        let (base_ms, ms_per_megabyte) = expected_cost(settings);
        let inserted = query(
            "INSERT INTO jobs (id, organisation_id, recording_id, state, max_attempts, due_at, settings, queued_at,
                               format, expected_ms, turn_at)
             SELECT $1, one.organisation_id, one.id, 'queued', $5, $6, $7, $6, $10, one.expected_ms,
                    $6 + one.expected_ms
                       + (SELECT CAST(coalesce(sum(w.expected_ms), 0) AS BIGINT) FROM jobs w
                          WHERE w.organisation_id = one.organisation_id AND w.state = 'queued'
                            AND w.expected_ms <= one.expected_ms)
             FROM (SELECT r.id, r.organisation_id, $8 + r.size_bytes / 1000 * $9 / 1000 AS expected_ms
                   FROM recordings r JOIN sessions s ON s.id = r.session_id
                   WHERE r.organisation_id = $2 AND ($3 IS NULL OR s.created_by = $3) AND r.id = $4) one",
        )
        .bind(id)
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(recording)
        .bind(self.settings.max_attempts)
        .bind(now)
        .bind(row::readable_json("the settings", settings)?)
        .bind(base_ms)
        .bind(ms_per_megabyte)
        .bind(JOB_FORMAT)
        .execute(&mut *connection)
        .await?;
        if inserted == 0 {
            return Err(StorageError::not_found("recording"));
        }
        let row = query(
            "SELECT j.*, NULL AS n_ahead, r.session_id, NULL AS assessment_id, NULL AS noise_model_id
             FROM jobs j JOIN recordings r ON r.id = j.recording_id WHERE j.id = $1",
        )
        .bind(id)
        .fetch_one(connection)
        .await?;
        job_from_row(&row)
    }
}
