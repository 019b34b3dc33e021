//! The chain: how an entry is encoded and hashed, and how it is added.
//!
//! ```text
//! hash = SHA-256("surefoot audit 1" ‖ field ‖ field ‖ …)      field = length (4 bytes, big-endian) ‖ bytes
//! ```
//!
//! The fields are, in this order: sequence and time (8 bytes, big-endian), organisation, kind, id and role of the actor, action,
//! kind and hash of the thing, kind and hash of what was made, hash of the patient, status (8 bytes), request id, detail, hash of
//! the entry before. What is absent has the length 0xFFFFFFFF and no bytes. The first entry follows 32 zero bytes.

use super::{AuditEvent, Thing, ThingKind};
use crate::storage::clock::ms_from_time;
use crate::storage::database::{Transaction, query};
use crate::storage::{OrganisationId, StorageError, Store};
use hmac::{Hmac, KeyInit, Mac};
use rand::TryRng;
use rand::rngs::SysRng;
use sha2::{Digest, Sha256};
use std::fmt;
use std::sync::Arc;
use uuid::Uuid;

/// A digest, of an entry or of an id.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Hash(pub [u8; 32]);

impl Hash {
    /// What the first entry follows.
    pub(super) const BEGINNING: Hash = Hash([0; 32]);

    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, StorageError> {
        let bytes = bytes.try_into().map_err(|_| StorageError::Corrupt("a hash has not 32 bytes".into()))?;
        Ok(Self(bytes))
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex::encode(self.0))
    }
}

impl fmt::Debug for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hash({self})")
    }
}

/// The key of hashed ids; it stays with the database.
#[derive(Clone)]
pub struct Secret(Arc<[u8; 32]>);

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

impl Secret {
    /// What stands for a thing in entries.
    pub fn hash(&self, thing: Thing) -> Hash {
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.0[..]).expect("HMAC takes keys of every length");
        mac.update(thing.kind.name().as_bytes());
        mac.update(&[0]);
        mac.update(thing.id.as_bytes());
        Hash(mac.finalize().into_bytes().into())
    }

    /// The secret of a database, made when it has none.
    pub(in crate::storage) async fn of_database(connection: &mut Transaction) -> Result<Self, StorageError> {
        const QUESTION: &str = "SELECT secret FROM audit_state WHERE id = 1";
        if let Some(bytes) = query(QUESTION).fetch_optional_value::<Vec<u8>>(&mut *connection).await? {
            return Ok(Self(Arc::new(Hash::from_bytes(&bytes)?.0)));
        }
        let mut bits = [0u8; 32];
        SysRng.try_fill_bytes(&mut bits).map_err(|error| StorageError::Randomness(error.to_string()))?;
        query("INSERT INTO audit_state (id, secret, sequence, hash) VALUES (1, $1, 0, $2) ON CONFLICT (id) DO NOTHING")
            .bind(&bits[..])
            .bind(&Hash::BEGINNING.0[..])
            .execute(&mut *connection)
            .await?;
        // Another process may have been faster.
        let bytes: Vec<u8> = query(QUESTION).fetch_value(connection).await?;
        Ok(Self(Arc::new(Hash::from_bytes(&bytes)?.0)))
    }
}

/// What is hashed of an entry.
pub(super) struct Fields<'a> {
    pub(super) sequence: i64,
    pub(super) happened_at: i64,
    pub(super) organisation: Option<OrganisationId>,
    pub(super) actor_kind: &'a str,
    pub(super) actor_id: Option<Uuid>,
    pub(super) actor_role: &'a str,
    pub(super) action: &'a str,
    pub(super) thing_kind: &'a str,
    pub(super) thing: Option<Hash>,
    pub(super) made_kind: &'a str,
    pub(super) made: Option<Hash>,
    pub(super) patient: Option<Hash>,
    pub(super) status: i64,
    pub(super) request_id: &'a str,
    pub(super) detail: &'a str,
    pub(super) previous: Hash,
}

