//! People: local users with a password, and users of an identity provider. Each is a client too, so that all that a client makes can
//! name its maker, and all that ends a client ends a user.

mod common_passwords;
mod password;
mod provided;
mod sign_in;

pub use password::{LONGEST as LONGEST_PASSWORD, Password, SHORTEST as SHORTEST_PASSWORD};
pub use provided::Provided;
pub use sign_in::SignIn;

use super::clients::{ApiKey, Client, client_from_row};
use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::{ClientId, OrganisationId, Role, StorageError, Store};
use time::OffsetDateTime;
use tokio::task::spawn_blocking;

/// Somebody who signs in, as administrators see them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct User {
    /// The user as a client: identity, role, label, since when disabled, last use.
    pub client: Client,
    /// Name at the sign-in; none for a user of an identity provider.
    pub name: Option<String>,
    /// True until the user has replaced the password that was given out.
    pub must_change_password: bool,
    /// Issuer of the tokens; none for a local user.
    pub issuer: Option<String>,
    /// Who the user is to the issuer.
    pub subject: Option<String>,
}

/// A user to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewUser {
    /// Name at the sign-in, as [`is_user_name`] has it.
    pub name: String,
    /// What the user may do; not a device.
    pub role: Role,
    /// Who it is, for people.
    pub label: String,
}

/// True of a name for the sign-in: 3 to 64 lower-case letters, digits, `.`, `_` and `-`, beginning with a letter or digit.
pub fn is_user_name(name: &str) -> bool {
    let is_word = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit();
    (3..=64).contains(&name.len())
        && name.bytes().next().is_some_and(is_word)
        && name.bytes().all(|b| is_word(b) || b"._-".contains(&b))
}

/// Users with what they are as clients, under a condition.
macro_rules! users_where {
    ($condition:literal) => {
        concat!(
            "SELECT c.*, u.name, u.must_change_password, u.issuer, u.subject FROM users u JOIN clients c ON c.id = u.id WHERE ",
            $condition
        )
    };
}
use users_where;

fn user_from_row(row: &Row) -> Result<User, StorageError> {
    Ok(User {
        client: client_from_row(row)?,
        name: row.try_get("name")?,
        must_change_password: row.try_get("must_change_password")?,
        issuer: row.try_get("issuer")?,
        subject: row.try_get("subject")?,
    })
}

/// The row of a user among the clients. Its key digest is of a key that nobody is told.
async fn insert_client(
    connection: &mut Transaction,
    organisation: OrganisationId,
    role: Role,
    label: &str,
    now: OffsetDateTime,
) -> Result<ClientId, StorageError> {
    let id = ClientId::new();
    let inserted = query(
        "INSERT INTO clients (id, organisation_id, role, label, key_sha256, created_at, kind)
         SELECT $1, o.id, $3, $4, $5, $6, 'user' FROM organisations o WHERE o.id = $2",
    )
    .bind(id)
    .bind(organisation)
    .bind(role.name())
    .bind(label)
    .bind(&ApiKey::generate()?.digest()[..])
    .bind(ms_from_time(now))
    .execute(connection)
    .await?;
    if inserted == 0 {
        return Err(StorageError::not_found("organisation"));
    }
    Ok(id)
}

impl Store {
    /// Makes a local user with a password that is shown once and must be changed at the first sign-in.
    ///
    /// # Errors
    /// `Conflict` with code `user_name_taken`: names are unique in the installation, because the sign-in asks for nothing else.
    /// `NotFound` when the organisation does not exist.
    pub async fn create_user(
        &self,
        organisation: OrganisationId,
        new: &NewUser,
    ) -> Result<(User, Password), StorageError> {
        let password = Password::generate()?;
        let digest = self.digest_of(&password).await?;
        let now = self.now();
        let mut transaction = self.begin().await?;
        let id = insert_client(&mut transaction, organisation, new.role, &new.label, now).await?;
        query(
            "INSERT INTO users (id, organisation_id, name, password_hash, must_change_password, created_at)
             VALUES ($1, $2, $3, $4, TRUE, $5)",
        )
        .bind(id)
        .bind(organisation)
        .bind(&new.name)
        .bind(digest)
        .bind(ms_from_time(now))
        .execute(&mut transaction)
        .await
        .map_err(|error| {
            StorageError::conflict_if_not_unique(error, "user_name_taken", || {
                format!("There is already a user with the name `{}`. Choose another.", new.name)
            })
        })?;
        transaction.commit().await?;
        Ok((self.user(organisation, id).await?, password))
    }

