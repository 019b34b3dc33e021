//! Looking at entries.

use super::chain::{Fields, Hash};
use super::{Thing, ThingKind};
use crate::storage::clock::ms_from_time;
use crate::storage::database::{Row, query};
use crate::storage::page::MAX_PAGE_ITEMS;
use crate::storage::{OrganisationId, PatientId, StorageError, Store, row};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use time::OffsetDateTime;
use uuid::Uuid;

/// A thing in an entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditedThing {
    /// Its kind.
    pub kind: String,
    /// What stands for it.
    pub hash: Hash,
    /// Its id, as long as it may be known.
    pub id: Option<Uuid>,
}

/// An entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditEntry {
    /// Its place in the chain, from 1.
    pub sequence: i64,
    /// When it happened.
    pub happened_at: OffsetDateTime,
    /// The organisation for which the actor acted.
    pub organisation_id: Option<OrganisationId>,
    /// What kind of actor it was.
    pub actor_kind: String,
    /// The actor.
    pub actor_id: Option<Uuid>,
    /// The actor's role.
    pub actor_role: String,
    /// What was done.
    pub action: String,
    /// What it was done to.
    pub thing: Option<AuditedThing>,
    /// What was made by it.
    pub made: Option<AuditedThing>,
    /// The patient concerned.
    pub patient: Option<AuditedThing>,
    /// Status of the answer.
    pub status: u16,
    /// Name of the request.
    pub request_id: String,
    /// More of it, as JSON; empty for most.
    pub detail: String,
    /// Hash of the entry before.
    pub previous_hash: Hash,
    /// Hash of this one.
    pub hash: Hash,
}

impl AuditEntry {
    /// The hash that its content has.
    pub(super) fn content_hash(&self) -> Hash {
        let kind = |thing: &Option<AuditedThing>| thing.as_ref().map_or(String::new(), |thing| thing.kind.clone());
        let hash = |thing: &Option<AuditedThing>| thing.as_ref().map(|thing| thing.hash);
        Fields {
            sequence: self.sequence,
            happened_at: ms_from_time(self.happened_at),
            organisation: self.organisation_id,
            actor_kind: &self.actor_kind,
            actor_id: self.actor_id,
            actor_role: &self.actor_role,
            action: &self.action,
            thing_kind: &kind(&self.thing),
            thing: hash(&self.thing),
            made_kind: &kind(&self.made),
            made: hash(&self.made),
            patient: hash(&self.patient),
            status: i64::from(self.status),
            request_id: &self.request_id,
            detail: &self.detail,
            previous: self.previous_hash,
        }
        .hash()
    }
}

/// Which entries are wanted; the default is all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AuditFilter {
    /// About this patient or a thing of theirs.
    pub patient: Option<PatientId>,
    /// By this actor.
    pub actor: Option<Uuid>,
    /// Of this time or later.
    pub from: Option<OffsetDateTime>,
    /// Before this time.
    pub before: Option<OffsetDateTime>,
}

fn thing(row: &Row, kind: &str, hash: &str, id: &str) -> Result<Option<AuditedThing>, StorageError> {
    let Some(bytes) = row.try_get::<Option<&[u8]>>(hash)? else { return Ok(None) };
    Ok(Some(AuditedThing { kind: row.try_get(kind)?, hash: Hash::from_bytes(bytes)?, id: row.try_get(id)? }))
}

pub(super) fn entry_from_row(row: &Row) -> Result<AuditEntry, StorageError> {
    let status: i64 = row.try_get("status")?;
    let patient: Option<&[u8]> = row.try_get("patient")?;
    let patient = match patient {
        Some(bytes) => Some(AuditedThing {
            kind: ThingKind::Patient.name().to_owned(),
            hash: Hash::from_bytes(bytes)?,
            id: row.try_get("patient_id")?,
        }),
        None => None,
    };
    Ok(AuditEntry {
        sequence: row.try_get("sequence")?,
        happened_at: row::time(row, "happened_at")?,
        organisation_id: row.try_get("organisation_id")?,
        actor_kind: row.try_get("actor_kind")?,
        actor_id: row.try_get("actor_id")?,
        actor_role: row.try_get("actor_role")?,
        action: row.try_get("action")?,
        thing: thing(row, "thing_kind", "thing", "thing_id")?,
        made: thing(row, "made_kind", "made", "made_id")?,
        patient,
        status: u16::try_from(status).map_err(|_| StorageError::Corrupt(format!("the status {status}")))?,
        request_id: row.try_get("request_id")?,
        detail: row.try_get("detail")?,
        previous_hash: Hash::from_bytes(row.try_get("previous_hash")?)?,
        hash: Hash::from_bytes(row.try_get("hash")?)?,
    })
}

impl Store {
    /// Entries of an organisation, newest first: those before the entry `before`, at most `limit` and one more, which tells
    /// that there are more.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn audit_entries(
        &self,
        organisation: OrganisationId,
        filter: &AuditFilter,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Vec<AuditEntry>, StorageError> {
        // An index can serve a condition only if it is there whatever is bound, hence one text per case.
        macro_rules! entries_where {
            ($patient:literal) => {
                concat!(
                    "SELECT e.*, t.id AS thing_id, m.id AS made_id, p.id AS patient_id
                     FROM audit_entries e
                          LEFT JOIN audit_things t ON t.hash = e.thing AND t.organisation_id = $1
                          LEFT JOIN audit_things m ON m.hash = e.made AND m.organisation_id = $1
                          LEFT JOIN audit_things p ON p.hash = e.patient AND p.organisation_id = $1
                     WHERE e.organisation_id = $1 AND e.sequence < $2
                       AND ($4 IS NULL OR e.actor_id = $4)
                       AND ($5 IS NULL OR e.happened_at >= $5)
                       AND ($6 IS NULL OR e.happened_at < $6)
                       AND ",
                    $patient,
                    " ORDER BY e.sequence DESC LIMIT $7"
                )
            };
        }
        let question = match filter.patient {
            Some(_) => entries_where!("e.patient = $3"),
            None => entries_where!("$3 IS NULL"),
        };
        let patient = filter.patient.map(|id| self.audit_hash(Thing::from(id)).0.to_vec());
        let rows = query(question)
            .bind(organisation)
            .bind(before.unwrap_or(i64::MAX))
            .bind(patient)
            .bind(filter.actor)
            .bind(filter.from.map(ms_from_time))
            .bind(filter.before.map(ms_from_time))
            .bind(i64::from(limit.clamp(1, MAX_PAGE_ITEMS)) + 1)
            .fetch_all(self.reader())
            .await?;
        rows.iter().map(entry_from_row).collect()
    }

    /// Every entry from one on, oldest first, one at a time.
    pub fn audit_from(&self, sequence: i64) -> BoxStream<'_, Result<AuditEntry, StorageError>> {
        let rows = query(
            "SELECT e.*, t.id AS thing_id, m.id AS made_id, p.id AS patient_id
             FROM audit_entries e LEFT JOIN audit_things t ON t.hash = e.thing
                  LEFT JOIN audit_things m ON m.hash = e.made LEFT JOIN audit_things p ON p.hash = e.patient
             WHERE e.sequence >= $1 ORDER BY e.sequence",
        )
        .bind(sequence)
        .fetch(self.reader());
        rows.map_err(StorageError::from).and_then(|row| async move { entry_from_row(&row) }).boxed()
    }
}
