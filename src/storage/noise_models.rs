//! Noise models that the service has trained. Written once, together with the end of their job, and never changed.

use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::{Access, JobId, NoiseModelId, Page, PageRequest, StorageError, Store, row};
use crate::assessment::{NoiseModel, NoiseModelName};
use time::OffsetDateTime;

/// A trained noise model of an organisation.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredNoiseModel {
    /// Identity.
    pub id: NoiseModelId,
    /// The job that trained it.
    pub job_id: JobId,
    /// The model; its name and version are in it.
    pub model: NoiseModel,
    /// SHA-256 of its document, lower-case hexadecimal.
    pub sha256: String,
    /// When it was stored.
    pub created_at: OffsetDateTime,
}

fn noise_model_from_row(row: &Row) -> Result<StoredNoiseModel, StorageError> {
    Ok(StoredNoiseModel {
        id: row.try_get("id")?,
        job_id: row.try_get("job_id")?,
        model: row::json(row, "document")?,
        sha256: row.try_get("sha256")?,
        created_at: row::time(row, "created_at")?,
    })
}

/// Inserts a model as the next version of its name, inside the transaction that ends its job.
pub(crate) async fn insert(
    connection: &mut Transaction,
    job_id: JobId,
    model: NoiseModel,
    now: OffsetDateTime,
) -> Result<NoiseModelId, StorageError> {
    connection.exclusively("versions of noise models").await?;
    let newest: Option<i64> = query(
        "SELECT max(n.version) FROM noise_models n JOIN jobs j ON j.organisation_id = n.organisation_id
         WHERE j.id = $1 AND n.name = $2",
    )
    .bind(job_id)
    .bind(&model.document().name)
    .fetch_value(&mut *connection)
    .await?;
    let version = u32::try_from(newest.unwrap_or(0) + 1)
        .map_err(|_| StorageError::Corrupt("a noise model has more versions than can be counted".into()))?;
    let model = model.with_version(version);
    let id = NoiseModelId::new();
    query(
        "INSERT INTO noise_models (id, organisation_id, job_id, name, version, sha256, document, created_at)
         SELECT $1, j.organisation_id, j.id, $3, $4, $5, $6, $7 FROM jobs j WHERE j.id = $2",
    )
    .bind(id)
    .bind(job_id)
    .bind(&model.document().name)
    .bind(version)
    .bind(model.sha256())
    .bind(row::readable_json("a noise model", &model)?)
    .bind(ms_from_time(now))
    .execute(connection)
    .await?;
    Ok(id)
}

impl Store {
    /// One trained model of the organisation.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn noise_model(&self, access: &Access, id: NoiseModelId) -> Result<StoredNoiseModel, StorageError> {
        let row = query("SELECT * FROM noise_models WHERE organisation_id = $1 AND id = $2")
            .bind(access.organisation)
            .bind(id)
            .fetch_optional(self.reader())
            .await?
            .ok_or(StorageError::not_found("noise model"))?;
        noise_model_from_row(&row)
    }

    /// The organisation's model of a name: the version that is meant, or else the newest.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn noise_model_named(
        &self,
        access: &Access,
        name: &NoiseModelName,
    ) -> Result<StoredNoiseModel, StorageError> {
        let row = query(
            "SELECT * FROM noise_models WHERE organisation_id = $1 AND name = $2 AND ($3 IS NULL OR version = $3)
             ORDER BY version DESC LIMIT 1",
        )
        .bind(access.organisation)
        .bind(&name.name)
        .bind(name.version)
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("noise model"))?;
        noise_model_from_row(&row)
    }

    /// Names of the organisation's trained models, at most `limit`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn names_of_noise_models(&self, access: &Access, limit: u32) -> Result<Vec<String>, StorageError> {
        let names = query("SELECT DISTINCT name FROM noise_models WHERE organisation_id = $1 ORDER BY name LIMIT $2");
        Ok(names.bind(access.organisation).bind(limit).fetch_values(self.reader()).await?)
    }

    /// The organisation's trained models, newest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn noise_models(
        &self,
        access: &Access,
        page: &PageRequest<NoiseModelId>,
    ) -> Result<Page<StoredNoiseModel, NoiseModelId>, StorageError> {
        let rows = query("SELECT * FROM noise_models WHERE organisation_id = $1 AND id < $2 ORDER BY id DESC LIMIT $3")
            .bind(access.organisation)
            .bind(page.cursor())
            .bind(page.rows())
            .fetch_all(self.reader())
            .await?;
        let models = rows.iter().map(noise_model_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(models, page, |model| model.id))
    }

    /// The model that a job's settings name, for the worker, which serves every organisation.
    ///
    /// # Errors
    /// `NotFound` when the job's organisation has none of this name and version.
    pub async fn noise_model_of_job(&self, job: JobId, name: &NoiseModelName) -> Result<NoiseModel, StorageError> {
        let row = query(
            "SELECT n.* FROM noise_models n JOIN jobs j ON j.organisation_id = n.organisation_id
             WHERE j.id = $1 AND n.name = $2 AND ($3 IS NULL OR n.version = $3)
             ORDER BY n.version DESC LIMIT 1",
        )
        .bind(job)
        .bind(&name.name)
        .bind(name.version)
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("noise model"))?;
        Ok(noise_model_from_row(&row)?.model)
    }
}
