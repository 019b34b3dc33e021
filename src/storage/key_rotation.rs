//! A new key for a client that stays who it is.

use super::clients::{ApiKey, Client, client_from_row};
use super::clock::ms_from_time;
use super::database::query;
use super::{ClientId, OrganisationId, StorageError, Store};
use time::{Duration, OffsetDateTime};

/// What a rotation changes besides the key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rotation {
    /// For how long the key before opens as well; zero ends it at once.
    pub overlap: Duration,
    /// When the new key ends; none leaves what was said of the key before.
    pub expires_at: Option<OffsetDateTime>,
}

impl Store {
    /// Replaces a client's key. The client stays who it is, with all that it has made; the key before ends at once, or after
    /// the overlap, or when it would have ended anyway. A key that an earlier rotation still left open ends now.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such client; `Conflict` with code `client_revoked`, or `key_expired` when no
    /// later end is given for a key that has come to its end.
    pub async fn rotate_client(
        &self,
        organisation: OrganisationId,
        id: ClientId,
        rotation: Rotation,
    ) -> Result<(Client, ApiKey), StorageError> {
        let conflict = |code, sentence: &str| StorageError::Conflict { code, sentence: sentence.to_owned() };
        let now = self.now();
        let mut transaction = self.begin().await?;
        let row = query("SELECT * FROM clients WHERE id = $1 AND organisation_id = $2 AND kind = 'key'")
            .bind(id)
            .bind(organisation)
            .fetch_optional(&mut transaction)
            .await?
            .ok_or(StorageError::not_found("client"))?;
        let before = client_from_row(&row)?;
        if before.revoked_at.is_some() {
            return Err(conflict("client_revoked", "The key was revoked. Make a new client instead."));
        }
        let expires_at = rotation.expires_at.or(before.expires_at);
        if expires_at.is_some_and(|end| end <= now) {
            return Err(conflict("key_expired", "The key has come to its end. Say when the new one is to end."));
        }
        let overlap_ends = now + rotation.overlap;
        let previous_until = before.expires_at.map_or(overlap_ends, |end| end.min(overlap_ends));
        let key = ApiKey::generate()?;
        let row = query(
            "UPDATE clients SET previous_key_sha256 = key_sha256, previous_key_until = $4, key_sha256 = $3, expires_at = $5
             WHERE id = $1 AND organisation_id = $2 RETURNING *",
        )
        .bind(id)
        .bind(organisation)
        .bind(&key.digest()[..])
        .bind(ms_from_time(previous_until))
        .bind(expires_at.map(ms_from_time))
        .fetch_one(&mut transaction)
        .await?;
        transaction.commit().await?;
        self.known_keys.forget_all();
        Ok((client_from_row(&row)?, key))
    }
}
