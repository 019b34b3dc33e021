//! Signing in with name and password.

use super::super::sign_in_failures::{Concerned, MaySignIn};
use super::{Password, User, user_from_row, users_where};
use crate::storage::database::query;
use crate::storage::{StorageError, Store};
use std::net::IpAddr;
use time::Duration;

/// What becomes of a sign-in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SignIn {
    /// It is this user.
    Welcome(Box<User>),
    /// Name and password do not fit, or the user is disabled; it is not said which.
    Refused,
    /// Too many sign-ins have failed; the next may be tried after this time.
    Wait(Duration),
    /// So many sign-ins have failed that an administrator has to reset the password.
    Locked,
}

impl Store {
    /// Signs a local user in. Names that are nobody's are treated as if they were somebody's: the same answers, in the same time.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn sign_in(&self, name: &str, password: &Password, from: IpAddr) -> Result<SignIn, StorageError> {
        let name = name.trim().to_lowercase();
        let concerned = [Concerned::Name(&name), Concerned::Address(from)];
        match self.may_sign_in(&concerned).await? {
            MaySignIn::Now => {}
            MaySignIn::After(wait) => return Ok(SignIn::Wait(wait)),
            MaySignIn::AfterReset => return Ok(SignIn::Locked),
        }
        let row = query(
            "SELECT u.id, u.organisation_id, u.password_hash FROM users u JOIN clients c ON c.id = u.id
             WHERE u.name = $1 AND c.revoked_at IS NULL",
        )
        .bind(&name)
        .fetch_optional(self.reader())
        .await?;
        let digest: Option<String> = row.as_ref().map(|row| row.try_get("password_hash")).transpose()?;
        let typed = password.clone();
        let is_right = self.slowly(move || typed.matches(digest.as_deref())).await?;
        let Some(row) = row.filter(|_| is_right) else {
            self.note_failed_sign_in(&concerned).await?;
            tracing::warn!(event = "sign_in_refused", %from, "a sign-in with a password was refused");
            return Ok(SignIn::Refused);
        };
        self.forget_failed_sign_ins(&name).await?;
        let user = self.user(row.try_get("organisation_id")?, row.try_get("id")?).await?;
        self.note_use(user.client.id, self.now()).await?;
        tracing::info!(event = "signed_in", user = %user.client.id, %from, "a user has signed in");
        Ok(SignIn::Welcome(Box::new(user)))
    }

    /// The user who is signed in to the pages with this token, also one who has to change the password first; none for the session of
    /// a key.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn user_of_page_session(&self, token: &crate::storage::PageToken) -> Result<Option<User>, StorageError> {
        let Some(client) = self.client_behind_page_session(token).await? else { return Ok(None) };
        let row = query(users_where!("u.id = $1")).bind(client.id).fetch_optional(self.reader()).await?;
        row.as_ref().map(user_from_row).transpose()
    }
}
