//! Uploads that go on where they broke off: whose they are, how far they came, and what became of them.
//!
//! The protocol ([tus 1.0](https://tus.io/protocols/resumable-upload)) is the crate `tus-protocol`; here is what it keeps its
//! bytes in ([`PartialFiles`]) and its states ([`UploadStates`]). The row is the truth of whose an upload is and what became of
//! it; the file is the truth of how many bytes there are, because bytes reach the disk before anybody is told of them.
//!
//! The file of an upload stands in the folder `resumable` of the data directory until its recording is a row. It becomes the
//! blob by a second name for the same bytes, so a process may die anywhere in between and the upload is finished again.

mod files;
mod states;

pub use files::PartialFiles;
pub use states::UploadStates;

use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::{
    Access, ClientId, JobId, OrganisationId, RecordingId, ResumableUploadId, SessionId, StorageError, Store, row,
};
use serde::{Deserialize, Serialize};
use time::{Duration, OffsetDateTime};

/// How long is known what became of an upload that is over.
const OUTCOME_KEPT: Duration = Duration::days(30);

/// Where an upload stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResumableState {
    /// Bytes are missing, or all are there and are being looked at.
    Receiving,
    /// It is a recording.
    Stored,
    /// Its bytes were all there, but are no recording that is taken.
    Refused,
    /// Too long nothing came; what had come was removed.
    Expired,
}

/// An upload's row.
#[derive(Debug, Clone, PartialEq)]
pub struct ResumableUpload {
    /// Identity.
    pub id: ResumableUploadId,
    /// Whose it is.
    pub organisation_id: OrganisationId,
    /// The session that the recording will belong to.
    pub session_id: SessionId,
    /// The client that began it.
    pub created_by: ClientId,
    /// Where it stands.
    pub state: ResumableState,
    /// How many bytes the recording has.
    pub length_bytes: u64,
    /// How many of them the last look found on the disk.
    pub received_bytes: u64,
    /// The recording, once it is stored.
    pub recording_id: Option<RecordingId>,
    /// The job that assesses it.
    pub job_id: Option<JobId>,
    /// Why it was refused: the document that the client got.
    pub problem: Option<String>,
    /// When it was begun.
    pub created_at: OffsetDateTime,
    /// When its bytes are given up, unless more come.
    pub expires_at: OffsetDateTime,
}

impl ResumableUpload {
    /// The reach of the client that began it, to finish it when nobody asks.
    pub fn access(&self) -> Access {
        Access {
            organisation: self.organisation_id,
            client: self.created_by,
            own_sessions_only: false,
            reaches_shared: false,
        }
    }

    /// True when its time is over at `now`.
    pub fn is_expired(&self, now: OffsetDateTime) -> bool {
        match self.state {
            ResumableState::Expired => true,
            ResumableState::Receiving => now >= self.expires_at && self.received_bytes < self.length_bytes,
            ResumableState::Stored | ResumableState::Refused => false,
        }
    }
}

fn upload_from_row(row: &Row) -> Result<ResumableUpload, StorageError> {
    let id: String = row.try_get("id")?;
    Ok(ResumableUpload {
        id: id.parse().map_err(|_| StorageError::Corrupt(format!("`{id}` is no id of an upload")))?,
        organisation_id: row.try_get("organisation_id")?,
        session_id: row.try_get("session_id")?,
        created_by: row.try_get("created_by")?,
        state: row::word(row, "state")?,
        length_bytes: row::count(row, "length_bytes")?,
        received_bytes: row::count(row, "received_bytes")?,
        recording_id: row.try_get("recording_id")?,
        job_id: row.try_get("job_id")?,
        problem: row.try_get("problem")?,
        created_at: row::time(row, "created_at")?,
        expires_at: row::time(row, "expires_at")?,
    })
}

/// True when the upload waits for its end, asked inside the transaction that will end it.
pub(crate) async fn is_receiving(transaction: &mut Transaction, id: ResumableUploadId) -> Result<bool, StorageError> {
    transaction.exclusively(&format!("resumable upload {id}")).await?;
    let found = query("SELECT 1 FROM resumable_uploads WHERE id = $1 AND state = 'receiving'")
        .bind(id.to_string())
        .fetch_optional(transaction)
        .await?;
    Ok(found.is_some())
}

