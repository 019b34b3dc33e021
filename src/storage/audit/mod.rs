//! The audit log: who did or read what, when, and with what outcome. Rows are only ever added, and each carries the hash of the
//! one before, so that a row that was changed, removed or slipped in later is found by whoever walks the chain
//! (`Store::verify_audit`).
//!
//! An entry holds no pseudonym, note or value, and no id of a patient's things either: those stand in it as keyed hashes
//! (HMAC-SHA-256), because entries stay when the patient is erased. `audit_things` says which id a hash stands for; an
//! erasure removes those rows, and whoever still knows a patient's id can find the entries by it. A change is audited before it
//! is acknowledged; reads are gathered by [`AuditTrail`] and written several at a time.

mod chain;
mod reading;
mod retention;
mod trail;
mod verification;

pub use chain::{Hash, Secret};
pub use reading::{AuditEntry, AuditFilter, AuditedThing};
pub use trail::AuditTrail;
pub use verification::{BrokenLink, Verification};

use super::{Client, OrganisationId, PatientId};
use time::OffsetDateTime;
use uuid::Uuid;

/// Who acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Actor {
    /// What kind of actor it is.
    pub kind: ActorKind,
    /// The actor's identity, for kinds that have one.
    pub id: Option<Uuid>,
    /// The actor's role at the time, for kinds that have one.
    pub role: &'static str,
    /// The organisation for which it acts; none for what concerns the whole service.
    pub organisation: Option<OrganisationId>,
}

/// A kind of actor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActorKind {
    /// The holder of a key, or somebody who is signed in to the pages with one.
    Client,
    /// The operator at the machine, by a command.
    Operator,
    /// The service by itself.
    Service,
    /// Somebody who is not known: a sign-in that failed.
    Nobody,
}

impl ActorKind {
    /// The word in the database and at the API.
    pub fn name(self) -> &'static str {
        match self {
            ActorKind::Client => "client",
            ActorKind::Operator => "operator",
            ActorKind::Service => "service",
            ActorKind::Nobody => "nobody",
        }
    }
}

impl Actor {
    /// The holder of a key.
    pub fn client(client: &Client) -> Self {
        Self {
            kind: ActorKind::Client,
            id: Some(client.id.0),
            role: client.role.name(),
            organisation: Some(client.organisation_id),
        }
    }

    /// The operator, on behalf of an organisation.
    pub fn operator(organisation: Option<OrganisationId>) -> Self {
        Self { kind: ActorKind::Operator, id: None, role: "", organisation }
    }

    /// The service, on behalf of an organisation.
    pub fn service(organisation: Option<OrganisationId>) -> Self {
        Self { kind: ActorKind::Service, id: None, role: "", organisation }
    }

    /// Somebody who is not known.
    pub fn nobody() -> Self {
        Self { kind: ActorKind::Nobody, id: None, role: "", organisation: None }
    }
}

/// A kind of thing that is acted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ThingKind {
    /// A patient.
    Patient,
    /// A session.
    Session,
    /// A recording.
    Recording,
    /// A job.
    Job,
    /// An assessment.
    Assessment,
    /// A measure.
    Measure,
    /// A noise model.
    NoiseModel,
    /// A holder of a key.
    Client,
}

impl ThingKind {
    /// The word in the database and at the API.
    pub fn name(self) -> &'static str {
        match self {
            ThingKind::Patient => "patient",
            ThingKind::Session => "session",
            ThingKind::Recording => "recording",
            ThingKind::Job => "job",
            ThingKind::Assessment => "assessment",
            ThingKind::Measure => "measure",
            ThingKind::NoiseModel => "noise_model",
            ThingKind::Client => "client",
        }
    }
}

/// A thing that is acted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thing {
    /// Its kind.
    pub kind: ThingKind,
    /// Its id.
    pub id: Uuid,
}

impl From<PatientId> for Thing {
    fn from(id: PatientId) -> Self {
        Self { kind: ThingKind::Patient, id: id.0 }
    }
}

/// Something that happened, to be entered.
#[derive(Debug, Clone, PartialEq)]
pub struct AuditEvent {
    /// When.
    pub happened_at: OffsetDateTime,
    /// Who acted.
    pub actor: Actor,
    /// What was done: method and route of a request, or the name of a command.
    pub action: String,
    /// What it was done to.
    pub thing: Option<Thing>,
    /// What was made by it.
    pub made: Option<Thing>,
    /// Status of the answer; of a command 200.
    pub status: u16,
    /// Name of the request.
    pub request_id: String,
    /// More of it, as JSON: counts and digests, never values. Empty for most.
    pub detail: String,
}

impl AuditEvent {
    /// Something that the operator or the service did on a thing, with its outcome as JSON.
    pub fn of_command(
        happened_at: OffsetDateTime,
        actor: Actor,
        action: &str,
        thing: Option<Thing>,
        detail: String,
    ) -> Self {
        Self {
            happened_at,
            actor,
            action: action.to_owned(),
            thing,
            made: None,
            status: 200,
            request_id: String::new(),
            detail,
        }
    }
}

#[cfg(test)]
mod tests;
