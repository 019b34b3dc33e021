//! Failed sign-ins in a row, and how long they make the next one wait.
//!
//! What is counted is a name, whether it is somebody's or not, and an address; so an answer says nothing of who there is. The first
//! few failures cost nothing, then each doubles the wait up to a longest one (exponential lockout, OWASP Authentication Cheat Sheet),
//! and a name that has failed a hundred times in a row waits until an administrator resets it (NIST SP 800-63B-4, section 3.2.2, allows
//! no more). A name starts anew with a sign-in, an address only with time: otherwise one good account would buy guesses at others.
//! The rows outlive a restart.

use super::clock::{ms_from_time, time_from_ms};
use super::database::query;
use super::{StorageError, Store};
use sha2::{Digest, Sha256};
use std::net::IpAddr;
use time::{Duration, OffsetDateTime};

/// Failures of a name that cost nothing: people mistype.
const FREE_FOR_NAME: u32 = 5;
/// Failures of an address that cost nothing: behind one there may be a whole house.
const FREE_FOR_ADDRESS: u32 = 20;
/// The first wait; each further failure doubles it.
const FIRST_WAIT: Duration = Duration::seconds(30);
/// Longest wait of a name.
const LONGEST_FOR_NAME: Duration = Duration::HOUR;
/// Longest wait of an address, which others may need.
const LONGEST_FOR_ADDRESS: Duration = Duration::minutes(15);
/// Failures of a name in a row after which only an administrator helps.
const MOST_FOR_NAME: u32 = 100;
/// Failures are in a row when no more than this lies between two of them.
const FORGOTTEN_AFTER: Duration = Duration::days(30);
/// An address is forgotten sooner: tomorrow it may be somebody else's.
const ADDRESS_FORGOTTEN_AFTER: Duration = Duration::DAY;

/// Whom a failed sign-in concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Concerned<'a> {
    /// Whoever has this name, or nobody.
    Name(&'a str),
    /// Whoever comes from this address.
    Address(IpAddr),
}

impl Concerned<'_> {
    fn digest(self) -> [u8; 32] {
        let text = match self {
            Self::Name(name) => format!("name {name}"),
            Self::Address(address) => format!("address {address}"),
        };
        Sha256::digest(text).into()
    }

    /// The wait after so many failures in a row; none where nothing but a reset ends it.
    fn wait_after(self, failures: u32) -> Option<Duration> {
        let (free, longest) = match self {
            Self::Name(_) => (FREE_FOR_NAME, LONGEST_FOR_NAME),
            Self::Address(_) => (FREE_FOR_ADDRESS, LONGEST_FOR_ADDRESS),
        };
        if matches!(self, Self::Name(_)) && failures >= MOST_FOR_NAME {
            return None;
        }
        match failures.saturating_sub(free) {
            0 => Some(Duration::ZERO),
            // Beyond some ten doublings the longest wait holds anyway.
            further => Some((FIRST_WAIT * 2_i32.pow(further.min(12) - 1)).min(longest)),
        }
    }

    fn forgotten_after(self) -> Duration {
        match self {
            Self::Name(_) => FORGOTTEN_AFTER,
            Self::Address(_) => ADDRESS_FORGOTTEN_AFTER,
        }
    }
}

/// Whether a sign-in may be tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaySignIn {
    /// At once.
    Now,
    /// After this time.
    After(Duration),
    /// Not before an administrator has reset the password.
    AfterReset,
}

