//! Sign-in with an API key, and sign-out.

use super::access::{check_form_is_own, cookie, is_of_pages, no_cookie, safe_next};
use super::attempts::Attempts;
use super::error::PageError;
use super::frame::{Frame, page};
use crate::api::AppState;
use crate::api::auth::page_token;
use crate::api::observe::ForPerson;
use crate::storage::ApiKey;
use askama::Template;
use axum::extract::{Extension, Form, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use serde::Deserialize;
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

/// Where a visitor wants to go.
#[derive(Debug, Deserialize)]
pub(super) struct NextQuery {
    /// Path and query of a page.
    #[serde(default)]
    next: String,
}

/// What the form sends.
#[derive(Deserialize)]
pub(super) struct SignInForm {
    key: String,
    #[serde(default)]
    next: String,
}

impl fmt::Debug for SignInForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SignInForm").field("next", &self.next).finish_non_exhaustive()
    }
}

#[derive(Template)]
#[template(path = "sign_in.html")]
struct SignInPage<'a> {
    frame: Frame,
    next: &'a str,
    /// Why the last attempt failed.
    problem: Option<&'a str>,
}

/// The form.
pub(super) async fn show(Query(query): Query<NextQuery>) -> Result<Response, PageError> {
    form(safe_next(&query.next), None, StatusCode::OK)
}

/// Signs in a clinician or an administrator.
pub(super) async fn sign_in(
    State(state): State<AppState>,
    Extension(attempts): Extension<Arc<Attempts>>,
    headers: HeaderMap,
    Form(sent): Form<SignInForm>,
) -> Result<Response, PageError> {
    const UNKNOWN: &str =
        "This key is unknown or was revoked. Check that you copied all of it, or ask an administrator for a new one.";
    const DEVICE: &str = "This is the key of a device. Devices upload recordings; to read the pages, use the key of a clinician or of \
                          an administrator.";
    const TOO_MANY: &str = "Too many sign-ins have failed in the last minute. Wait a minute and try again.";
    check_form_is_own(&headers)?;
    let next = safe_next(&sent.next);
    let now = Instant::now();
    let wait = attempts.wait(now);
    if !wait.is_zero() {
        let mut response = form(next, Some(TOO_MANY), StatusCode::TOO_MANY_REQUESTS)?;
        response.headers_mut().insert(header::RETRY_AFTER, (wait.as_secs() + 1).into());
        return Ok(response);
    }
    let client = match state.store.client_of_key(&ApiKey::from_text(sent.key.trim())).await? {
        Some(client) if is_of_pages(client.role) => client,
        found => {
            attempts.failed(now);
            tracing::info!(is_device = found.is_some(), "a sign-in was refused");
            return match found {
                Some(_) => form(next, Some(DEVICE), StatusCode::FORBIDDEN),
                None => form(next, Some(UNKNOWN), StatusCode::UNAUTHORIZED),
            };
        }
    };
    // A session that the browser had before ends with this sign-in.
    if let Some(old) = page_token(&headers) {
        state.store.end_page_session(&old).await?;
    }
    let token = state.store.begin_page_session(client.id).await?;
    let mut response = Redirect::to(next).into_response();
    response.headers_mut().extend(cookie(&token, &headers, &state.config).map(|value| (header::SET_COOKIE, value)));
    Ok(response)
}

/// Signs out.
pub(super) async fn sign_out(State(state): State<AppState>, headers: HeaderMap) -> Result<Response, PageError> {
    check_form_is_own(&headers)?;
    if let Some(token) = page_token(&headers) {
        state.store.end_page_session(&token).await?;
    }
    let mut response = Redirect::to("/app/sign-in").into_response();
    response.headers_mut().extend(no_cookie(&headers, &state.config).map(|value| (header::SET_COOKIE, value)));
    Ok(response)
}

fn form(next: &str, problem: Option<&str>, status: StatusCode) -> Result<Response, PageError> {
    let shown = page(&SignInPage { frame: Frame::anonymous("Sign in"), next, problem })?;
    let mut response = (status, shown).into_response();
    response.extensions_mut().insert(ForPerson);
    Ok(response)
}