impl Fields<'_> {
    pub(super) fn hash(&self) -> Hash {
        let mut digest = Sha256::new();
        digest.update(b"surefoot audit 1");
        let mut field = |bytes: Option<&[u8]>| {
            // Texts of an entry are far below 4 GB.
            let length = bytes.map_or(u32::MAX, |bytes| bytes.len() as u32);
            digest.update(length.to_be_bytes());
            digest.update(bytes.unwrap_or_default());
        };
        field(Some(&self.sequence.to_be_bytes()));
        field(Some(&self.happened_at.to_be_bytes()));
        field(self.organisation.as_ref().map(|id| &id.0.as_bytes()[..]));
        field(Some(self.actor_kind.as_bytes()));
        field(self.actor_id.as_ref().map(|id| &id.as_bytes()[..]));
        field(Some(self.actor_role.as_bytes()));
        field(Some(self.action.as_bytes()));
        field(Some(self.thing_kind.as_bytes()));
        field(self.thing.as_ref().map(|hash| &hash.0[..]));
        field(Some(self.made_kind.as_bytes()));
        field(self.made.as_ref().map(|hash| &hash.0[..]));
        field(self.patient.as_ref().map(|hash| &hash.0[..]));
        field(Some(&self.status.to_be_bytes()));
        field(Some(self.request_id.as_bytes()));
        field(Some(self.detail.as_bytes()));
        field(Some(&self.previous.0));
        Hash(digest.finalize().into())
    }
}

/// Adds entries at the end of the chain, inside the caller's transaction.
async fn append(connection: &mut Transaction, secret: &Secret, events: &[AuditEvent]) -> Result<(), StorageError> {
    // An update, so that the row is held against every other process until the transaction ends.
    let state = query("UPDATE audit_state SET sequence = sequence WHERE id = 1 RETURNING sequence, hash")
        .fetch_one(&mut *connection)
        .await?;
    let mut sequence: i64 = state.try_get("sequence")?;
    let mut previous = Hash::from_bytes(state.try_get("hash")?)?;
    for event in events {
        sequence += 1;
        // A request that failed may name what its sender must not know of: not even whose it is, or that it is there.
        let (thing, made) = match event.status < 400 {
            true => {
                let thing = known(&mut *connection, secret, event.thing).await?;
                (thing, known(&mut *connection, secret, event.made).await?)
            }
            false => (event.thing.map(|thing| unknown(secret.hash(thing), thing)), None),
        };
        let of_thing = |known: &Option<KnownThing>| known.as_ref().and_then(|known| known.patient);
        let patient = of_thing(&thing).or_else(|| of_thing(&made));
        let kind = |thing: Option<Thing>| thing.map_or("", |thing| thing.kind.name());
        let fields = Fields {
            sequence,
            happened_at: ms_from_time(event.happened_at),
            organisation: event.actor.organisation,
            actor_kind: event.actor.kind.name(),
            actor_id: event.actor.id,
            actor_role: event.actor.role,
            action: &event.action,
            thing_kind: kind(event.thing),
            thing: thing.as_ref().map(|known| known.hash),
            made_kind: kind(event.made),
            made: made.as_ref().map(|known| known.hash),
            patient,
            status: i64::from(event.status),
            request_id: &event.request_id,
            detail: &event.detail,
            previous,
        };
        let hash = fields.hash();
        insert(&mut *connection, &fields, hash).await?;
        previous = hash;
    }
    query("UPDATE audit_state SET sequence = $1, hash = $2 WHERE id = 1")
        .bind(sequence)
        .bind(&previous.0[..])
        .execute(connection)
        .await?;
    Ok(())
}

async fn insert(connection: &mut Transaction, fields: &Fields<'_>, hash: Hash) -> Result<(), StorageError> {
    query(
        "INSERT INTO audit_entries (sequence, happened_at, organisation_id, actor_kind, actor_id, actor_role, action,
                                    thing_kind, thing, made_kind, made, patient, status, request_id, detail,
                                    previous_hash, hash)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17)",
    )
    .bind(fields.sequence)
    .bind(fields.happened_at)
    .bind(fields.organisation)
    .bind(fields.actor_kind)
    .bind(fields.actor_id)
    .bind(fields.actor_role)
    .bind(fields.action)
    .bind(fields.thing_kind)
    .bind(fields.thing.as_ref().map(|hash| &hash.0[..]))
    .bind(fields.made_kind)
    .bind(fields.made.as_ref().map(|hash| &hash.0[..]))
    .bind(fields.patient.as_ref().map(|hash| &hash.0[..]))
    .bind(fields.status)
    .bind(fields.request_id)
    .bind(fields.detail)
    .bind(&fields.previous.0[..])
    .bind(&hash.0[..])
    .execute(connection)
    .await?;
    Ok(())
}

