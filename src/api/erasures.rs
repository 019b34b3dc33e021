//! Erasure of a patient.

use super::auth::Admin;
use super::error::ApiError;
use super::observe::RequestId;
use super::patients::PatientPath;
use super::request::ApiPath;
use super::state::AppState;
use crate::storage::audit::Actor;
use crate::storage::erasure::ErasureOrder;
use crate::storage::{ErasedBlob, Erasure, ErasureId, ErasureReason};
use axum::Json;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use std::collections::BTreeMap;
use time::OffsetDateTime;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Header that confirms whom an erasure is meant for.
const CONFIRMATION: &str = "x-confirm-pseudonym";

/// The route of this file. It takes as long as the disk needs to forget.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(erase_patient))
}

/// How far an erasure is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErasureState {
    /// No row is left; what rows have left behind in files is still being removed.
    UnderWay,
    /// Nothing is left in any file of the data directory.
    Done,
}

/// The record of an erasure.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ErasureResponse {
    /// Identity of the record; it stays in the audit log.
    pub id: ErasureId,
    /// How far it is. What is under way is taken up by the service itself; ask again to see.
    pub state: ErasureState,
    /// Why it was done.
    pub reason: ErasureReason,
    /// Rows that were removed, by kind.
    pub removed: BTreeMap<String, u64>,
    /// Bytes of recordings that were removed.
    pub blobs: Vec<ErasedBlob>,
    /// When the rows were removed.
    #[serde(with = "time::serde::rfc3339")]
    pub begun_at: OffsetDateTime,
    /// When nothing was left in any file; null while it is under way.
    #[serde(with = "time::serde::rfc3339::option")]
    pub done_at: Option<OffsetDateTime>,
}

impl From<Erasure> for ErasureResponse {
    fn from(erasure: Erasure) -> Self {
        let state = if erasure.done_at.is_some() { ErasureState::Done } else { ErasureState::UnderWay };
        let Erasure { id, reason, removed, blobs, begun_at, done_at, .. } = erasure;
        Self { id, state, reason, removed, blobs, begun_at, done_at }
    }
}

/// Erase a patient
///
/// Removes everything that is theirs, for good: sessions, recordings and their bytes, jobs, assessments, series, measures,
/// answers, results of tests, plans, consents, answers kept for repeated requests, noise models trained with their recordings, and
/// what deleted rows leave behind in the files of the database. Uploads under way are refused, jobs that run are stopped. The
/// audit log keeps that it happened, and no id of theirs. Backups are out of its reach: see the documentation of `surefoot restore`.
///
/// The header `X-Confirm-Pseudonym` must hold the patient's pseudonym (a header, because addresses end up in logs). Asking again
/// changes nothing and answers with the same record, and needs no confirmation that is right.
#[utoipa::path(delete, path = "/v1/patients/{id}", tag = "patients", operation_id = "erase_patient", security(("api_key" = ["admin"])),
    params(PatientPath, ("X-Confirm-Pseudonym" = String, Header, description = "Pseudonym of the patient who is to be erased",
        pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")),
    responses((status = 200, description = "Erased", body = ErasureResponse),
              (status = 202, description = "Erased from all rows; remnants in files follow", body = ErasureResponse),
              (status = 400, description = "The confirmation is missing", body = super::error::Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The confirmation is not the patient's pseudonym (`confirmation_mismatch`)",
               body = super::error::Problem, content_type = "application/problem+json")))]
async fn erase_patient(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiPath(path): ApiPath<PatientPath>,
    Extension(RequestId(request_id)): Extension<RequestId>,
    headers: HeaderMap,
) -> Result<(StatusCode, Json<ErasureResponse>), ApiError> {
    let confirmation = headers.get(CONFIRMATION).and_then(|value| value.to_str().ok()).map(str::trim);
    let confirmation = confirmation.filter(|text| !text.is_empty()).ok_or_else(|| {
        ApiError::field("X-Confirm-Pseudonym", "must hold the pseudonym of the patient who is to be erased for good")
    })?;
    // What was read of the patient is entered before the audit log forgets whose it was.
    state.audit.flush().await;
    let order = ErasureOrder {
        organisation: caller.access.organisation,
        patient: path.id,
        reason: ErasureReason::Request,
        actor: Actor::client(&caller.client),
        request_id: &request_id,
        confirmation: Some(confirmation),
    };
    let erasure = state.queue.erase_patient(&order).await?;
    state.recent_series.clear();
    let status = if erasure.done_at.is_some() { StatusCode::OK } else { StatusCode::ACCEPTED };
    Ok((status, Json(erasure.into())))
}
