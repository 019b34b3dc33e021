//! Recordings: one upload in a session. The bytes are a blob; the row says which, and what is in it.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Row, Transaction, dialects, query};
use super::{
    Access, ClientId, Page, PageRequest, PatientId, RecordingId, SessionId, StorageError, Store, StoredBlob, row,
};
use crate::recording::decode::Inspection;
use time::OffsetDateTime;

/// A recording to be made; its bytes are already stored.
#[derive(Debug, Clone, PartialEq)]
pub struct NewRecording {
    /// The session it belongs to.
    pub session_id: SessionId,
    /// The uploaded bytes.
    pub blob: StoredBlob,
    /// What was seen while they arrived, the format among it.
    pub inspection: Inspection,
}

/// A recording's row.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredRecording {
    /// Identity.
    pub id: RecordingId,
    /// The session it belongs to.
    pub session_id: SessionId,
    /// The session's patient.
    pub patient_id: PatientId,
    /// The client that uploaded it.
    pub created_by: ClientId,
    /// The uploaded bytes.
    pub blob: StoredBlob,
    /// What was seen while they arrived, the format among it.
    pub inspection: Inspection,
    /// When it was stored.
    pub created_at: OffsetDateTime,
    /// Since when its bytes are gone, by a rule of retention; what was found in them stays.
    pub content_removed_at: Option<OffsetDateTime>,
}

/// Which recordings are wanted; the default is all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordingFilter {
    /// Of this session.
    pub session_id: Option<SessionId>,
    /// Of this patient.
    pub patient_id: Option<PatientId>,
}

fn recording_from_row(row: &Row) -> Result<StoredRecording, StorageError> {
    Ok(StoredRecording {
        id: row.try_get("id")?,
        session_id: row.try_get("session_id")?,
        patient_id: row.try_get("patient_id")?,
        created_by: row.try_get("created_by")?,
        blob: StoredBlob {
            key: row.try_get("blob_key")?,
            sha256: row.try_get("sha256")?,
            size_bytes: row::count(row, "size_bytes")?,
        },
        inspection: row::json(row, "inspection")?,
        created_at: row::time(row, "created_at")?,
        content_removed_at: row::optional_time(row, "content_removed_at")?,
    })
}

/// Inserts a recording inside the caller's transaction, so that its job can stand or fall with it.
pub(crate) async fn insert(
    connection: &mut Transaction,
    access: &Access,
    new: &NewRecording,
    now: OffsetDateTime,
) -> Result<StoredRecording, StorageError> {
    let patient_id: PatientId = query(
        "SELECT patient_id FROM sessions WHERE organisation_id = $1 AND ($2 IS NULL OR created_by = $2) AND id = $3",
    )
    .bind(access.organisation)
    .bind(access.only_sessions_of())
    .bind(new.session_id)
    .fetch_optional_value(&mut *connection)
    .await?
    .ok_or(StorageError::not_found("session"))?;
    let id = RecordingId::new();
    let size = i64::try_from(new.blob.size_bytes)
        .map_err(|_| StorageError::Corrupt(format!("a blob of {} bytes", new.blob.size_bytes)))?;
    let row = query(
        "INSERT INTO recordings (id, organisation_id, session_id, created_by, size_bytes, sha256, blob_key, inspection,
                                 created_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9) RETURNING *, $10 AS patient_id",
    )
    .bind(id)
    .bind(access.organisation)
    .bind(new.session_id)
    .bind(access.client)
    .bind(size)
    .bind(&new.blob.sha256)
    .bind(&new.blob.key)
    .bind(row::readable_json("the inspection", &new.inspection)?)
    .bind(ms_from_time(now))
    .bind(patient_id)
    .fetch_one(connection)
    .await?;
    recording_from_row(&row)
}

