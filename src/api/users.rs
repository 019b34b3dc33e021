//! Users: people who sign in to the pages with a name and a password, or bring a token of the identity provider. For administrators;
//! and who one is oneself.

use super::auth::{Admin, Caller};
use super::error::ApiError;
use super::request::{ApiJson, ApiPath};
use super::state::AppState;
use super::text;
use crate::storage::users::is_user_name;
use crate::storage::{ClientId, NewUser, OrganisationId, Role, User};
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create_user, list_users))
        .routes(routes!(disable_user))
        .routes(routes!(reset_user))
        .routes(routes!(read_me))
}

/// What a user may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum UserRole {
    /// Reads the patients of the organisation.
    Clinician,
    /// Everything in the organisation.
    Admin,
}

impl From<UserRole> for Role {
    fn from(role: UserRole) -> Self {
        match role {
            UserRole::Clinician => Role::Clinician,
            UserRole::Admin => Role::Admin,
        }
    }
}

/// A user to be made.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct UserRequest {
    /// Name at the sign-in, unique in the installation.
    #[garde(custom(user_name))]
    #[schema(pattern = "^[a-z0-9][a-z0-9._-]{2,63}$", example = "m.lee")]
    pub name: String,
    /// What the user may do.
    #[garde(skip)]
    pub role: UserRole,
    /// Who it is, for people.
    #[garde(length(chars, min = 1, max = 64), custom(text::required_line))]
    #[schema(min_length = 1, max_length = 64, pattern = "^[^\\u0000-\\u001f\\u007f]*$", example = "Dr Lee, ward 3")]
    pub label: String,
}

fn user_name(name: &str, _: &()) -> garde::Result {
    if is_user_name(name) {
        return Ok(());
    }
    Err(garde::Error::new(
        "must be 3 to 64 lower-case letters, digits, `.`, `_` or `-`, beginning with a letter or digit",
    ))
}

/// Somebody who signs in.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct UserResponse {
    /// Identity; sessions, entries and shares name it as that of a client.
    pub id: ClientId,
    /// Name at the sign-in; null for a user of the identity provider.
    pub name: Option<String>,
    /// What the user may do.
    pub role: Role,
    /// Who it is, for people.
    pub label: String,
    /// True until the user has replaced the password that was given out.
    pub must_change_password: bool,
    /// Who vouches for the user; null for one with a password.
    pub issuer: Option<String>,
    /// Who the user is to the issuer; null for one with a password.
    pub subject: Option<String>,
    /// When the user was made.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// Since when the user can do nothing; null while enabled.
    #[serde(with = "time::serde::rfc3339::option")]
    pub disabled_at: Option<OffsetDateTime>,
    /// When the user was last there, to the minute; of the pages the last sign-in counts.
    #[serde(with = "time::serde::rfc3339::option")]
    pub last_used_at: Option<OffsetDateTime>,
}

impl From<User> for UserResponse {
    fn from(User { client, name, must_change_password, issuer, subject }: User) -> Self {
        Self {
            id: client.id,
            name,
            role: client.role,
            label: client.label,
            must_change_password,
            issuer,
            subject,
            created_at: client.created_at,
            disabled_at: client.revoked_at,
            last_used_at: client.last_used_at,
        }
    }
}

/// A user with a new password.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct NewUserResponse {
    /// The user.
    pub user: UserResponse,
    /// The password for the next sign-in, which asks for another. It is shown this once and not stored.
    pub password: String,
}

/// Every user of the organisation.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct UsersResponse {
    /// The users, oldest first, disabled ones too.
    pub items: Vec<UserResponse>,
}

/// Address of one user.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct UserPath {
    /// The user.
    #[param(value_type = String, format = Uuid)]
    pub id: ClientId,
}

