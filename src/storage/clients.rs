//! API clients and their keys. A key is 256 random bits; the database holds its SHA-256 only. A slow hash is for
//! passwords: nobody guesses 256 random bits.

use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::known_keys::{KeyDigest, Known};
use super::{Access, ClientId, OrganisationId, StorageError, Store, organisations, row};
use rand::TryRng;
use rand::rngs::SysRng;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;
use time::{Duration, OffsetDateTime};
use utoipa::ToSchema;

/// Begins every key, so that people and secret scanners recognise one.
const KEY_PREFIX: &str = "surefoot_";
/// `last_used_at` is for people who tidy up keys: a minute is exact enough, and costs no write per request.
const LAST_USE_RESOLUTION: Duration = Duration::MINUTE;
/// Name of the organisation that the first start makes.
const FIRST_ORGANISATION: &str = "default";

/// What a client may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Uploads, and reads its own sessions.
    Device,
    /// Reads the patients of its organisation.
    Clinician,
    /// Everything in its organisation, keys too.
    Admin,
}

impl Role {
    /// The word for the role at the API, at the command line, and in the database.
    pub fn name(self) -> &'static str {
        match self {
            Role::Device => "device",
            Role::Clinician => "clinician",
            Role::Admin => "admin",
        }
    }
}

/// A holder of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Client {
    /// Identity.
    pub id: ClientId,
    /// The organisation it belongs to.
    pub organisation_id: OrganisationId,
    /// What it may do.
    pub role: Role,
    /// Whose key it is, for people.
    pub label: String,
    /// True of a user, who has no key.
    pub is_user: bool,
    /// When the key was made.
    pub created_at: OffsetDateTime,
    /// From when on the key opens nothing; none for a key that does not end by itself.
    pub expires_at: Option<OffsetDateTime>,
    /// Since when the key opens nothing.
    pub revoked_at: Option<OffsetDateTime>,
    /// Until when the key before the last rotation opens as well.
    pub previous_key_until: Option<OffsetDateTime>,
    /// When the key was last used, to the minute.
    pub last_used_at: Option<OffsetDateTime>,
}

impl Client {
    /// True while the last use that the database knows of is recent enough to stand for one at `now`.
    fn was_used_lately(&self, now: OffsetDateTime) -> bool {
        self.last_used_at.is_some_and(|last| now - last < LAST_USE_RESOLUTION)
    }

    /// How far the client reaches.
    pub fn access(&self) -> Access {
        let is_device = self.role == Role::Device;
        Access {
            organisation: self.organisation_id,
            client: self.id,
            own_sessions_only: is_device,
            reaches_shared: !is_device,
        }
    }
}

/// Whose key it is, when somebody brings one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum KeyHolder {
    /// A client whose key is valid.
    Valid(Client),
    /// A client whose key has come to its end, or was replaced and its overlap is over.
    Expired,
    /// Nobody, or a client whose key was revoked.
    Unknown,
}

/// The text of a key. It exists only here, at the one time it is made, and with its holder.
#[derive(Clone, PartialEq, Eq)]
pub struct ApiKey(String);

impl ApiKey {
    pub(super) fn generate() -> Result<Self, StorageError> {
        let mut bits = [0u8; 32];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| StorageError::Randomness(error.to_string()))?;
        Ok(Self(format!("{KEY_PREFIX}{}", hex::encode(bits))))
    }

    /// A key as a request brings it; any text will do, but only a true key is somebody's.
    pub fn from_text(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// The secret text, to be shown once.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    pub(super) fn digest(&self) -> KeyDigest {
        Sha256::digest(self.0.as_bytes()).into()
    }
}

impl fmt::Debug for ApiKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ApiKey(…)")
    }
}

pub(super) fn client_from_row(row: &Row) -> Result<Client, StorageError> {
    Ok(Client {
        id: row.try_get("id")?,
        organisation_id: row.try_get("organisation_id")?,
        role: row::word(row, "role")?,
        label: row.try_get("label")?,
        is_user: row.try_get::<&str>("kind")? == "user",
        created_at: row::time(row, "created_at")?,
        expires_at: row::optional_time(row, "expires_at")?,
        revoked_at: row::optional_time(row, "revoked_at")?,
        previous_key_until: row::optional_time(row, "previous_key_until")?,
        last_used_at: row::optional_time(row, "last_used_at")?,
    })
}

async fn insert(
    connection: &mut Transaction,
    organisation: OrganisationId,
    role: Role,
    label: &str,
    expires_at: Option<OffsetDateTime>,
    now: OffsetDateTime,
) -> Result<(Client, ApiKey), StorageError> {
    let key = ApiKey::generate()?;
    let row = query(
        "INSERT INTO clients (id, organisation_id, role, label, key_sha256, created_at, expires_at)
         SELECT $1, o.id, $3, $4, $5, $6, $7 FROM organisations o WHERE o.id = $2 RETURNING *",
    )
    .bind(ClientId::new())
    .bind(organisation)
    .bind(role.name())
    .bind(label)
    .bind(&key.digest()[..])
    .bind(ms_from_time(now))
    .bind(expires_at.map(ms_from_time))
    .fetch_optional(connection)
    .await?
    .ok_or(StorageError::not_found("organisation"))?;
    Ok((client_from_row(&row)?, key))
}