/// The hash of a thing, and of the patient whose it is.
struct KnownThing {
    hash: Hash,
    patient: Option<Hash>,
}

/// Looks up whose a thing is and remembers its id. What is not in the database is hashed and not remembered: it may be of
/// somebody who was erased.
async fn known(
    connection: &mut Transaction,
    secret: &Secret,
    thing: Option<Thing>,
) -> Result<Option<KnownThing>, StorageError> {
    let Some(thing) = thing else { return Ok(None) };
    let hash = secret.hash(thing);
    let row = query("SELECT patient FROM audit_things WHERE hash = $1")
        .bind(&hash.0[..])
        .fetch_optional(&mut *connection)
        .await?;
    if let Some(row) = row {
        let patient: Option<&[u8]> = row.try_get("patient")?;
        return Ok(Some(KnownThing { hash, patient: patient.map(Hash::from_bytes).transpose()? }));
    }
    let found = query(owner_question(thing.kind)).bind(thing.id).fetch_optional(&mut *connection).await?;
    let Some(owner) = found else { return Ok(Some(unknown(hash, thing))) };
    let organisation: OrganisationId = owner.try_get("organisation_id")?;
    let patient: Option<Uuid> = owner.try_get("patient_id")?;
    let patient = patient.map(|id| secret.hash(Thing { kind: ThingKind::Patient, id }));
    query(
        "INSERT INTO audit_things (hash, organisation_id, kind, id, patient) VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (hash) DO NOTHING",
    )
    .bind(&hash.0[..])
    .bind(organisation)
    .bind(thing.kind.name())
    .bind(thing.id)
    .bind(patient.as_ref().map(|hash| &hash.0[..]))
    .execute(connection)
    .await?;
    Ok(Some(KnownThing { hash, patient }))
}

/// A thing of which nothing is known. Entries about a patient who is gone, or never was, are found by the id too.
fn unknown(hash: Hash, thing: Thing) -> KnownThing {
    KnownThing { hash, patient: (thing.kind == ThingKind::Patient).then_some(hash) }
}

/// Whose a thing is: a row when there is such a thing, with the patient when it is a patient's.
fn owner_question(kind: ThingKind) -> &'static str {
    match kind {
        ThingKind::Patient => "SELECT organisation_id, id AS patient_id FROM patients WHERE id = $1",
        ThingKind::Session => "SELECT organisation_id, patient_id FROM sessions WHERE id = $1",
        ThingKind::Recording => {
            "SELECT r.organisation_id, s.patient_id FROM recordings r JOIN sessions s ON s.id = r.session_id
             WHERE r.id = $1"
        }
        ThingKind::Job => {
            "SELECT j.organisation_id, s.patient_id FROM jobs j JOIN recordings r ON r.id = j.recording_id
                  JOIN sessions s ON s.id = r.session_id WHERE j.id = $1"
        }
        ThingKind::Assessment => {
            "SELECT a.organisation_id, s.patient_id FROM assessments a JOIN recordings r ON r.id = a.recording_id
                  JOIN sessions s ON s.id = r.session_id WHERE a.id = $1"
        }
        ThingKind::Measure => "SELECT organisation_id, patient_id FROM measures WHERE id = $1",
        ThingKind::NoiseModel => "SELECT organisation_id, NULL AS patient_id FROM noise_models WHERE id = $1",
        ThingKind::Client => "SELECT organisation_id, NULL AS patient_id FROM clients WHERE id = $1",
    }
}

impl Store {
    /// Enters events now; when this returns they are on the disk.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn audit(&self, events: &[AuditEvent]) -> Result<(), StorageError> {
        if events.is_empty() {
            return Ok(());
        }
        let mut transaction = self.begin().await?;
        append(&mut transaction, &self.audit_secret, events).await?;
        transaction.commit().await?;
        Ok(())
    }

    /// Enters an event in a transaction, with what it tells of or not at all. It is the last question of the transaction: the end
    /// of the chain is held until then.
    pub(crate) async fn audit_within(
        &self,
        transaction: &mut Transaction,
        event: AuditEvent,
    ) -> Result<(), StorageError> {
        append(transaction, &self.audit_secret, &[event]).await
    }

    /// What stands for a thing in the audit log.
    pub fn audit_hash(&self, thing: Thing) -> Hash {
        self.audit_secret.hash(thing)
    }
}