/// Make a user
///
/// The password is in the answer and nowhere else; the first sign-in asks for another.
#[utoipa::path(post, path = "/v1/users", tag = "users", operation_id = "create_user",
    security(("api_key" = ["admin"])), request_body = UserRequest,
    responses((status = 201, description = "Made; the password is shown this once", body = NewUserResponse),
              (status = 409, description = "The name is taken, here or in another organisation of the installation",
               body = super::error::Problem, content_type = "application/problem+json")))]
async fn create_user(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiJson(request): ApiJson<UserRequest>,
) -> Result<(StatusCode, Json<NewUserResponse>), ApiError> {
    let new = NewUser { name: request.name, role: request.role.into(), label: request.label };
    let (user, password) = state.store.create_user(caller.access.organisation, &new).await?;
    let body = NewUserResponse { user: user.into(), password: password.reveal().to_owned() };
    Ok((StatusCode::CREATED, Json(body)))
}

/// List users
#[utoipa::path(get, path = "/v1/users", tag = "users", operation_id = "list_users", security(("api_key" = ["admin"])),
    responses((status = 200, description = "Every user of the organisation", body = UsersResponse)))]
async fn list_users(State(state): State<AppState>, Admin(caller): Admin) -> Result<Json<UsersResponse>, ApiError> {
    let users = state.store.users(caller.access.organisation).await?;
    Ok(Json(UsersResponse { items: users.into_iter().map(UserResponse::from).collect() }))
}

/// Reset a user's password
///
/// The user's sessions end, failed sign-ins are forgotten, and the next sign-in takes the password of the answer and asks for another.
#[utoipa::path(post, path = "/v1/users/{id}/reset", tag = "users", operation_id = "reset_user",
    security(("api_key" = ["admin"])), params(UserPath),
    responses((status = 200, description = "The user; the password is shown this once", body = NewUserResponse),
              (status = 409, description = "The user is disabled, or has no password here", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn reset_user(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiPath(path): ApiPath<UserPath>,
) -> Result<Json<NewUserResponse>, ApiError> {
    let (user, password) = state.store.reset_user(caller.access.organisation, path.id).await?;
    Ok(Json(NewUserResponse { user: user.into(), password: password.reveal().to_owned() }))
}

/// Disable a user
///
/// Sessions end at once and tokens open nothing; the user stays in the list, because entries name it. Repeating it changes nothing.
#[utoipa::path(delete, path = "/v1/users/{id}", tag = "users", operation_id = "disable_user",
    security(("api_key" = ["admin"])), params(UserPath),
    responses((status = 200, description = "The user, disabled", body = UserResponse),
              (status = 409, description = "Nobody disables themselves", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn disable_user(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiPath(path): ApiPath<UserPath>,
) -> Result<Json<UserResponse>, ApiError> {
    if path.id == caller.client.id {
        let detail =
            "You cannot disable yourself, or an organisation could lock itself out. Ask another administrator.";
        return Err(ApiError::Conflict("own_user", detail.into()));
    }
    Ok(Json(state.store.disable_user(caller.access.organisation, path.id).await?.into()))
}

/// Whoever asks.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct MeResponse {
    /// Identity; a patient is shared with this id.
    pub id: ClientId,
    /// What one may do.
    pub role: Role,
    /// Who one is, for people.
    pub label: String,
    /// The organisation one belongs to.
    pub organisation_id: OrganisationId,
    /// When the key ends by itself; null for one that does not.
    #[serde(with = "time::serde::rfc3339::option")]
    pub expires_at: Option<OffsetDateTime>,
}

/// Read who one is
#[utoipa::path(get, path = "/v1/me", tag = "clients", operation_id = "read_me", security(("api_key" = ["device"])),
    responses((status = 200, description = "Whoever holds the key", body = MeResponse)))]
async fn read_me(caller: Caller) -> Json<MeResponse> {
    let client = caller.client;
    Json(MeResponse {
        id: client.id,
        role: client.role,
        label: client.label,
        organisation_id: client.organisation_id,
        expires_at: client.expires_at,
    })
}
