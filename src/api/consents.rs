//! Consents of a patient: recorded before the first upload, and withdrawn.

use super::auth::Clinician;
use super::error::{ApiError, FieldError};
use super::patients::PatientPath;
use super::request::{ApiJson, ApiPath};
use super::state::AppState;
use super::text;
use crate::queue::Withdrawal;
use crate::storage::consents::state_of_scope;
use crate::storage::{ClientId, Consent, ConsentId, ConsentScope, ConsentState, NewConsent};
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::{Duration, OffsetDateTime};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// How far in the future a consent may have been given: clocks differ.
const CLOCK_DIFFERENCE: Duration = Duration::minutes(5);

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(record_consent, list_consents)).routes(routes!(withdraw_consent))
}

/// A consent to be recorded.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ConsentRequest {
    /// What the patient has agreed to.
    #[garde(skip)]
    pub scope: ConsentScope,
    /// Which version of the consent text the patient has agreed to, as the clinic names it; nothing that identifies a person.
    #[garde(length(chars, min = 1, max = 64), custom(text::required_line))]
    #[schema(
        min_length = 1,
        max_length = 64,
        pattern = "^[^\\u0000-\\u001f\\u007f]*$",
        example = "home-exercise 2026-11"
    )]
    pub text_version: String,
    /// When the patient agreed; the time of this request when absent.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    pub given_at: Option<OffsetDateTime>,
    /// When the consent ends by itself; never when absent.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    pub expires_at: Option<OffsetDateTime>,
}

/// A consent.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ConsentResponse {
    /// Identity.
    pub id: ConsentId,
    /// What it is to.
    pub scope: ConsentScope,
    /// How it stands: a later consent to the same scope is one of its own.
    pub state: ConsentState,
    /// Which version of the consent text the patient has agreed to.
    pub text_version: String,
    /// The client that recorded it.
    pub created_by: ClientId,
    /// When the patient agreed.
    #[serde(with = "time::serde::rfc3339")]
    pub given_at: OffsetDateTime,
    /// When it ends by itself.
    #[serde(with = "time::serde::rfc3339::option")]
    pub expires_at: Option<OffsetDateTime>,
    /// When it was withdrawn.
    #[serde(with = "time::serde::rfc3339::option")]
    pub withdrawn_at: Option<OffsetDateTime>,
    /// The client that recorded the withdrawal.
    pub withdrawn_by: Option<ClientId>,
    /// When it was recorded.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

impl ConsentResponse {
    /// A consent as it stands at a time.
    pub fn of(consent: Consent, now: OffsetDateTime) -> Self {
        let state = consent.state_at(now);
        let Consent {
            id,
            scope,
            text_version,
            created_by,
            given_at,
            expires_at,
            withdrawn_at,
            withdrawn_by,
            created_at,
        } = consent;
        Self {
            id,
            scope,
            state,
            text_version,
            created_by,
            given_at,
            expires_at,
            withdrawn_at,
            withdrawn_by,
            created_at,
        }
    }
}

/// Every consent of a patient.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ConsentsResponse {
    /// Whether recordings may be uploaded and assessed.
    pub assessment: ConsentState,
    /// Whether results may be used for research.
    pub research: ConsentState,
    /// The consents, newest first, also those that are over.
    pub items: Vec<ConsentResponse>,
}

impl ConsentsResponse {
    /// A patient's consents as they stand at a time.
    pub fn of(consents: Vec<Consent>, now: OffsetDateTime) -> Self {
        Self {
            assessment: state_of_scope(&consents, ConsentScope::Assessment, now),
            research: state_of_scope(&consents, ConsentScope::Research, now),
            items: consents.into_iter().map(|consent| ConsentResponse::of(consent, now)).collect(),
        }
    }
}

/// What is withdrawn.
#[derive(Debug, Clone, Copy, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WithdrawalRequest {
    /// What the patient no longer agrees to.
    #[garde(skip)]
    pub scope: ConsentScope,
}

/// What a withdrawal came to.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct WithdrawalResponse {
    /// The consents that it ended; none when there was none left.
    pub withdrawn: Vec<ConsentResponse>,
    /// Jobs that waited and will not run.
    pub jobs_cancelled: u64,
    /// Jobs that ran and were stopped; nothing of them is stored.
    pub jobs_stopped: u64,
}

/// Record a consent
///
/// Who recorded it is the holder of the key. A consent to `assessment` must be valid when a recording of the patient is
/// uploaded or a job is asked for.
#[utoipa::path(post, path = "/v1/patients/{id}/consents", tag = "consents", operation_id = "record_consent", security(("api_key" = ["clinician"])),
    params(PatientPath), request_body = ConsentRequest,
    responses((status = 201, description = "Recorded", body = ConsentResponse)))]
async fn record_consent(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(request): ApiJson<ConsentRequest>,
) -> Result<(StatusCode, Json<ConsentResponse>), ApiError> {
    let now = state.store.now();
    let given_at = request.given_at.unwrap_or(now);
    let refuse = |field: &str, message: &str| Err(ApiError::InvalidBody(vec![FieldError::new(field, message)]));
    if given_at > now + CLOCK_DIFFERENCE {
        return refuse("given_at", "lies in the future; record a consent once it was given");
    }
    if request.expires_at.is_some_and(|end| end <= given_at) {
        return refuse("expires_at", "must be later than given_at");
    }
    let ConsentRequest { scope, text_version, expires_at, .. } = request;
    let new = NewConsent { scope, text_version, given_at: given_at.min(now), expires_at };
    let consent = state.store.record_consent(&caller.access, path.id, &new).await?;
    Ok((StatusCode::CREATED, Json(ConsentResponse::of(consent, now))))
}

/// List consents
///
/// All of a patient's, newest first, and whether recordings may be uploaded and assessed.
#[utoipa::path(get, path = "/v1/patients/{id}/consents", tag = "consents", operation_id = "list_consents", security(("api_key" = ["clinician"])),
    params(PatientPath),
    responses((status = 200, description = "Every consent of the patient", body = ConsentsResponse)))]
async fn list_consents(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
) -> Result<Json<ConsentsResponse>, ApiError> {
    let consents = state.store.consents_of_patient(&caller.access, path.id).await?;
    Ok(Json(ConsentsResponse::of(consents, state.store.now())))
}

/// Withdraw a consent
///
/// Ends every consent to the scope. With the one to `assessment` processing stops: uploads under way are refused, jobs that
/// wait are cancelled, jobs that run are stopped and nothing of them is stored, and no upload or job is taken any more. What was
/// stored before stays until it is erased. Asking again changes nothing.
#[utoipa::path(post, path = "/v1/patients/{id}/consents/withdrawal", tag = "consents", operation_id = "withdraw_consent", security(("api_key" = ["clinician"])),
    params(PatientPath), request_body = WithdrawalRequest,
    responses((status = 200, description = "What it came to", body = WithdrawalResponse)))]
async fn withdraw_consent(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(request): ApiJson<WithdrawalRequest>,
) -> Result<Json<WithdrawalResponse>, ApiError> {
    let done = state.queue.withdraw_consent(&caller.access, path.id, request.scope).await?;
    let Withdrawal { consents, jobs_cancelled, jobs_stopped } = done;
    let now = state.store.now();
    let withdrawn = consents.into_iter().map(|consent| ConsentResponse::of(consent, now)).collect();
    Ok(Json(WithdrawalResponse { withdrawn, jobs_cancelled, jobs_stopped }))
}
