//! Sessions: one sitting of a patient at home.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Row, dialects, query};
use super::id::list_of_ids;
use super::{Access, ClientId, Page, PageRequest, PatientId, SessionId, StorageError, Store, row};
use std::collections::HashMap;
use time::OffsetDateTime;

/// A session to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewSession {
    /// Whose session it is.
    pub patient_id: PatientId,
    /// When it began, to the millisecond.
    pub started_at: OffsetDateTime,
    /// The exercise programme or test.
    pub protocol: Option<String>,
    /// Remarks of whoever made it.
    pub notes: Option<String>,
    /// Noise model of the sensor, as settings name it.
    pub noise_model: Option<String>,
}

/// A session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Session {
    /// Identity.
    pub id: SessionId,
    /// Whose session it is.
    pub patient_id: PatientId,
    /// The client that made it; a device sees only its own.
    pub created_by: ClientId,
    /// When it began, to the millisecond.
    pub started_at: OffsetDateTime,
    /// The exercise programme or test.
    pub protocol: Option<String>,
    /// Remarks of whoever made it.
    pub notes: Option<String>,
    /// Noise model of the sensor, as settings name it.
    pub noise_model: Option<String>,
    /// When the row was made.
    pub created_at: OffsetDateTime,
}

/// Which sessions are wanted; the default is all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SessionFilter {
    /// Of this patient.
    pub patient_id: Option<PatientId>,
    /// Begun at this time or later.
    pub started_from: Option<OffsetDateTime>,
    /// Begun before this time.
    pub started_before: Option<OffsetDateTime>,
    /// Of exactly this protocol.
    pub protocol: Option<String>,
}

fn session_from_row(row: &Row) -> Result<Session, StorageError> {
    Ok(Session {
        id: row.try_get("id")?,
        patient_id: row.try_get("patient_id")?,
        created_by: row.try_get("created_by")?,
        started_at: row::time(row, "started_at")?,
        protocol: row.try_get("protocol")?,
        notes: row.try_get("notes")?,
        noise_model: row.try_get("noise_model")?,
        created_at: row::time(row, "created_at")?,
    })
}

impl Store {
    /// Makes a session of a patient of the organisation.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn create_session(&self, access: &Access, new: &NewSession) -> Result<Session, StorageError> {
        let mut transaction = self.begin().await?;
        let row = query(
            "INSERT INTO sessions (id, organisation_id, patient_id, created_by, started_at, protocol, notes, noise_model,
                                   created_at)
             SELECT $1, p.organisation_id, p.id, $4, $5, $6, $7, $8, $9 FROM patients p
             WHERE p.organisation_id = $2 AND p.id = $3 RETURNING *",
        )
        .bind(SessionId::new())
        .bind(access.organisation)
        .bind(new.patient_id)
        .bind(access.client)
        .bind(ms_from_time(new.started_at))
        .bind(&new.protocol)
        .bind(&new.notes)
        .bind(&new.noise_model)
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut transaction)
        .await?
        .ok_or(StorageError::not_found("patient"))?;
        transaction.commit().await?;
        session_from_row(&row)
    }

    /// One session within the caller's reach.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn session(&self, access: &Access, id: SessionId) -> Result<Session, StorageError> {
        let row = query(concat!(
            "SELECT * FROM sessions
             WHERE id = $3 AND ((organisation_id = $1 AND ($2 IS NULL OR created_by = $2)) OR ",
            shared_with!("patient_id", "$4", "$5"),
            ")"
        ))
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(id)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("session"))?;
        session_from_row(&row)
    }

    /// When the latest session of each of some patients of the organisation began; those without a session are left out.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn last_sessions_of(
        &self,
        access: &Access,
        patients: &[PatientId],
    ) -> Result<HashMap<PatientId, OffsetDateTime>, StorageError> {
        macro_rules! last_sessions {
            ($patients:literal) => {
                concat!(
                    "SELECT patient_id, max(started_at) AS started_at FROM sessions
                     WHERE organisation_id = $1 AND patient_id IN (",
                    $patients,
                    ") GROUP BY patient_id"
                )
            };
        }
        let rows = query(dialects! {
            sqlite: last_sessions!("SELECT unhex(value) FROM json_each($2)"),
            postgres: last_sessions!("SELECT value::uuid FROM json_array_elements_text($2::json)"),
        })
        .bind(access.organisation)
        .bind(list_of_ids(patients.iter().map(|id| id.0)))
        .fetch_all(self.reader())
        .await?;
        rows.iter().map(|row| Ok((row.try_get("patient_id")?, row::time(row, "started_at")?))).collect()
    }

    /// The sessions within the caller's reach, newest first; those of a shared patient when it is asked for.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn sessions(
        &self,
        access: &Access,
        filter: &SessionFilter,
        page: &PageRequest<SessionId>,
    ) -> Result<Page<Session, SessionId>, StorageError> {
        // An index can serve a condition only if it is there whatever is bound, hence one text per case.
        macro_rules! sessions_where {
            ($($indexed:expr),+) => {
                concat!(
                    "SELECT * FROM sessions
                     WHERE id < $3
                       AND ($5 IS NULL OR started_at >= $5)
                       AND ($6 IS NULL OR started_at < $6)
                       AND ($7 IS NULL OR protocol = $7)
                       AND ",
                    $($indexed,)+
                    " ORDER BY id DESC LIMIT $8"
                )
            };
        }
        let question = match (filter.patient_id, access.only_sessions_of()) {
            (Some(_), _) => sessions_where!(
                "patient_id = $4 AND ((organisation_id = $1 AND ($2 IS NULL OR created_by = $2)) OR ",
                shared_with!("patient_id", "$9", "$10"),
                ")"
            ),
            (None, Some(_)) => sessions_where!("organisation_id = $1 AND created_by = $2 AND $4 IS NULL"),
            (None, None) => sessions_where!("organisation_id = $1 AND $2 IS NULL AND $4 IS NULL"),
        };
        let mut question = query(question)
            .bind(access.organisation)
            .bind(access.only_sessions_of())
            .bind(page.cursor())
            .bind(filter.patient_id)
            .bind(filter.started_from.map(ms_from_time))
            .bind(filter.started_before.map(ms_from_time))
            .bind(&filter.protocol)
            .bind(page.rows());
        if filter.patient_id.is_some() {
            question = question.bind(access.receiver()).bind(ms_from_time(self.now()));
        }
        let rows = question.fetch_all(self.reader()).await?;
        let sessions = rows.iter().map(session_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(sessions, page, |session| session.id))
    }
}
