//! Sessions: one sitting of a patient.

use super::auth::Caller;
use super::error::ApiError;
use super::etag::tagged_json;
use super::noise_models::pinned_name;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::{ApiJson, ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::storage::{ClientId, NewSession, PageRequest, PatientId, Session, SessionFilter, SessionId};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create_session, list_sessions)).routes(routes!(read_session))
}

/// A session to be made.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionRequest {
    /// Whose session it is.
    #[garde(skip)]
    pub patient_id: PatientId,
    /// When it began; the time of this request when absent.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    pub started_at: Option<OffsetDateTime>,
    /// The exercise programme or test.
    #[garde(length(chars, min = 1, max = 64), custom(text::line))]
    #[schema(min_length = 1, max_length = 64, pattern = "^[^\\u0000-\\u001f\\u007f]*$", example = "sit_to_stand")]
    pub protocol: Option<String>,
    /// Remarks; nothing that identifies a person.
    #[garde(length(chars, max = 2000), custom(text::line))]
    #[schema(max_length = 2000, pattern = "^[^\\u0000-\\u001f\\u007f]*$")]
    pub notes: Option<String>,
    /// Noise model of the sensor: `adaptive`, a shipped one, or one that the organisation trained, as `name` or
    /// `name@version`. The first assessment of each recording takes it, unless inertial units are fused in it; without a
    /// version, the newest at the time of the upload. Null means the method's own choice.
    #[garde(skip)]
    #[schema(pattern = "^[a-z][a-z0-9-]{0,63}(@[1-9][0-9]{0,9})?$", example = "kinect-v2")]
    pub noise_model: Option<String>,
}

/// A session.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct SessionResponse {
    /// Identity.
    pub id: SessionId,
    /// Whose session it is.
    pub patient_id: PatientId,
    /// The client that made it.
    pub created_by: ClientId,
    /// When it began.
    #[serde(with = "time::serde::rfc3339")]
    pub started_at: OffsetDateTime,
    /// The exercise programme or test.
    pub protocol: Option<String>,
    /// Remarks.
    pub notes: Option<String>,
    /// Noise model of the sensor, as settings name it.
    pub noise_model: Option<String>,
    /// When it was made known.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

impl From<Session> for SessionResponse {
    fn from(session: Session) -> Self {
        let Session { id, patient_id, created_by, started_at, protocol, notes, noise_model, created_at } = session;
        Self { id, patient_id, created_by, started_at, protocol, notes, noise_model, created_at }
    }
}

/// Address of one session.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct SessionPath {
    /// The session.
    #[param(value_type = String, format = Uuid)]
    pub id: SessionId,
}

/// Which sessions are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct SessionsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
    /// Only of this patient.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub patient_id: Option<PatientId>,
}

/// Begin a session
///
/// A device sees the sessions that it made itself, and what hangs on them.
#[utoipa::path(post, path = "/v1/sessions", tag = "sessions", operation_id = "create_session",
    security(("api_key" = ["device"])),
    request_body = SessionRequest,
    responses((status = 201, description = "Made; Location says where it lives", body = SessionResponse),
              (status = 404, description = "There is no such patient", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn create_session(
    State(state): State<AppState>,
    caller: Caller,
    ApiJson(request): ApiJson<SessionRequest>,
) -> Result<Response, ApiError> {
    let SessionRequest { patient_id, started_at, protocol, notes, noise_model } = request;
    if let Some(name) = &noise_model {
        pinned_name(&state, &caller.access, name).await?;
    }
    let started_at = started_at.unwrap_or_else(|| state.store.now());
    let new = NewSession { patient_id, started_at, protocol, notes, noise_model };
    let session = state.store.create_session(&caller.access, &new).await?;
    let location = format!("/v1/sessions/{}", session.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(SessionResponse::from(session))).into_response())
}

/// List sessions
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/sessions", tag = "sessions", operation_id = "list_sessions",
    security(("api_key" = ["device"])), params(SessionsQuery),
    responses((status = 200, description = "One page", body = Page<SessionResponse>)))]
async fn list_sessions(
    State(state): State<AppState>,
    caller: Caller,
    ApiQuery(query): ApiQuery<SessionsQuery>,
) -> Result<Json<Page<SessionResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(SessionId), limit };
    let link = PageLink::new("/v1/sessions", limit, &[("patient_id", query.patient_id.map(|id| id.to_string()))]);
    let filter = SessionFilter { patient_id: query.patient_id, ..SessionFilter::default() };
    let found = state.store.sessions(&caller.access, &filter, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, SessionResponse::from)))
}

/// Read a session
#[utoipa::path(get, path = "/v1/sessions/{id}", tag = "sessions", operation_id = "read_session",
    security(("api_key" = ["device"])), params(SessionPath),
    responses((status = 200, description = "The session", body = SessionResponse),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_session(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<SessionPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let session = state.store.session(&caller.access, path.id).await?;
    Ok(tagged_json(&headers, &SessionResponse::from(session)))
}
