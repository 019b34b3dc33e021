//! Requests that may be sent twice: a client that lost the answer repeats the request with the same key and gets the
//! first answer again, without a second effect.

use super::clock::ms_from_time;
use super::{ClientId, StorageError, Store, row};
use sqlx::Row;
use time::Duration;

/// How long the answer is kept.
const ANSWER_KEPT: Duration = Duration::hours(24);
/// How long a request may be at work before its key is free again. A request claims its key after its body has
/// arrived, so it needs milliseconds; longer means that the process ended in between.
const WORK_EXPECTED: Duration = Duration::seconds(60);

/// An answer as it was sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredResponse {
    /// HTTP status.
    pub status: u16,
    /// Headers worth repeating, name and value.
    pub headers: Vec<(String, String)>,
    /// Body.
    pub body: Vec<u8>,
}

/// What a key means for the request that brings it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum IdempotencyClaim {
    /// Nobody has used the key: do the work, then complete or release the key.
    Fresh,
    /// The same request was answered: send this again.
    Replay(StoredResponse),
    /// The same request is at work.
    InProgress,
    /// The key belongs to a request with another content.
    Mismatch,
}

impl Store {
    /// Claims a key for a request whose content is `fingerprint` (a digest of method, path and body).
    ///
    /// # Errors
    /// When the database fails.
    pub async fn claim_idempotency_key(
        &self,
        client: ClientId,
        key: &str,
        fingerprint: &str,
    ) -> Result<IdempotencyClaim, StorageError> {
        let now = self.now();
        let mut transaction = self.begin().await?;
        sqlx::query("DELETE FROM idempotency_keys WHERE expires_at <= ?1")
            .bind(ms_from_time(now))
            .execute(&mut *transaction)
            .await?;
        let existing = sqlx::query(
            "SELECT fingerprint, status, headers, body FROM idempotency_keys WHERE client_id = ?1 AND key = ?2",
        )
        .bind(client)
        .bind(key)
        .fetch_optional(&mut *transaction)
        .await?;
        if let Some(row) = existing {
            if row.try_get::<&str, _>("fingerprint")? != fingerprint {
                return Ok(IdempotencyClaim::Mismatch);
            }
            let status: Option<u16> = row.try_get("status")?;
            return Ok(match status {
                None => IdempotencyClaim::InProgress,
                Some(status) => IdempotencyClaim::Replay(StoredResponse {
                    status,
                    headers: row::json(&row, "headers")?,
                    body: row.try_get("body")?,
                }),
            });
        }
        sqlx::query(
            "INSERT INTO idempotency_keys (client_id, key, fingerprint, created_at, expires_at)
             VALUES (?1, ?2, ?3, ?4, ?5)",
        )
        .bind(client)
        .bind(key)
        .bind(fingerprint)
        .bind(ms_from_time(now))
        .bind(ms_from_time(now + WORK_EXPECTED))
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await?;
        Ok(IdempotencyClaim::Fresh)
    }

    /// Keeps the answer to a request whose key was `Fresh`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn complete_idempotency_key(
        &self,
        client: ClientId,
        key: &str,
        response: &StoredResponse,
    ) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        sqlx::query(
            "UPDATE idempotency_keys SET status = ?3, headers = ?4, body = ?5, expires_at = ?6
             WHERE client_id = ?1 AND key = ?2",
        )
        .bind(client)
        .bind(key)
        .bind(response.status)
        .bind(row::readable_json("the headers of an answer", &response.headers)?)
        .bind(&response.body)
        .bind(ms_from_time(self.now() + ANSWER_KEPT))
        .execute(&mut *transaction)
        .await?;
        Ok(transaction.commit().await?)
    }

    /// Frees a key whose request failed without an effect, so that it can be tried again.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn release_idempotency_key(&self, client: ClientId, key: &str) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        sqlx::query("DELETE FROM idempotency_keys WHERE client_id = ?1 AND key = ?2 AND status IS NULL")
            .bind(client)
            .bind(key)
            .execute(&mut *transaction)
            .await?;
        Ok(transaction.commit().await?)
    }
}
