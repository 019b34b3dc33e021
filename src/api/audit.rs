//! The audit log, for administrators.

use super::auth::Admin;
use super::error::ApiError;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::ApiQuery;
use super::state::AppState;
use super::text;
use crate::storage::audit::{AuditEntry, AuditFilter, AuditedThing};
use crate::storage::{ClientId, Page as StoredPage, PatientId};
use axum::Json;
use axum::extract::State;
use garde::Validate;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list_audit_entries))
}

/// Which entries are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct AuditQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
    /// Only about this patient and what is theirs; also the id of a patient who was erased.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub patient_id: Option<PatientId>,
    /// Only by this holder of a key.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub actor_id: Option<ClientId>,
    /// Only of this time or later.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    #[param(value_type = Option<String>, format = DateTime)]
    pub from: Option<OffsetDateTime>,
    /// Only before this time.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    #[param(value_type = Option<String>, format = DateTime)]
    pub before: Option<OffsetDateTime>,
}

/// Who acted.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AuditActor {
    /// `client` is the holder of a key, `operator` somebody at the machine, `service` the service by itself, `nobody` a sign-in
    /// that failed.
    pub kind: String,
    /// Identity of a client.
    pub id: Option<Uuid>,
    /// Role of a client at the time.
    pub role: Option<String>,
}

/// A thing that was acted on.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AuditThing {
    /// What it is, for example `patient` or `recording`.
    pub kind: String,
    /// Its id; null when it was erased, or never was.
    pub id: Option<Uuid>,
    /// Keyed hash of its id, which stays when it is erased.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub hash: String,
}

impl From<AuditedThing> for AuditThing {
    fn from(AuditedThing { kind, hash, id }: AuditedThing) -> Self {
        Self { kind, id, hash: hash.to_string() }
    }
}

/// An entry of the audit log.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AuditEntryResponse {
    /// Its place in the chain of the whole service.
    pub sequence: i64,
    /// When it happened.
    #[serde(with = "time::serde::rfc3339")]
    pub happened_at: OffsetDateTime,
    /// Who acted.
    pub actor: AuditActor,
    /// What was done: method and route of a request, or the name of a command.
    pub action: String,
    /// What it was done to; null for what is about no single thing.
    pub thing: Option<AuditThing>,
    /// What was made by it.
    pub made: Option<AuditThing>,
    /// The patient concerned.
    pub patient: Option<AuditThing>,
    /// Status of the answer.
    pub status: u16,
    /// Name of the request, as in the header `x-request-id`.
    pub request_id: String,
    /// Counts and digests of an erasure or of a retention; null for others.
    pub detail: Option<Value>,
    /// Hash of the entry before.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub previous_hash: String,
    /// Hash of this entry.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub hash: String,
}

impl From<AuditEntry> for AuditEntryResponse {
    fn from(entry: AuditEntry) -> Self {
        let role = (!entry.actor_role.is_empty()).then_some(entry.actor_role);
        Self {
            sequence: entry.sequence,
            happened_at: entry.happened_at,
            actor: AuditActor { kind: entry.actor_kind, id: entry.actor_id, role },
            action: entry.action,
            thing: entry.thing.map(AuditThing::from),
            made: entry.made.map(AuditThing::from),
            patient: entry.patient.map(AuditThing::from),
            status: entry.status,
            request_id: entry.request_id,
            detail: serde_json::from_str(&entry.detail).ok(),
            previous_hash: entry.previous_hash.to_string(),
            hash: entry.hash.to_string(),
        }
    }
}

/// List audit entries
///
/// Who did or read what in the organisation, newest first, in pages: every request with a key or a sign-in, with its outcome, and
/// what the operator's commands and the retention rules did. Entries hold no clinical values. `surefoot audit verify` checks the
/// chain.
#[utoipa::path(get, path = "/v1/audit", tag = "audit", operation_id = "list_audit_entries", security(("api_key" = ["admin"])), params(AuditQuery),
    responses((status = 200, description = "One page", body = Page<AuditEntryResponse>),
              (status = 503, description = "The log cannot be written at the moment", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn list_audit_entries(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiQuery(query): ApiQuery<AuditQuery>,
) -> Result<Json<Page<AuditEntryResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let before = id_from_cursor(query.cursor.as_deref())?.map(sequence_of);
    // Reads that were answered a moment ago belong in the list.
    if !state.audit.flush().await {
        return Err(ApiError::Unavailable("The audit log cannot be written at the moment. Try again."));
    }
    let filter = AuditFilter {
        patient: query.patient_id,
        actor: query.actor_id.map(|id| id.0),
        from: query.from,
        before: query.before,
    };
    let mut items = state.store.audit_entries(caller.access.organisation, &filter, before, limit).await?;
    let more = items.len() > limit as usize;
    items.truncate(limit as usize);
    let next = items.last().filter(|_| more).map(|last| last.sequence);
    // As in an address: `+` of an offset would be a space there.
    let time =
        |time: Option<OffsetDateTime>| time.and_then(|time| time.to_offset(time::UtcOffset::UTC).format(&Rfc3339).ok());
    let filters = [
        ("patient_id", query.patient_id.map(|id| id.to_string())),
        ("actor_id", query.actor_id.map(|id| id.to_string())),
        ("from", time(query.from)),
        ("before", time(query.before)),
    ];
    let link = PageLink::new("/v1/audit", limit, &filters);
    Ok(Json(Page::from_stored(StoredPage { items, next }, &link, cursor_of, AuditEntryResponse::from)))
}

/// A cursor holds an id; that of this list is a number in its last bytes.
fn cursor_of(sequence: i64) -> Uuid {
    Uuid::from_u128(u128::from(sequence.unsigned_abs()))
}

fn sequence_of(cursor: Uuid) -> i64 {
    i64::try_from(cursor.as_u128()).unwrap_or(i64::MAX)
}
