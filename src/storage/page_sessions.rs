//! Who is signed in to the pages. The token of a session is 256 random bits in a cookie; the database holds its SHA-256 only.

use super::clients::{self, Client};
use super::clock::ms_from_time;
use super::database::query;
use super::{ClientId, StorageError, Store};
use rand::TryRng;
use rand::rngs::SysRng;
use sha2::{Digest, Sha256};
use std::fmt;
use time::{Duration, OffsetDateTime};

/// A session ends this long after its sign-in, whatever happens in it: one shift.
pub const LONGEST_SESSION: Duration = Duration::hours(12);
/// A session that is not used for this long is over: somebody left the screen.
pub const LONGEST_PAUSE: Duration = Duration::hours(1);
/// `last_used_at` is exact to the minute, so that a page with ten requests costs one write.
const USE_RESOLUTION: Duration = Duration::MINUTE;

/// The secret of one session, as the cookie carries it.
#[derive(Clone, PartialEq, Eq)]
pub struct PageToken(String);

impl PageToken {
    fn generate() -> Result<Self, StorageError> {
        let mut bits = [0u8; 32];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| StorageError::Randomness(error.to_string()))?;
        Ok(Self(hex::encode(bits)))
    }

    /// A token as a request brings it; any text will do, but only a true token is somebody's.
    pub fn from_text(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// The secret text, for the cookie.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.0.as_bytes()).into()
    }
}

impl fmt::Debug for PageToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PageToken(…)")
    }
}

impl Store {
    /// Signs a client in. Sessions that are over are removed on the way.
    ///
    /// # Errors
    /// When the database or the source of random numbers fails.
    pub async fn begin_page_session(&self, client: ClientId) -> Result<PageToken, StorageError> {
        let token = PageToken::generate()?;
        let now = self.now();
        let mut transaction = self.begin().await?;
        query("DELETE FROM page_sessions WHERE expires_at <= $1 OR last_used_at <= $2")
            .bind(ms_from_time(now))
            .bind(ms_from_time(now - LONGEST_PAUSE))
            .execute(&mut transaction)
            .await?;
        query(
            "INSERT INTO page_sessions (token_sha256, client_id, created_at, last_used_at, expires_at)
             VALUES ($1, $2, $3, $3, $4)",
        )
        .bind(&token.digest()[..])
        .bind(client)
        .bind(ms_from_time(now))
        .bind(ms_from_time(now + LONGEST_SESSION))
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        Ok(token)
    }

    /// Who is signed in with this token; none when the session is over, the client's key was revoked or has expired, or the client is a
    /// user who has to change the password first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn client_of_page_session(&self, token: &PageToken) -> Result<Option<Client>, StorageError> {
        let Some(client) = self.client_behind_page_session(token).await? else { return Ok(None) };
        let waits: i64 = query("SELECT count(*) FROM users WHERE id = $1 AND must_change_password")
            .bind(client.id)
            .fetch_value(self.reader())
            .await?;
        Ok((waits == 0).then_some(client))
    }

    /// Whose session this is, whatever has to be done first.
    pub(super) async fn client_behind_page_session(&self, token: &PageToken) -> Result<Option<Client>, StorageError> {
        let now = self.now();
        let row = query(
            "SELECT c.*, p.last_used_at AS page_used_at
             FROM page_sessions p JOIN clients c ON c.id = p.client_id
             WHERE p.token_sha256 = $1 AND p.expires_at > $2 AND p.last_used_at > $3 AND c.revoked_at IS NULL
               AND (c.expires_at IS NULL OR c.expires_at > $2)",
        )
        .bind(&token.digest()[..])
        .bind(ms_from_time(now))
        .bind(ms_from_time(now - LONGEST_PAUSE))
        .fetch_optional(self.reader())
        .await?;
        let Some(row) = row else { return Ok(None) };
        let used_at: OffsetDateTime = super::row::time(&row, "page_used_at")?;
        if now - used_at >= USE_RESOLUTION {
            let mut transaction = self.begin().await?;
            query("UPDATE page_sessions SET last_used_at = $2 WHERE token_sha256 = $1 AND last_used_at < $2")
                .bind(&token.digest()[..])
                .bind(ms_from_time(now))
                .execute(&mut transaction)
                .await?;
            transaction.commit().await?;
        }
        clients::client_from_row(&row).map(Some)
    }

    /// Signs out. A token that is nobody's changes nothing.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn end_page_session(&self, token: &PageToken) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        query("DELETE FROM page_sessions WHERE token_sha256 = $1")
            .bind(&token.digest()[..])
            .execute(&mut transaction)
            .await?;
        transaction.commit().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::Clinic;

    async fn is_signed_in(clinic: &Clinic, token: &PageToken) -> bool {
        clinic.store.client_of_page_session(token).await.unwrap().is_some()
    }

    #[tokio::test]
    async fn a_session_ends_after_an_hour_without_use_and_after_twelve_hours_with_it() {
        let clinic = Clinic::open().await;
        let idle = clinic.store.begin_page_session(clinic.admin.client).await.unwrap();
        let used = clinic.store.begin_page_session(clinic.admin.client).await.unwrap();
        for _ in 0..24 {
            assert!(is_signed_in(&clinic, &used).await);
            clinic.clock.advance(Duration::minutes(29));
        }
        assert!(!is_signed_in(&clinic, &idle).await);
        assert!(is_signed_in(&clinic, &used).await);
        clinic.clock.advance(Duration::minutes(29));
        assert!(!is_signed_in(&clinic, &used).await);
    }

    #[tokio::test]
    async fn a_revoked_key_and_a_sign_out_end_a_session_at_once() {
        let clinic = Clinic::open().await;
        let first = clinic.store.begin_page_session(clinic.admin.client).await.unwrap();
        let second = clinic.store.begin_page_session(clinic.admin.client).await.unwrap();
        clinic.store.end_page_session(&first).await.unwrap();
        assert!(!is_signed_in(&clinic, &first).await && is_signed_in(&clinic, &second).await);
        clinic.store.revoke_client(clinic.admin.organisation, clinic.admin.client).await.unwrap();
        assert!(!is_signed_in(&clinic, &second).await);
        assert!(!is_signed_in(&clinic, &PageToken::from_text("nobody's")).await);
    }

    #[tokio::test]
    async fn the_database_holds_no_token_and_forgets_sessions_that_are_over() {
        let clinic = Clinic::open().await;
        let token = clinic.store.begin_page_session(clinic.admin.client).await.unwrap();
        let stored: Vec<u8> =
            query("SELECT token_sha256 FROM page_sessions").fetch_value(clinic.store.reader()).await.unwrap();
        assert_ne!(hex::encode(stored), token.reveal());
        clinic.clock.advance(LONGEST_PAUSE);
        clinic.store.begin_page_session(clinic.admin.client).await.unwrap();
        let left: i64 = query("SELECT count(*) FROM page_sessions").fetch_value(clinic.store.reader()).await.unwrap();
        assert_eq!(left, 1);
    }
}
