//! Who asks, and what the role allows.
//!
//! A handler says in its arguments whom it serves: [`Caller`] any holder of a key, [`Clinician`] a clinician or an
//! administrator, [`Admin`] an administrator. The key is looked at before the body.

use super::error::ApiError;
use super::state::AppState;
use crate::storage::{Access, ApiKey, Client, Role};
use axum::extract::FromRequestParts;
use axum::http::header;
use axum::http::request::Parts;

/// The holder of a valid key.
#[derive(Debug, Clone)]
pub struct Caller {
    /// Whose key it is.
    pub client: Client,
    /// How far it reaches.
    pub access: Access,
}

/// A clinician or an administrator.
#[derive(Debug, Clone)]
pub struct Clinician(pub Caller);

/// An administrator.
#[derive(Debug, Clone)]
pub struct Admin(pub Caller);

impl FromRequestParts<AppState> for Caller {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, ApiError> {
        const HOW: &str = "This request needs an API key: send the header `Authorization: Bearer surefoot_…`.";
        const UNKNOWN: &str = "This API key is unknown or was revoked. Ask an administrator for a new one.";
        let header = parts.headers.get(header::AUTHORIZATION).ok_or(ApiError::Unauthenticated(HOW))?;
        let header = header.to_str().map_err(|_| ApiError::Unauthenticated(HOW))?;
        let (scheme, key) = header.split_once(' ').ok_or(ApiError::Unauthenticated(HOW))?;
        if !scheme.eq_ignore_ascii_case("bearer") {
            return Err(ApiError::Unauthenticated(HOW));
        }
        let client = state.store.client_of_key(&ApiKey::from_text(key.trim())).await?;
        let client = client.ok_or(ApiError::Unauthenticated(UNKNOWN))?;
        Ok(Self { access: client.access(), client })
    }
}

impl FromRequestParts<AppState> for Clinician {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, ApiError> {
        let caller = Caller::from_request_parts(parts, state).await?;
        match caller.client.role {
            Role::Clinician | Role::Admin => Ok(Self(caller)),
            Role::Device => Err(ApiError::Forbidden("clinician or admin")),
        }
    }
}

impl FromRequestParts<AppState> for Admin {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, ApiError> {
        let caller = Caller::from_request_parts(parts, state).await?;
        match caller.client.role {
            Role::Admin => Ok(Self(caller)),
            Role::Clinician | Role::Device => Err(ApiError::Forbidden("admin")),
        }
    }
}
