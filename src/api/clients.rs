//! Clients: the holders of keys. For administrators.

use super::auth::Admin;
use super::error::{ApiError, FieldError};
use super::request::{ApiJson, ApiPath};
use super::state::AppState;
use super::text;
use crate::storage::{Client, ClientId, Role, Rotation};
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create_client, list_clients))
        .routes(routes!(revoke_client))
        .routes(routes!(rotate_client))
}

/// A client to be made.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClientRequest {
    /// What it may do.
    #[garde(skip)]
    pub role: Role,
    /// Whose key it is, for people.
    #[garde(length(chars, min = 1, max = 64), custom(text::required_line))]
    #[schema(min_length = 1, max_length = 64, pattern = "^[^\\u0000-\\u001f\\u007f]*$", example = "living room kit 7")]
    pub label: String,
    /// When the key is to end by itself; absent for a key that does not.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    pub expires_at: Option<OffsetDateTime>,
}

/// What a rotation changes besides the key.
#[derive(Debug, Clone, Default, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RotationRequest {
    /// For how many seconds the key before opens as well; absent ends it at once.
    #[garde(range(max = LONGEST_OVERLAP_S))]
    #[serde(default)]
    #[schema(minimum = 0, maximum = 2_592_000)]
    pub overlap_s: Option<u32>,
    /// When the new key is to end by itself; absent leaves the end of the key before.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    pub expires_at: Option<OffsetDateTime>,
}

/// Longest time in which two keys of one client open, seconds: thirty days, in which every kit is switched on once.
const LONGEST_OVERLAP_S: u32 = 30 * 24 * 3600;

/// A holder of a key.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ClientResponse {
    /// Identity.
    pub id: ClientId,
    /// What it may do.
    pub role: Role,
    /// Whose key it is, for people.
    pub label: String,
    /// When the key was made.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// When the key ends by itself; null for one that does not.
    #[serde(with = "time::serde::rfc3339::option")]
    pub expires_at: Option<OffsetDateTime>,
    /// Until when the key before the last rotation opens as well; null when there was none.
    #[serde(with = "time::serde::rfc3339::option")]
    pub previous_key_until: Option<OffsetDateTime>,
    /// Since when the key opens nothing; null while it is valid.
    #[serde(with = "time::serde::rfc3339::option")]
    pub revoked_at: Option<OffsetDateTime>,
    /// When the key was last used, to the minute.
    #[serde(with = "time::serde::rfc3339::option")]
    pub last_used_at: Option<OffsetDateTime>,
}

impl From<Client> for ClientResponse {
    fn from(client: Client) -> Self {
        let Client { id, organisation_id: _, role, label, created_at, expires_at, .. } = client;
        let Client { revoked_at, previous_key_until, last_used_at, .. } = client;
        Self { id, role, label, created_at, expires_at, previous_key_until, revoked_at, last_used_at }
    }
}

/// A new client with its key.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct NewClientResponse {
    /// The client.
    pub client: ClientResponse,
    /// The key. It is shown this once and not stored.
    #[schema(example = "surefoot_…")]
    pub key: String,
}

/// Every client of the organisation.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ClientsResponse {
    /// The clients, oldest first, revoked ones too.
    pub items: Vec<ClientResponse>,
}

/// Address of one client.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct ClientPath {
    /// The client.
    #[param(value_type = String, format = Uuid)]
    pub id: ClientId,
}

/// Make a client and its key
///
/// The key is in the answer and nowhere else: it cannot be shown again.
#[utoipa::path(post, path = "/v1/clients", tag = "clients", operation_id = "create_client",
    security(("api_key" = ["admin"])),
    request_body = ClientRequest,
    responses((status = 201, description = "Made; the key is shown this once", body = NewClientResponse)))]
async fn create_client(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiJson(request): ApiJson<ClientRequest>,
) -> Result<Response, ApiError> {
    check_is_ahead(&state, request.expires_at)?;
    let ClientRequest { role, label, expires_at } = request;
    let made = state.store.create_client_until(caller.access.organisation, role, &label, expires_at);
    let (client, key) = made.await?;
    let body = NewClientResponse { client: client.into(), key: key.reveal().to_owned() };
    Ok((StatusCode::CREATED, Json(body)).into_response())
}

/// List clients
#[utoipa::path(get, path = "/v1/clients", tag = "clients", operation_id = "list_clients",
    security(("api_key" = ["admin"])),
    responses((status = 200, description = "Every client of the organisation", body = ClientsResponse)))]
async fn list_clients(State(state): State<AppState>, Admin(caller): Admin) -> Result<Json<ClientsResponse>, ApiError> {
    let clients = state.store.clients(caller.access.organisation).await?;
    Ok(Json(ClientsResponse { items: clients.into_iter().map(ClientResponse::from).collect() }))
}

/// Revoke a client's key
///
/// The key opens nothing from then on; the client stays in the list, because recordings name it. Repeating it changes
/// nothing.
#[utoipa::path(delete, path = "/v1/clients/{id}", tag = "clients", operation_id = "revoke_client",
    security(("api_key" = ["admin"])),
    params(ClientPath),
    responses((status = 200, description = "The client, revoked", body = ClientResponse),
              (status = 409, description = "A key cannot revoke itself", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn revoke_client(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiPath(path): ApiPath<ClientPath>,
) -> Result<Json<ClientResponse>, ApiError> {
    if path.id == caller.client.id {
        let detail = "A key cannot revoke itself, or an organisation could lock itself out. Use another admin key.";
        return Err(ApiError::Conflict("own_key", detail.into()));
    }
    Ok(Json(state.store.revoke_client(caller.access.organisation, path.id).await?.into()))
}

/// Replace a client's key
///
/// The client stays who it is: a device keeps its sessions. The key before ends at once, or after `overlap_s`, in which both
/// open. The new key is in the answer and nowhere else.
#[utoipa::path(post, path = "/v1/clients/{id}/rotate", tag = "clients", operation_id = "rotate_client",
    security(("api_key" = ["admin"])),
    params(ClientPath), request_body = RotationRequest,
    responses((status = 200, description = "The client with its new key, which is shown this once", body = NewClientResponse),
              (status = 409, description = "The key was revoked, or has come to its end and no later one is given",
               body = super::error::Problem, content_type = "application/problem+json")))]
async fn rotate_client(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiPath(path): ApiPath<ClientPath>,
    ApiJson(request): ApiJson<RotationRequest>,
) -> Result<Json<NewClientResponse>, ApiError> {
    check_is_ahead(&state, request.expires_at)?;
    let overlap = time::Duration::seconds(request.overlap_s.unwrap_or(0).into());
    let rotation = Rotation { overlap, expires_at: request.expires_at };
    let (client, key) = state.store.rotate_client(caller.access.organisation, path.id, rotation).await?;
    Ok(Json(NewClientResponse { client: client.into(), key: key.reveal().to_owned() }))
}

/// What ends in the past would never begin.
pub(super) fn check_is_ahead(state: &AppState, expires_at: Option<OffsetDateTime>) -> Result<(), ApiError> {
    match expires_at {
        Some(end) if end <= state.store.now() => {
            Err(ApiError::InvalidBody(vec![FieldError::new("expires_at", "must lie ahead")]))
        }
        _ => Ok(()),
    }
}
