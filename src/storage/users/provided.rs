//! Users of an identity provider, made known when their first token comes.

use super::insert_client;
use crate::storage::clients::{Client, client_from_row};
use crate::storage::clock::ms_from_time;
use crate::storage::database::query;
use crate::storage::{Role, StorageError, Store};
use time::{Duration, OffsetDateTime};

/// `last_used_at` of a user is exact to the minute, as that of a key.
const USE_RESOLUTION: Duration = Duration::MINUTE;

/// What a valid token says of whoever brings it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provided {
    /// The issuer, as configured.
    pub issuer: String,
    /// Who it is to the issuer; never another.
    pub subject: String,
    /// Name of the organisation, which must be there already.
    pub organisation: String,
    /// What the user may do.
    pub role: Role,
    /// Who it is, for people.
    pub label: String,
}

impl Store {
    /// The user of a token, made or brought up to date by what the token says. None when the user is disabled here, or there is no such
    /// organisation. Whoever comes for another organisation than before is another user: what was made stays behind its walls.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn user_of_token(&self, provided: &Provided) -> Result<Option<Client>, StorageError> {
        let now = self.now();
        if let Some(client) = self.provided_client(provided).await? {
            return self.up_to_date(client, provided, now).await;
        }
        let Ok(organisation) = self.organisation_named(&provided.organisation).await else { return Ok(None) };
        let mut transaction = self.begin().await?;
        let id = insert_client(&mut transaction, organisation.id, provided.role, &provided.label, now).await?;
        let made = query(
            "INSERT INTO users (id, organisation_id, issuer, subject, created_at) VALUES ($1, $2, $3, $4, $5)
             ON CONFLICT (issuer, subject, organisation_id) DO NOTHING",
        )
        .bind(id)
        .bind(organisation.id)
        .bind(&provided.issuer)
        .bind(&provided.subject)
        .bind(ms_from_time(now))
        .execute(&mut transaction)
        .await?;
        // Two first requests at the same time make one user.
        if made == 1 {
            transaction.commit().await?;
            tracing::info!(event = "user_made", user = %id, "a token made its user known");
        } else {
            transaction.rollback().await?;
        }
        match self.provided_client(provided).await? {
            Some(client) => self.up_to_date(client, provided, now).await,
            None => Ok(None),
        }
    }

    async fn provided_client(&self, provided: &Provided) -> Result<Option<Client>, StorageError> {
        let row = query(
            "SELECT c.* FROM users u JOIN clients c ON c.id = u.id JOIN organisations o ON o.id = u.organisation_id
             WHERE u.issuer = $1 AND u.subject = $2 AND o.name = $3",
        )
        .bind(&provided.issuer)
        .bind(&provided.subject)
        .bind(&provided.organisation)
        .fetch_optional(self.reader())
        .await?;
        row.as_ref().map(client_from_row).transpose()
    }

    async fn up_to_date(
        &self,
        mut client: Client,
        provided: &Provided,
        now: OffsetDateTime,
    ) -> Result<Option<Client>, StorageError> {
        if client.revoked_at.is_some() {
            return Ok(None);
        }
        if client.role != provided.role || client.label != provided.label {
            let mut transaction = self.begin().await?;
            query("UPDATE clients SET role = $2, label = $3 WHERE id = $1")
                .bind(client.id)
                .bind(provided.role.name())
                .bind(&provided.label)
                .execute(&mut transaction)
                .await?;
            transaction.commit().await?;
            client = Client { role: provided.role, label: provided.label.clone(), ..client };
        }
        if client.last_used_at.is_none_or(|last| now - last >= USE_RESOLUTION) {
            self.note_use(client.id, now).await?;
            client.last_used_at = Some(now);
        }
        Ok(Some(client))
    }
}
