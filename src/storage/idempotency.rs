//! Requests that may be sent twice: a client that lost the answer repeats the request with the same key and gets the
//! first answer again, without a second effect.
//!
//! The answer is kept in the transaction that has the effect. So there is no moment, a crash included, at which the
//! effect is there and the key does not know of it.

use super::clock::ms_from_time;
use super::database::{Transaction, query};
use super::{ClientId, StorageError, row};
use time::{Duration, OffsetDateTime};

/// How long the answer is kept.
const ANSWER_KEPT: Duration = Duration::hours(24);
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

/// An answer that is kept under a key, and the content of the request that it belongs to.
pub(crate) struct KeptAnswer {
    pub(crate) fingerprint: String,
    pub(crate) response: StoredResponse,
}

/// The answer that is kept under a key. Inside the caller's transaction, so that nobody else can use the key between
/// this look and [`keep_answer`].
pub(crate) async fn kept_answer(
    connection: &mut Transaction,
    client: ClientId,
    key: &str,
    now: OffsetDateTime,
) -> Result<Option<KeptAnswer>, StorageError> {
    let row = query(
        "SELECT fingerprint, status, headers, body FROM idempotency_keys
         WHERE client_id = $1 AND key = $2 AND expires_at > $3",
    )
    .bind(client)
    .bind(key)
    .bind(ms_from_time(now))
    .fetch_optional(connection)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let response = StoredResponse {
        status: row::small(&row, "status")?,
        headers: row::json(&row, "headers")?,
        body: row.try_get("body")?,
    };
    Ok(Some(KeptAnswer { fingerprint: row.try_get("fingerprint")?, response }))
}

/// Keeps the answer to a request under its key, and forgets those that are too old.
pub(crate) async fn keep_answer(
    connection: &mut Transaction,
    client: ClientId,
    key: &str,
    answer: &KeptAnswer,
    now: OffsetDateTime,
) -> Result<(), StorageError> {
    query("DELETE FROM idempotency_keys WHERE expires_at <= $1")
        .bind(ms_from_time(now))
        .execute(&mut *connection)
        .await?;
    query(
        "INSERT INTO idempotency_keys (client_id, key, fingerprint, status, headers, body, created_at, expires_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
    )
    .bind(client)
    .bind(key)
    .bind(&answer.fingerprint)
    .bind(answer.response.status)
    .bind(row::readable_json("the headers of an answer", &answer.response.headers)?)
    .bind(&answer.response.body)
    .bind(ms_from_time(now))
    .bind(ms_from_time(now + ANSWER_KEPT))
    .execute(connection)
    .await?;
    Ok(())
}
