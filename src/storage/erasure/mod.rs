//! Erasure of a patient: everything that is theirs, in rows, blobs, and what deleted rows leave behind in files.
//!
//! 1. One transaction removes the rows, writes the record of the erasure with the blobs that are to go, and its audit entry.
//! 2. Uploads of the patient that are under way in this process end.
//! 3. The hash of the patient's id goes into the list of erasures, a file beside the database, so that a backup from before can
//!    be rid of the patient when it is restored.
//! 4. Blobs that no other recording names are removed.
//! 5. The database file and its log are rid of remnants (`Store::purge_remnants`).
//!
//! A crash after the first step leaves a record that is not done; [`Store::resume_erasures`] goes on with it. The record knows the
//! patient by a keyed hash only. A worker that computes meanwhile finds no job any more when it comes back.

mod list;
mod rows;

pub(super) use list::LIST_FILE;

use super::audit::{Actor, AuditEvent, Hash, Thing};
use super::blobs::key_of_digest;
use super::clock::ms_from_time;
use super::{ErasureId, JobId, OrganisationId, PatientId, StorageError, Store, row};
use crate::storage::database::{Row, Transaction, query};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::time::Duration;
use time::OffsetDateTime;
use utoipa::ToSchema;

/// How long an erasure waits for uploads of the patient to end; they are told to, and need no longer than a batch of bytes.
const UPLOADS_END_WITHIN: Duration = Duration::from_secs(10);

/// Why a patient is erased.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErasureReason {
    /// Somebody asked for it.
    Request,
    /// A rule of retention.
    Retention,
    /// The patient had been erased before a backup from before was restored.
    Restore,
}

impl ErasureReason {
    /// The word in the database and at the API.
    pub fn name(self) -> &'static str {
        match self {
            ErasureReason::Request => "request",
            ErasureReason::Retention => "retention",
            ErasureReason::Restore => "restore",
        }
    }
}

/// A recording's bytes that an erasure has dealt with.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ErasedBlob {
    /// SHA-256 of the bytes, lower-case hexadecimal.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub sha256: String,
    /// How many they were.
    pub size_bytes: u64,
    /// True when they stay, because a recording of another patient has the very same bytes.
    pub is_shared: bool,
}

/// The record of an erasure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Erasure {
    /// Identity.
    pub id: ErasureId,
    /// Why it was done.
    pub reason: ErasureReason,
    /// Rows that were removed, by kind.
    pub removed: BTreeMap<String, u64>,
    /// Bytes of recordings.
    pub blobs: Vec<ErasedBlob>,
    /// When the rows were removed.
    pub begun_at: OffsetDateTime,
    /// When nothing was left in any file; none while remnants are still being removed.
    pub done_at: Option<OffsetDateTime>,
    /// The patient.
    patient: Hash,
    organisation: OrganisationId,
}

fn erasure_from_row(row: &Row) -> Result<Erasure, StorageError> {
    Ok(Erasure {
        id: row.try_get("id")?,
        reason: row::word(row, "reason")?,
        removed: row::json(row, "removed")?,
        blobs: row::json(row, "blobs")?,
        begun_at: row::time(row, "begun_at")?,
        done_at: row::optional_time(row, "done_at")?,
        patient: Hash::from_bytes(row.try_get("patient")?)?,
        organisation: row.try_get("organisation_id")?,
    })
}

/// Who erases whom, and why.
#[derive(Debug, Clone, Copy)]
pub struct ErasureOrder<'a> {
    /// The patient's organisation.
    pub organisation: OrganisationId,
    /// The patient.
    pub patient: PatientId,
    /// Why.
    pub reason: ErasureReason,
    /// Who does it.
    pub actor: Actor,
    /// Name of the request; empty for others.
    pub request_id: &'a str,
    /// The patient's pseudonym as whoever orders it has typed it; none when no person does.
    pub confirmation: Option<&'a str>,
}

impl Store {
    /// Erases a patient of an organisation. Asked again it tells what was done, and goes on with what was not. The jobs that ended
    /// with it come along.
    ///
    /// # Errors
    /// `NotFound` when the organisation has and had no such patient; `Conflict` with code `confirmation_mismatch`.
    pub async fn erase_patient(&self, order: &ErasureOrder<'_>) -> Result<(Erasure, Vec<JobId>), StorageError> {
        let (erasure, jobs) = match self.erase_rows(order).await? {
            Some(begun) => begun,
            None => (self.erasure_of(order.organisation, order.patient).await?, Vec::new()),
        };
        Ok((self.finish_erasure(erasure).await?, jobs))
    }

    /// The first two steps; none when the organisation has no such patient (any more).
    pub(super) async fn erase_rows(
        &self,
        order: &ErasureOrder<'_>,
    ) -> Result<Option<(Erasure, Vec<JobId>)>, StorageError> {
        let mut transaction = self.begin().await?;
        let pseudonym: Option<String> = query("SELECT pseudonym FROM patients WHERE organisation_id = $1 AND id = $2")
            .bind(order.organisation)
            .bind(order.patient)
            .fetch_optional_value(&mut transaction)
            .await?;
        let Some(pseudonym) = pseudonym else { return Ok(None) };
        if order.confirmation.is_some_and(|typed| typed != pseudonym) {
            return Err(StorageError::Conflict {
                code: "confirmation_mismatch",
                sentence: "the confirmation is not the pseudonym of this patient; nothing was erased".into(),
            });
        }
        let removed = rows::remove(&mut transaction, order.patient).await?;
        self.forget_audited_things(&mut transaction, order.patient).await?;
        let erasure = self.record(&mut transaction, order, &removed).await?;
        transaction.commit().await?;
        tracing::info!(erasure = %erasure.id, reason = order.reason.name(), "a patient was erased; remnants follow");
        for upload in removed.uploads {
            self.partial_files().remove(upload).await?;
        }
        // Sessions are gone, so no upload can begin any more.
        if !self.uploads().stop_and_wait(order.patient, UPLOADS_END_WITHIN).await {
            tracing::warn!(erasure = %erasure.id, "an upload of an erased patient did not end in time; it will be refused");
        }
        Ok(Some((erasure, removed.jobs)))
    }

