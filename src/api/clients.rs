//! Clients: the holders of keys. For administrators.

use super::auth::Admin;
use super::error::ApiError;
use super::request::{ApiJson, ApiPath};
use super::state::AppState;
use super::text;
use crate::storage::{Client, ClientId, Role};
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
    OpenApiRouter::new().routes(routes!(create_client, list_clients)).routes(routes!(revoke_client))
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
}

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
    /// Since when the key opens nothing; null while it is valid.
    #[serde(with = "time::serde::rfc3339::option")]
    pub revoked_at: Option<OffsetDateTime>,
    /// When the key was last used, to the minute.
    #[serde(with = "time::serde::rfc3339::option")]
    pub last_used_at: Option<OffsetDateTime>,
}

impl From<Client> for ClientResponse {
    fn from(client: Client) -> Self {
        let Client { id, organisation_id: _, role, label, created_at, revoked_at, last_used_at } = client;
        Self { id, role, label, created_at, revoked_at, last_used_at }
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
    request_body = ClientRequest,
    responses((status = 201, description = "Made; the key is shown this once", body = NewClientResponse)))]
async fn create_client(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiJson(request): ApiJson<ClientRequest>,
) -> Result<Response, ApiError> {
    let organisation = caller.access.organisation;
    let (client, key) = state.store.create_client(organisation, request.role, &request.label).await?;
    let body = NewClientResponse { client: client.into(), key: key.reveal().to_owned() };
    Ok((StatusCode::CREATED, Json(body)).into_response())
}

/// List clients
#[utoipa::path(get, path = "/v1/clients", tag = "clients", operation_id = "list_clients",
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
