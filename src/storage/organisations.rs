//! Organisations: the walls that no question crosses.

use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::{OrganisationId, StorageError, Store, row};
use time::OffsetDateTime;

/// A clinic, a practice, a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Organisation {
    /// Identity.
    pub id: OrganisationId,
    /// Name, unique.
    pub name: String,
    /// When it was made.
    pub created_at: OffsetDateTime,
}

fn organisation_from_row(row: &Row) -> Result<Organisation, StorageError> {
    Ok(Organisation { id: row.try_get("id")?, name: row.try_get("name")?, created_at: row::time(row, "created_at")? })
}

pub(super) async fn insert(
    connection: &mut Transaction,
    name: &str,
    now: OffsetDateTime,
) -> Result<Organisation, StorageError> {
    let id = OrganisationId::new();
    let row = query("INSERT INTO organisations (id, name, created_at) VALUES ($1, $2, $3) RETURNING *")
        .bind(id)
        .bind(name)
        .bind(ms_from_time(now))
        .fetch_one(connection)
        .await
        .map_err(|error| {
            StorageError::conflict_if_not_unique(error, "organisation_name_taken", || {
                format!("there is already an organisation named `{name}`")
            })
        })?;
    organisation_from_row(&row)
}

impl Store {
    /// Makes an organisation.
    ///
    /// # Errors
    /// `Conflict` with code `organisation_name_taken`.
    pub async fn create_organisation(&self, name: &str) -> Result<Organisation, StorageError> {
        let mut transaction = self.begin().await?;
        let organisation = insert(&mut transaction, name, self.now()).await?;
        transaction.commit().await?;
        Ok(organisation)
    }

    /// Every organisation, by name. For the operator at the machine, not for the API.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn organisations(&self) -> Result<Vec<Organisation>, StorageError> {
        let rows = query("SELECT * FROM organisations ORDER BY name").fetch_all(self.reader()).await?;
        rows.iter().map(organisation_from_row).collect()
    }

    /// The organisation of that name.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn organisation_named(&self, name: &str) -> Result<Organisation, StorageError> {
        let row = query("SELECT * FROM organisations WHERE name = $1")
            .bind(name)
            .fetch_optional(self.reader())
            .await?
            .ok_or(StorageError::not_found("organisation"))?;
        organisation_from_row(&row)
    }
}