    /// Goes on with every erasure that is not done; how many were.
    ///
    /// # Errors
    /// When the database or the disk fails.
    pub async fn resume_erasures(&self) -> Result<usize, StorageError> {
        let rows = query("SELECT * FROM erasures WHERE done_at IS NULL ORDER BY id").fetch_all(self.reader()).await?;
        let erasures = rows.iter().map(erasure_from_row).collect::<Result<Vec<_>, _>>()?;
        let n = erasures.len();
        self.finish_erasures(erasures).await?;
        Ok(n)
    }

    /// The record of the erasure of a patient.
    async fn erasure_of(&self, organisation: OrganisationId, patient: PatientId) -> Result<Erasure, StorageError> {
        let row = query("SELECT * FROM erasures WHERE organisation_id = $1 AND patient = $2")
            .bind(organisation)
            .bind(&self.audit_hash(Thing::from(patient)).0[..])
            .fetch_optional(self.reader())
            .await?
            .ok_or(StorageError::not_found("patient"))?;
        erasure_from_row(&row)
    }

    /// Lets the audit log forget which ids the patient's hashes stand for.
    async fn forget_audited_things(
        &self,
        connection: &mut Transaction,
        patient: PatientId,
    ) -> Result<(), StorageError> {
        let hash = self.audit_hash(Thing::from(patient));
        query("DELETE FROM audit_things WHERE patient = $1 OR hash = $1").bind(&hash.0[..]).execute(connection).await?;
        Ok(())
    }

    async fn record(
        &self,
        connection: &mut Transaction,
        order: &ErasureOrder<'_>,
        removed: &rows::Removed,
    ) -> Result<Erasure, StorageError> {
        let now = self.now();
        let row = query(
            "INSERT INTO erasures (id, organisation_id, patient, reason, requested_by, removed, blobs, begun_at)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8) RETURNING *",
        )
        .bind(ErasureId::new())
        .bind(order.organisation)
        .bind(&self.audit_hash(Thing::from(order.patient)).0[..])
        .bind(order.reason.name())
        .bind(order.actor.id)
        .bind(row::readable_json("the counts of an erasure", &removed.counts)?)
        .bind(row::readable_json("the blobs of an erasure", &removed.blobs)?)
        .bind(ms_from_time(now))
        .fetch_one(&mut *connection)
        .await?;
        let erasure = erasure_from_row(&row)?;
        let detail = json!({
            "erasure": erasure.id, "reason": order.reason, "removed": erasure.removed, "blobs": erasure.blobs,
        });
        let mut event =
            AuditEvent::of_command(now, order.actor, "erasure", Some(order.patient.into()), detail.to_string());
        event.request_id = order.request_id.to_owned();
        self.audit_within(connection, event).await?;
        Ok(erasure)
    }

    async fn finish_erasure(&self, erasure: Erasure) -> Result<Erasure, StorageError> {
        if erasure.done_at.is_some() {
            return Ok(erasure);
        }
        let finished = self.finish_erasures(vec![erasure]).await?;
        finished.into_iter().next().ok_or_else(|| StorageError::not_found("erasure"))
    }

    /// The steps after the rows, the files cleaned once for all; each can be done again.
    async fn finish_erasures(&self, erasures: Vec<Erasure>) -> Result<Vec<Erasure>, StorageError> {
        if erasures.is_empty() {
            return Ok(erasures);
        }
        for erasure in &erasures {
            self.note_in_list(erasure).await?;
            for blob in &erasure.blobs {
                self.remove_blob_if_unnamed(&key_of_digest(&blob.sha256)).await?;
            }
        }
        if !self.purge_remnants().await? {
            tracing::warn!(n = erasures.len(), "remnants of erased patients are still in the log of the database");
            return Ok(erasures);
        }
        let mut transaction = self.begin().await?;
        let mut finished = Vec::with_capacity(erasures.len());
        for erasure in &erasures {
            let row = query("UPDATE erasures SET done_at = coalesce(done_at, $2) WHERE id = $1 RETURNING *")
                .bind(erasure.id)
                .bind(ms_from_time(self.now()))
                .fetch_one(&mut transaction)
                .await?;
            finished.push(erasure_from_row(&row)?);
        }
        transaction.commit().await?;
        Ok(finished)
    }

    /// Removes a blob that no recording names. In a transaction, so that no recording comes to name it meanwhile.
    ///
    /// # Errors
    /// When the database or the disk fails.
    pub async fn remove_blob_if_unnamed(&self, key: &str) -> Result<bool, StorageError> {
        let mut transaction = self.begin().await?;
        let named: i64 = query("SELECT count(*) FROM recordings WHERE blob_key = $1 AND content_removed_at IS NULL")
            .bind(key)
            .fetch_value(&mut transaction)
            .await?;
        if named == 0 {
            self.blobs().remove(key).await?;
        }
        transaction.rollback().await?;
        Ok(named == 0)
    }
}

#[cfg(test)]
mod tests;