impl Store {
    /// Whether somebody may try to sign in who is known by all of these.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn may_sign_in(&self, concerned: &[Concerned<'_>]) -> Result<MaySignIn, StorageError> {
        let now = self.now();
        let mut wait = Duration::ZERO;
        for one in concerned {
            let row = query("SELECT failures, wait_until FROM sign_in_failures WHERE concerned_sha256 = $1")
                .bind(&one.digest()[..])
                .fetch_optional(self.reader())
                .await?;
            let Some(row) = row else { continue };
            if one.wait_after(super::row::small(&row, "failures")?).is_none() {
                return Ok(MaySignIn::AfterReset);
            }
            let until = time_from_ms(row.try_get("wait_until")?).unwrap_or(OffsetDateTime::UNIX_EPOCH);
            wait = wait.max(until - now);
        }
        Ok(if wait.is_positive() { MaySignIn::After(wait) } else { MaySignIn::Now })
    }

    /// Counts a failed sign-in against all whom it concerns. Rows that no longer matter go on the way.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn note_failed_sign_in(&self, concerned: &[Concerned<'_>]) -> Result<(), StorageError> {
        let now = self.now();
        let mut transaction = self.begin().await?;
        query("DELETE FROM sign_in_failures WHERE last_at <= $1")
            .bind(ms_from_time(now - FORGOTTEN_AFTER))
            .execute(&mut transaction)
            .await?;
        for one in concerned {
            let row = query(
                "INSERT INTO sign_in_failures (concerned_sha256, failures, last_at, wait_until) VALUES ($1, 1, $2, $2)
                 ON CONFLICT (concerned_sha256) DO UPDATE SET last_at = excluded.last_at,
                     failures = CASE WHEN sign_in_failures.last_at <= $3 THEN 1 ELSE sign_in_failures.failures + 1 END
                 RETURNING failures",
            )
            .bind(&one.digest()[..])
            .bind(ms_from_time(now))
            .bind(ms_from_time(now - one.forgotten_after()))
            .fetch_one(&mut transaction)
            .await?;
            let failures = super::row::small(&row, "failures")?;
            let wait = one.wait_after(failures);
            query("UPDATE sign_in_failures SET wait_until = $2 WHERE concerned_sha256 = $1")
                .bind(&one.digest()[..])
                .bind(ms_from_time(now + wait.unwrap_or(Duration::ZERO)))
                .execute(&mut transaction)
                .await?;
            if wait != Some(Duration::ZERO) {
                let wait_s = wait.map(Duration::whole_seconds);
                let kind = if matches!(one, Concerned::Name(_)) { "name" } else { "address" };
                tracing::warn!(event = "sign_in_locked", kind, failures, wait_s, "sign-ins have to wait");
            }
        }
        transaction.commit().await
    }

    /// Forgets the failures of a name: somebody has signed in with it, or it was reset.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn forget_failed_sign_ins(&self, name: &str) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        query("DELETE FROM sign_in_failures WHERE concerned_sha256 = $1")
            .bind(&Concerned::Name(name).digest()[..])
            .execute(&mut transaction)
            .await?;
        transaction.commit().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::Clinic;

    const NAME: Concerned<'static> = Concerned::Name("lee");

    async fn fail(clinic: &Clinic, concerned: Concerned<'_>, times: u32) {
        for _ in 0..times {
            clinic.store.note_failed_sign_in(&[concerned]).await.unwrap();
        }
    }

    async fn may(clinic: &Clinic, concerned: Concerned<'_>) -> MaySignIn {
        clinic.store.may_sign_in(&[concerned]).await.unwrap()
    }

    #[tokio::test]
    async fn each_failure_after_the_fifth_doubles_the_wait_up_to_an_hour() {
        let clinic = Clinic::open().await;
        fail(&clinic, NAME, 5).await;
        assert_eq!(may(&clinic, NAME).await, MaySignIn::Now);
        for wait_s in [30, 60, 120, 240, 480, 960, 1920, 3600, 3600] {
            fail(&clinic, NAME, 1).await;
            assert_eq!(may(&clinic, NAME).await, MaySignIn::After(Duration::seconds(wait_s)));
        }
        clinic.clock.advance(Duration::HOUR);
        assert_eq!(may(&clinic, NAME).await, MaySignIn::Now);
        assert_eq!(may(&clinic, Concerned::Name("kim")).await, MaySignIn::Now);
        clinic.store.forget_failed_sign_ins("lee").await.unwrap();
        fail(&clinic, NAME, 5).await;
        assert_eq!(may(&clinic, NAME).await, MaySignIn::Now);
    }

    #[tokio::test]
    async fn after_a_hundred_failures_in_a_row_only_a_reset_helps() {
        let clinic = Clinic::open().await;
        fail(&clinic, NAME, 100).await;
        clinic.clock.advance(Duration::days(29));
        assert_eq!(may(&clinic, NAME).await, MaySignIn::AfterReset);
        clinic.store.forget_failed_sign_ins("lee").await.unwrap();
        assert_eq!(may(&clinic, NAME).await, MaySignIn::Now);
    }

    #[tokio::test]
    async fn an_address_has_more_patience_and_is_forgotten_after_a_day() {
        let clinic = Clinic::open().await;
        let address = Concerned::Address([203, 0, 113, 7].into());
        fail(&clinic, address, 20).await;
        assert_eq!(may(&clinic, address).await, MaySignIn::Now);
        fail(&clinic, address, 80).await;
        assert_eq!(may(&clinic, address).await, MaySignIn::After(Duration::minutes(15)));
        clinic.clock.advance(Duration::DAY);
        fail(&clinic, address, 1).await;
        assert_eq!(may(&clinic, address).await, MaySignIn::Now);
    }
}