impl Store {
    /// Makes a client and its key, which does not end by itself. The key is not stored and cannot be shown again.
    ///
    /// # Errors
    /// `NotFound` when the organisation does not exist.
    pub async fn create_client(
        &self,
        organisation: OrganisationId,
        role: Role,
        label: &str,
    ) -> Result<(Client, ApiKey), StorageError> {
        self.create_client_until(organisation, role, label, None).await
    }

    /// Like [`Store::create_client`]; the key ends at a time, when one is given.
    ///
    /// # Errors
    /// `NotFound` when the organisation does not exist.
    pub async fn create_client_until(
        &self,
        organisation: OrganisationId,
        role: Role,
        label: &str,
        expires_at: Option<OffsetDateTime>,
    ) -> Result<(Client, ApiKey), StorageError> {
        let mut transaction = self.begin().await?;
        let made = insert(&mut transaction, organisation, role, label, expires_at, self.now()).await?;
        transaction.commit().await?;
        Ok(made)
    }

    /// Makes an organisation and its first admin when there is no client at all: the first start. The key is to be
    /// shown once. Two processes that start at the same time make one admin.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn ensure_first_admin(&self) -> Result<Option<ApiKey>, StorageError> {
        let mut transaction = self.begin().await?;
        transaction.exclusively("first admin").await?;
        let clients: i64 = query("SELECT count(*) FROM clients").fetch_value(&mut transaction).await?;
        if clients > 0 {
            return Ok(None);
        }
        let now = self.now();
        let existing: Option<OrganisationId> =
            query("SELECT id FROM organisations ORDER BY id LIMIT 1").fetch_optional_value(&mut transaction).await?;
        let organisation = match existing {
            Some(id) => id,
            None => organisations::insert(&mut transaction, FIRST_ORGANISATION, now).await?.id,
        };
        let (_, key) = insert(&mut transaction, organisation, Role::Admin, "first admin", None, now).await?;
        transaction.commit().await?;
        Ok(Some(key))
    }

    /// Whose valid key this is; `None` for every other.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn client_of_key(&self, key: &ApiKey) -> Result<Option<Client>, StorageError> {
        Ok(match self.holder_of_key(key).await? {
            KeyHolder::Valid(client) => Some(client),
            KeyHolder::Expired | KeyHolder::Unknown => None,
        })
    }

    /// Whose key this is, and whether it still opens.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn holder_of_key(&self, key: &ApiKey) -> Result<KeyHolder, StorageError> {
        let digest = key.digest();
        let now = self.now();
        let changes = match self.known_keys.look_up(&digest, now) {
            Known::Client(client) if client.was_used_lately(now) => return Ok(KeyHolder::Valid(client)),
            Known::Client(_) => self.known_keys.changes(),
            Known::Nothing { changes } => changes,
        };
        // Comparing digests in the index leaks at most a prefix of a digest, from which no key can be made.
        let row =
            query("SELECT * FROM clients WHERE revoked_at IS NULL AND (key_sha256 = $1 OR previous_key_sha256 = $1)")
                .bind(&digest[..])
                .fetch_optional(self.reader())
                .await?;
        let Some(row) = row else { return Ok(KeyHolder::Unknown) };
        let mut client = client_from_row(&row)?;
        let is_newest = row.try_get::<&[u8]>("key_sha256")? == digest;
        let overlap = if is_newest { None } else { client.previous_key_until };
        let valid_until = [client.expires_at, overlap].into_iter().flatten().min();
        if valid_until.is_some_and(|end| end <= now) {
            return Ok(KeyHolder::Expired);
        }
        if !client.was_used_lately(now) {
            self.note_use(client.id, now).await?;
            client.last_used_at = Some(now);
        }
        self.known_keys.remember(digest, &client, valid_until, changes);
        Ok(KeyHolder::Valid(client))
    }

    pub(super) async fn note_use(&self, client: ClientId, now: OffsetDateTime) -> Result<(), StorageError> {
        let mut transaction = self.begin().await?;
        query("UPDATE clients SET last_used_at = $2 WHERE id = $1 AND (last_used_at IS NULL OR last_used_at < $2)")
            .bind(client)
            .bind(ms_from_time(now))
            .execute(&mut transaction)
            .await?;
        transaction.commit().await
    }

    /// The holders of keys of the organisation, oldest first, revoked ones too; users are others' question.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn clients(&self, organisation: OrganisationId) -> Result<Vec<Client>, StorageError> {
        let rows = query("SELECT * FROM clients WHERE organisation_id = $1 AND kind = 'key' ORDER BY id")
            .bind(organisation)
            .fetch_all(self.reader())
            .await?;
        rows.iter().map(client_from_row).collect()
    }

    /// Takes a key out of use, at once. Doing it again changes nothing.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such client.
    pub async fn revoke_client(&self, organisation: OrganisationId, id: ClientId) -> Result<Client, StorageError> {
        let mut transaction = self.begin().await?;
        let row = query(
            "UPDATE clients SET revoked_at = coalesce(revoked_at, $3)
             WHERE id = $1 AND organisation_id = $2 AND kind = 'key' RETURNING *",
        )
        .bind(id)
        .bind(organisation)
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut transaction)
        .await?
        .ok_or(StorageError::not_found("client"))?;
        transaction.commit().await?;
        self.known_keys.forget_all();
        client_from_row(&row)
    }
}
