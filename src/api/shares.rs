//! Shares: one patient, readable to one clinician of another organisation until a time.

use super::auth::Clinician;
use super::error::{ApiError, FieldError};
use super::patients::PatientPath;
use super::request::{ApiJson, ApiPath};
use super::state::AppState;
use crate::storage::{ClientId, PatientId, Share, ShareId};
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::{Duration, OffsetDateTime};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Longest share; whoever needs more shares again, and so decides again.
const LONGEST: Duration = Duration::days(366);

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create_share, list_shares))
        .routes(routes!(revoke_share))
        .routes(routes!(list_received_shares))
}

/// A patient to be shared.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ShareRequest {
    /// The clinician or administrator of another organisation, as `GET /v1/me` names them.
    #[garde(skip)]
    pub receiver_id: ClientId,
    /// Until when; at most 366 days ahead.
    #[garde(skip)]
    #[serde(with = "time::serde::rfc3339")]
    pub expires_at: OffsetDateTime,
}

/// A patient that is, or was, shared.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ShareResponse {
    /// Identity.
    pub id: ShareId,
    /// Who can be read.
    pub patient_id: PatientId,
    /// Pseudonym of the patient.
    pub pseudonym: String,
    /// Name of the organisation whose patient it is.
    pub organisation: String,
    /// Who reads.
    pub receiver_id: ClientId,
    /// Who reads, for people.
    pub receiver_label: String,
    /// Name of the receiver's organisation.
    pub receiver_organisation: String,
    /// Who shared.
    pub created_by: ClientId,
    /// Since when.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// Until when, unless it is revoked before.
    #[serde(with = "time::serde::rfc3339")]
    pub expires_at: OffsetDateTime,
    /// When it was revoked; null when it was not.
    #[serde(with = "time::serde::rfc3339::option")]
    pub revoked_at: Option<OffsetDateTime>,
}

impl From<Share> for ShareResponse {
    fn from(share: Share) -> Self {
        Self {
            id: share.id,
            patient_id: share.patient_id,
            pseudonym: share.pseudonym,
            organisation: share.organisation,
            receiver_id: share.receiver_id,
            receiver_label: share.receiver_label,
            receiver_organisation: share.receiver_organisation,
            created_by: share.created_by,
            created_at: share.created_at,
            expires_at: share.expires_at,
            revoked_at: share.revoked_at,
        }
    }
}

/// Shares, the newest first, at most 500.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct SharesResponse {
    /// The shares.
    pub items: Vec<ShareResponse>,
}

/// Address of one share.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct SharePath {
    /// The share.
    #[param(value_type = String, format = Uuid)]
    pub id: ShareId,
}

/// Share a patient
///
/// The receiver reads what there is of this patient (sessions, recordings, assessments, entries, report, FHIR, exports) until the time
/// is over or the share is revoked, and changes nothing.
#[utoipa::path(post, path = "/v1/patients/{id}/shares", tag = "shares", operation_id = "create_share",
    security(("api_key" = ["clinician"])), params(PatientPath), request_body = ShareRequest,
    responses((status = 201, description = "Shared", body = ShareResponse),
              (status = 409, description = "The receiver belongs to the patient's own organisation",
               body = super::error::Problem, content_type = "application/problem+json")))]
async fn create_share(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(request): ApiJson<ShareRequest>,
) -> Result<(StatusCode, Json<ShareResponse>), ApiError> {
    let now = state.store.now();
    if request.expires_at <= now || request.expires_at > now + LONGEST {
        let message = "must lie ahead, by 366 days at most";
        return Err(ApiError::InvalidBody(vec![FieldError::new("expires_at", message)]));
    }
    let shared = state.store.share_patient(&caller.access, path.id, request.receiver_id, request.expires_at).await?;
    Ok((StatusCode::CREATED, Json(shared.into())))
}

/// List the shares of a patient
///
/// Those that are over too. For the patient's own organisation.
#[utoipa::path(get, path = "/v1/patients/{id}/shares", tag = "shares", operation_id = "list_shares",
    security(("api_key" = ["clinician"])), params(PatientPath),
    responses((status = 200, description = "The shares", body = SharesResponse)))]
async fn list_shares(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
) -> Result<Json<SharesResponse>, ApiError> {
    let shares = state.store.shares_of_patient(&caller.access, path.id).await?;
    Ok(Json(SharesResponse { items: shares.into_iter().map(ShareResponse::from).collect() }))
}

/// Revoke a share
///
/// The receiver reads nothing of the patient from then on. Repeating it changes nothing.
#[utoipa::path(delete, path = "/v1/shares/{id}", tag = "shares", operation_id = "revoke_share",
    security(("api_key" = ["clinician"])), params(SharePath),
    responses((status = 200, description = "The share, revoked", body = ShareResponse)))]
async fn revoke_share(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<SharePath>,
) -> Result<Json<ShareResponse>, ApiError> {
    Ok(Json(state.store.revoke_share(&caller.access, path.id).await?.into()))
}

/// List what is shared with the caller
///
/// Only what can be read now. The patients stand in no other list; their ids open what is theirs.
#[utoipa::path(get, path = "/v1/shares", tag = "shares", operation_id = "list_received_shares",
    security(("api_key" = ["clinician"])),
    responses((status = 200, description = "The shares", body = SharesResponse)))]
async fn list_received_shares(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
) -> Result<Json<SharesResponse>, ApiError> {
    let shares = state.store.shares_received(&caller.access).await?;
    Ok(Json(SharesResponse { items: shares.into_iter().map(ShareResponse::from).collect() }))
}
