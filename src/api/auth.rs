//! Who asks, and what the role allows.
//!
//! A handler says in its arguments whom it serves: [`Caller`] any holder of a key, [`Clinician`] a clinician or an
//! administrator, [`Admin`] an administrator. The key is looked at before the body.
//!
//! Besides a key, a reading request may bring the cookie of somebody who is signed in to the pages: their script reads the same
//! addresses. A cookie never authorises a request that changes something, so that no other site can make a browser do so.

use super::auditing::recognise;
use super::error::ApiError;
use super::oidc::Oidc;
use super::state::AppState;
use crate::storage::{Access, ApiKey, Client, KeyHolder, PageToken, Role};
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, header};

/// Name of the cookie that the pages set.
pub const PAGE_COOKIE: &str = "surefoot_page";
/// Where a request comes from, as browsers tell it.
const SEC_FETCH_SITE: &str = "sec-fetch-site";

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
        match identify(parts, state).await {
            Ok(caller) => {
                recognise(&parts.extensions, &caller.client);
                state.rates.count_client(caller.client.id).map(|()| caller)
            }
            Err(refusal @ (ApiError::Unauthenticated(_) | ApiError::KeyExpired)) => {
                // What brings nothing has been counted on its way here.
                if [header::AUTHORIZATION, header::COOKIE].iter().any(|name| parts.headers.contains_key(name)) {
                    state.rates.count_anonymous(parts, &state.config)?;
                }
                Err(refusal)
            }
            Err(other) => Err(other),
        }
    }
}

/// Whose key, or whose cookie, a request brings.
async fn identify(parts: &Parts, state: &AppState) -> Result<Caller, ApiError> {
    const HOW: &str = "This request needs an API key: send the header `Authorization: Bearer surefoot_…`.";
    const UNKNOWN: &str = "This API key is unknown or was revoked. Ask an administrator for a new one.";
    let Some(header) = parts.headers.get(header::AUTHORIZATION) else {
        return of_reading_page(parts, state).await?.ok_or(ApiError::Unauthenticated(HOW));
    };
    let header = header.to_str().map_err(|_| ApiError::Unauthenticated(HOW))?;
    let (scheme, key) = header.split_once(' ').ok_or(ApiError::Unauthenticated(HOW))?;
    if !scheme.eq_ignore_ascii_case("bearer") {
        return Err(ApiError::Unauthenticated(HOW));
    }
    if let Some(oidc) = state.oidc.as_deref().filter(|_| is_token(key.trim())) {
        return of_token(oidc, key.trim(), state).await;
    }
    match state.store.holder_of_key(&ApiKey::from_text(key.trim())).await? {
        KeyHolder::Valid(client) => Ok(Caller { access: client.access(), client }),
        KeyHolder::Expired => Err(ApiError::KeyExpired),
        KeyHolder::Unknown => Err(ApiError::Unauthenticated(UNKNOWN)),
    }
}

/// A token has three parts (RFC 7515); a key has no points.
fn is_token(text: &str) -> bool {
    text.split('.').count() == 3
}

/// Who a token of the identity provider says it is, as a user of this service.
async fn of_token(oidc: &Oidc, token: &str, state: &AppState) -> Result<Caller, ApiError> {
    const NOBODY: &str =
        "The token is good, but its user is disabled here or its organisation is not known. Ask an administrator.";
    let provided = oidc.provided(token).await?;
    let client = state.store.user_of_token(&provided).await?.ok_or(ApiError::Unauthenticated(NOBODY))?;
    Ok(Caller { access: client.access(), client })
}

/// The token in the cookie of the pages.
pub fn page_token(headers: &HeaderMap) -> Option<PageToken> {
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let pairs = cookies.flat_map(|cookies| cookies.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.filter(|(name, _)| *name == PAGE_COOKIE).map(|(_, value)| PageToken::from_text(value)).next()
}

/// Who is signed in to the pages with the cookie of a request; none for others.
///
/// # Errors
/// When the database fails.
pub async fn caller_of_page(headers: &HeaderMap, state: &AppState) -> Result<Option<Caller>, ApiError> {
    let Some(token) = page_token(headers) else { return Ok(None) };
    let client = state.store.client_of_page_session(&token).await?;
    Ok(client.map(|client| Caller { access: client.access(), client }))
}

/// The same, of a request that only reads and that no other site has caused.
async fn of_reading_page(parts: &Parts, state: &AppState) -> Result<Option<Caller>, ApiError> {
    let site = parts.headers.get(SEC_FETCH_SITE).and_then(|site| site.to_str().ok());
    let is_own = site.is_none_or(|site| ["same-origin", "none"].contains(&site));
    if !is_own || ![Method::GET, Method::HEAD].contains(&parts.method) {
        return Ok(None);
    }
    caller_of_page(&parts.headers, state).await
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