/// Notes in the caller's transaction what the upload has become.
pub(crate) async fn set_stored(
    transaction: &mut Transaction,
    id: ResumableUploadId,
    recording: RecordingId,
    job: JobId,
    now: OffsetDateTime,
) -> Result<(), StorageError> {
    query(
        "UPDATE resumable_uploads SET state = 'stored', protocol_state = NULL, received_bytes = length_bytes,
                                      recording_id = $2, job_id = $3, expires_at = $4
         WHERE id = $1",
    )
    .bind(id.to_string())
    .bind(recording)
    .bind(job)
    .bind(ms_from_time(now + OUTCOME_KEPT))
    .execute(transaction)
    .await?;
    Ok(())
}

impl Store {
    /// The bytes of uploads under way.
    pub fn partial_files(&self) -> &PartialFiles {
        &self.partial_files
    }

    /// An upload within the caller's reach.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn resumable_upload(
        &self,
        access: &Access,
        id: ResumableUploadId,
    ) -> Result<ResumableUpload, StorageError> {
        let row = query(
            "SELECT u.* FROM resumable_uploads u JOIN sessions s ON s.id = u.session_id
             WHERE u.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2) AND u.id = $3",
        )
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(id.to_string())
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("upload"))?;
        upload_from_row(&row)
    }

    /// An upload, whosever it is; for the service itself.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn resumable_upload_to_finish(&self, id: ResumableUploadId) -> Result<ResumableUpload, StorageError> {
        let row = query("SELECT * FROM resumable_uploads WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(self.reader())
            .await?
            .ok_or(StorageError::not_found("upload"))?;
        upload_from_row(&row)
    }

    /// Every upload that is not over.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn resumable_uploads_under_way(&self) -> Result<Vec<ResumableUpload>, StorageError> {
        let rows = query("SELECT * FROM resumable_uploads WHERE state = 'receiving' ORDER BY id")
            .fetch_all(self.reader())
            .await?;
        rows.iter().map(upload_from_row).collect()
    }

    /// How many uploads are half there, and the bytes of them that have arrived.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn count_half_uploads(&self) -> Result<(u64, u64), StorageError> {
        let row = query(
            "SELECT count(*) AS n, CAST(coalesce(sum(received_bytes), 0) AS BIGINT) AS bytes
             FROM resumable_uploads WHERE state = 'receiving'",
        )
        .fetch_one(self.reader())
        .await?;
        Ok((row::count(&row, "n")?, row::count(&row, "bytes")?))
    }

    /// Ends an upload whose bytes are not taken; `problem` is the document that its client gets, now and later.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn refuse_resumable_upload(&self, id: ResumableUploadId, problem: &str) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        query(
            "UPDATE resumable_uploads SET state = 'refused', protocol_state = NULL, problem = $2, expires_at = $3
             WHERE id = $1 AND state = 'receiving'",
        )
        .bind(id.to_string())
        .bind(problem)
        .bind(ms_from_time(self.now() + OUTCOME_KEPT))
        .execute(&mut transaction)
        .await?;
        transaction.commit().await
    }

    /// Ends an upload of which nothing came for too long; false when more came meanwhile.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn expire_resumable_upload(&self, id: ResumableUploadId) -> Result<bool, StorageError> {
        let now = self.now();
        let mut transaction = self.begin().await?;
        let n = query(
            "UPDATE resumable_uploads SET state = 'expired', protocol_state = NULL, expires_at = $3
             WHERE id = $1 AND state = 'receiving' AND expires_at <= $2",
        )
        .bind(id.to_string())
        .bind(ms_from_time(now))
        .bind(ms_from_time(now + OUTCOME_KEPT))
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        Ok(n > 0)
    }

    /// Forgets uploads that were over long ago.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn forget_resumable_uploads(&self) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        query("DELETE FROM resumable_uploads WHERE state <> 'receiving' AND expires_at <= $1")
            .bind(ms_from_time(self.now()))
            .execute(&mut transaction)
            .await?;
        transaction.commit().await
    }
}

#[cfg(test)]
mod tests;
