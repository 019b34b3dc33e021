//! What the protocol knows of uploads under way, in their rows.

use super::super::clock::ms_from_time;
use super::super::database::query;
use super::super::row;
use crate::storage::{Access, SessionId, StorageError, Store};
use time::Duration;
use tus_protocol::async_trait::async_trait;
use tus_protocol::chrono::{DateTime, Utc};
use tus_protocol::{Error, StateStore, UploadId, UploadState, WriteMode};

/// The states of uploads within one caller's reach; those that it makes belong to one session.
#[derive(Debug, Clone)]
pub struct UploadStates {
    store: Store,
    access: Access,
    session: Option<SessionId>,
    kept: Duration,
}

impl UploadStates {
    /// What the caller reaches. Bytes are kept for `kept` after the last of them came. New uploads need a `session`, which the
    /// caller must reach.
    pub fn new(store: &Store, access: Access, session: Option<SessionId>, kept: Duration) -> Self {
        Self { store: store.clone(), access, session, kept }
    }

    async fn insert(&self, state: &UploadState) -> Result<(), Error> {
        let session = self.session.ok_or_else(|| Error::Internal("an upload is made outside of a session".into()))?;
        let now = self.store.now();
        let mut transaction = self.store.begin().await.map_err(Error::state_store)?;
        let inserted = query(
            "INSERT INTO resumable_uploads (id, organisation_id, session_id, created_by, state, length_bytes,
                                            received_bytes, protocol_state, created_at, expires_at)
             VALUES ($1, $2, $3, $4, 'receiving', $5, $6, $7, $8, $9)",
        )
        .bind(state.id())
        .bind(self.access.organisation)
        .bind(session)
        .bind(self.access.client)
        .bind(state.length().map(bytes).transpose()?)
        .bind(bytes(state.offset())?)
        .bind(text_of(state)?)
        .bind(ms_from_time(now))
        .bind(ms_from_time(now + self.kept))
        .execute(&mut transaction)
        .await;
        match inserted {
            Ok(_) => transaction.commit().await.map_err(Error::state_store),
            Err(sqlx::Error::Database(error)) if error.is_unique_violation() => {
                Err(Error::AlreadyExists(state.id().to_owned()))
            }
            Err(error) => Err(Error::state_store(StorageError::Database(error))),
        }
    }

    async fn update(&self, state: &UploadState) -> Result<(), Error> {
        let mut transaction = self.store.begin().await.map_err(Error::state_store)?;
        let updated = query(
            "UPDATE resumable_uploads SET length_bytes = $3, received_bytes = $4, protocol_state = $5, expires_at = $6
             WHERE id = $1 AND organisation_id = $2 AND state = 'receiving'",
        )
        .bind(state.id())
        .bind(self.access.organisation)
        .bind(state.length().map(bytes).transpose()?)
        .bind(bytes(state.offset())?)
        .bind(text_of(state)?)
        .bind(ms_from_time(self.store.now() + self.kept))
        .execute(&mut transaction)
        .await
        .map_err(failed)?;
        transaction.commit().await.map_err(Error::state_store)?;
        if updated == 0 { Err(Error::NotFound(state.id().to_owned())) } else { Ok(()) }
    }
}

#[async_trait]
impl StateStore for UploadStates {
    fn name(&self) -> &'static str {
        "database"
    }

    async fn set(&self, state: &UploadState, mode: WriteMode) -> Result<(), Error> {
        checked(state.id())?;
        match mode {
            WriteMode::CreateNew => self.insert(state).await,
            _ => self.update(state).await,
        }
    }

    async fn get(&self, id: &str) -> Result<Option<UploadState>, Error> {
        checked(id)?;
        let row = query(
            "SELECT u.protocol_state FROM resumable_uploads u JOIN sessions s ON s.id = u.session_id
             WHERE u.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2) AND u.id = $3
               AND u.state = 'receiving'",
        )
        .bind(self.access.organisation)
        .bind(self.access.only_sessions_of())
        .bind(id)
        .fetch_optional(self.store.reader())
        .await
        .map_err(failed)?;
        row.as_ref().map(|row| row::json(row, "protocol_state")).transpose().map_err(Error::state_store)
    }

    async fn delete(&self, id: &str) -> Result<(), Error> {
        checked(id)?;
        let mut transaction = self.store.begin().await.map_err(Error::state_store)?;
        query("DELETE FROM resumable_uploads WHERE id = $1 AND organisation_id = $2")
            .bind(id)
            .bind(self.access.organisation)
            .execute(&mut transaction)
            .await
            .map_err(failed)?;
        transaction.commit().await.map_err(Error::state_store)
    }

    async fn list_expired(&self, before: DateTime<Utc>) -> Result<Vec<String>, Error> {
        let rows = query(
            "SELECT protocol_state FROM resumable_uploads WHERE organisation_id = $1 AND state = 'receiving' ORDER BY id",
        )
        .bind(self.access.organisation)
        .fetch_all(self.store.reader())
        .await
        .map_err(failed)?;
        let states: Result<Vec<UploadState>, _> = rows.iter().map(|row| row::json(row, "protocol_state")).collect();
        let expired = states.map_err(Error::state_store)?.into_iter().filter(|state| state.expires_before(before));
        Ok(expired.map(|state| state.id().to_owned()).collect())
    }
}

fn checked(id: &str) -> Result<(), Error> {
    id.parse::<UploadId>().map(drop)
}

fn failed(error: sqlx::Error) -> Error {
    Error::state_store(StorageError::Database(error))
}

fn bytes(number: u64) -> Result<i64, Error> {
    i64::try_from(number).map_err(|_| Error::SizeExceeded { size: number, max: i64::MAX.unsigned_abs() })
}

fn text_of(state: &UploadState) -> Result<String, Error> {
    row::readable_json("the state of an upload", state).map_err(Error::state_store)
}