    /// Work that is slow on purpose stays off the threads that serve requests, and only a few do it at the same time: each digest
    /// takes 19 MiB and a core.
    async fn slowly<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, StorageError> {
        // Nobody closes the semaphore.
        let _turn = self.password_turns.acquire().await;
        let done = spawn_blocking(work).await;
        done.map_err(|panic| StorageError::Corrupt(format!("a password's digest failed: {panic}")))
    }

    /// The digest of a password.
    async fn digest_of(&self, password: &Password) -> Result<String, StorageError> {
        let password = password.clone();
        self.slowly(move || password.digest()).await?
    }

    /// One user of the organisation.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn user(&self, organisation: OrganisationId, id: ClientId) -> Result<User, StorageError> {
        let row = query(users_where!("u.organisation_id = $1 AND u.id = $2"))
            .bind(organisation)
            .bind(id)
            .fetch_optional(self.reader())
            .await?
            .ok_or(StorageError::not_found("user"))?;
        user_from_row(&row)
    }

    /// The users of the organisation, oldest first, disabled ones too.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn users(&self, organisation: OrganisationId) -> Result<Vec<User>, StorageError> {
        let rows = query(users_where!("u.organisation_id = $1 ORDER BY u.id"))
            .bind(organisation)
            .fetch_all(self.reader())
            .await?;
        rows.iter().map(user_from_row).collect()
    }

    /// Gives a local user another password, which is shown once and must be changed at the next sign-in. What the user was signed in
    /// to ends, and failed sign-ins are forgotten.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such user; `Conflict` with code `user_disabled`, or `user_without_password` for one
    /// of an identity provider.
    pub async fn reset_user(
        &self,
        organisation: OrganisationId,
        id: ClientId,
    ) -> Result<(User, Password), StorageError> {
        let conflict = |code, sentence: &str| StorageError::Conflict { code, sentence: sentence.to_owned() };
        let user = self.user(organisation, id).await?;
        let Some(name) = &user.name else {
            let sentence = "This user signs in with an identity provider, which keeps the password.";
            return Err(conflict("user_without_password", sentence));
        };
        if user.client.revoked_at.is_some() {
            return Err(conflict("user_disabled", "This user is disabled. Make a new one instead."));
        }
        let password = Password::generate()?;
        self.set_password(id, &password, true).await?;
        self.forget_failed_sign_ins(name).await?;
        Ok((self.user(organisation, id).await?, password))
    }

    /// Replaces a user's password. What the user was signed in to ends.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn set_password(
        &self,
        user: ClientId,
        password: &Password,
        must_change: bool,
    ) -> Result<(), StorageError> {
        let digest = self.digest_of(password).await?;
        let mut transaction = self.begin().await?;
        query(
            "UPDATE users SET password_hash = $2, must_change_password = $3, password_changed_at = $4
             WHERE id = $1 AND password_hash IS NOT NULL",
        )
        .bind(user)
        .bind(digest)
        .bind(must_change)
        .bind(ms_from_time(self.now()))
        .execute(&mut transaction)
        .await?;
        end_sessions(&mut transaction, user).await?;
        transaction.commit().await
    }

    /// Takes a user out of use, at once, and ends what the user was signed in to. Doing it again changes nothing.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such user.
    pub async fn disable_user(&self, organisation: OrganisationId, id: ClientId) -> Result<User, StorageError> {
        let mut transaction = self.begin().await?;
        let disabled = query(
            "UPDATE clients SET revoked_at = coalesce(revoked_at, $3)
             WHERE id = $1 AND organisation_id = $2 AND kind = 'user'",
        )
        .bind(id)
        .bind(organisation)
        .bind(ms_from_time(self.now()))
        .execute(&mut transaction)
        .await?;
        if disabled == 0 {
            return Err(StorageError::not_found("user"));
        }
        end_sessions(&mut transaction, id).await?;
        transaction.commit().await?;
        self.user(organisation, id).await
    }
}

async fn end_sessions(connection: &mut Transaction, client: ClientId) -> Result<(), StorageError> {
    query("DELETE FROM page_sessions WHERE client_id = $1").bind(client).execute(connection).await?;
    Ok(())
}

#[cfg(test)]
mod tests;