/// Refuses work on a recording whose bytes are gone.
pub(crate) async fn require_content(connection: &mut Transaction, id: RecordingId) -> Result<(), StorageError> {
    let gone: Option<i64> = query("SELECT 1 FROM recordings WHERE id = $1 AND content_removed_at IS NOT NULL")
        .bind(id)
        .fetch_optional_value(connection)
        .await?;
    match gone {
        None => Ok(()),
        Some(_) => Err(StorageError::Conflict {
            code: "content_removed",
            sentence:
                "the bytes of the recording were removed by a rule of retention, so it cannot be assessed any more"
                    .into(),
        }),
    }
}

impl Store {
    /// One recording within the caller's reach.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn recording(&self, access: &Access, id: RecordingId) -> Result<StoredRecording, StorageError> {
        let row = query(concat!(
            "SELECT r.*, s.patient_id FROM recordings r JOIN sessions s ON s.id = r.session_id
             WHERE r.id = $3 AND ((r.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)) OR ",
            shared_with!("s.patient_id", "$4", "$5"),
            ")"
        ))
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(id)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("recording"))?;
        recording_from_row(&row)
    }

    /// The recordings within the caller's reach, newest first; those of a shared patient when it or its session is asked for.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn recordings(
        &self,
        access: &Access,
        filter: &RecordingFilter,
        page: &PageRequest<RecordingId>,
    ) -> Result<Page<StoredRecording, RecordingId>, StorageError> {
        // An index can serve a condition only if it is there whatever is bound, hence one text per case.
        macro_rules! recordings_where {
            ($($reach:expr),+) => {
                concat!(
                    "SELECT r.*, s.patient_id FROM recordings r JOIN sessions s ON s.id = r.session_id
                     WHERE r.id < $3 AND ($5 IS NULL OR s.patient_id = $5) AND ",
                    $($reach,)+
                    " ORDER BY r.id DESC LIMIT $6"
                )
            };
        }
        let question = match (filter.session_id, filter.patient_id) {
            (Some(_), _) => recordings_where!(
                "r.session_id = $4 AND ((r.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)) OR ",
                shared_with!("s.patient_id", "$7", "$8"),
                ")"
            ),
            (None, Some(_)) => recordings_where!(
                "$4 IS NULL AND ((r.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)) OR ",
                shared_with!("s.patient_id", "$7", "$8"),
                ")"
            ),
            (None, None) => {
                recordings_where!("$4 IS NULL AND r.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)")
            }
        };
        let mut question = query(question)
            .bind(access.organisation)
            .bind(access.only_sessions_of())
            .bind(page.cursor())
            .bind(filter.session_id)
            .bind(filter.patient_id)
            .bind(page.rows());
        if filter.session_id.is_some() || filter.patient_id.is_some() {
            question = question.bind(access.receiver()).bind(ms_from_time(self.now()));
        }
        let rows = question.fetch_all(self.reader()).await?;
        let recordings = rows.iter().map(recording_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(recordings, page, |recording| recording.id))
    }

    /// What was done in a recording, as its header says it and as its session does; for the worker.
    ///
    /// # Errors
    /// `NotFound` when there is no such recording.
    pub async fn declared_protocols(&self, id: RecordingId) -> Result<[Option<String>; 2], StorageError> {
        let row = query(dialects! {
            sqlite: "SELECT r.inspection ->> '$.header.protocol' AS of_header, s.protocol AS of_session
                     FROM recordings r JOIN sessions s ON s.id = r.session_id WHERE r.id = $1",
            postgres: "SELECT r.inspection::json #>> '{header,protocol}' AS of_header, s.protocol AS of_session
                       FROM recordings r JOIN sessions s ON s.id = r.session_id WHERE r.id = $1",
        })
        .bind(id)
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("recording"))?;
        Ok([row.try_get("of_header")?, row.try_get("of_session")?])
    }

    /// The recording that a job is about, for the worker, which serves every organisation.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn recording_to_assess(&self, id: RecordingId) -> Result<StoredRecording, StorageError> {
        let row =
            query("SELECT r.*, s.patient_id FROM recordings r JOIN sessions s ON s.id = r.session_id WHERE r.id = $1")
                .bind(id)
                .fetch_optional(self.reader())
                .await?
                .ok_or(StorageError::not_found("recording"))?;
        recording_from_row(&row)
    }
}
