//! Sign-in with name and password or with an API key, and sign-out.

use super::access::{Peer, check_form_is_own, cookie, is_of_pages, no_cookie, safe_next};
use super::error::PageError;
use super::frame::{Frame, page};
use super::password;
use crate::api::AppState;
use crate::api::auditing::Recognised;
use crate::api::auth::page_token;
use crate::api::observe::ForPerson;
use crate::storage::sign_in_failures::{Concerned, MaySignIn};
use crate::storage::{ApiKey, Client, ClientId, KeyHolder, Password, SignIn};
use askama::Template;
use axum::Extension;
use axum::extract::{Form, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use serde::Deserialize;
use std::fmt;
use std::net::IpAddr;
use time::Duration;

/// Where a visitor wants to go.
#[derive(Debug, Deserialize)]
pub(super) struct NextQuery {
    /// Path and query of a page.
    #[serde(default)]
    next: String,
}

/// What the form sends: a name and a password, or a key.
#[derive(Deserialize)]
pub(super) struct SignInForm {
    #[serde(default)]
    name: String,
    #[serde(default)]
    password: String,
    #[serde(default)]
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

/// Why there is no session yet.
enum Refusal {
    /// In a sentence, with the status that goes with it.
    For(StatusCode, &'static str),
    /// Too many sign-ins have failed.
    Wait(Duration),
}

/// The form.
pub(super) async fn show(
    State(state): State<AppState>,
    headers: HeaderMap,
    Query(query): Query<NextQuery>,
) -> Result<Response, PageError> {
    if let Some(token) = page_token(&headers)
        && state.store.user_of_page_session(&token).await?.is_some_and(|user| user.must_change_password)
    {
        return Ok(Redirect::to(password::ADDRESS).into_response());
    }
    form(safe_next(&query.next), None, StatusCode::OK)
}

/// Signs in a clinician or an administrator.
pub(super) async fn sign_in(
    State(state): State<AppState>,
    Peer(from): Peer,
    Extension(recognised): Extension<Recognised>,
    headers: HeaderMap,
    Form(sent): Form<SignInForm>,
) -> Result<Response, PageError> {
    const TOO_MANY: &str = "Too many sign-ins have failed. Wait and try again; the wait grows with each failure.";
    check_form_is_own(&headers)?;
    let next = safe_next(&sent.next);
    let known = match sent.key.trim() {
        "" => with_password(&state, &sent, from).await?,
        key => with_key(&state, key, from).await?,
    };
    let (client, next) = match known {
        Ok((client, true)) => (client, password::ADDRESS),
        Ok((client, false)) => (client, next),
        Err(Refusal::For(status, why)) => {
            recognised.set_nobody();
            return form(next, Some(why), status);
        }
        Err(Refusal::Wait(wait)) => {
            recognised.set_nobody();
            let mut response = form(next, Some(TOO_MANY), StatusCode::TOO_MANY_REQUESTS)?;
            response.headers_mut().insert(header::RETRY_AFTER, (wait.whole_seconds() + 1).into());
            return Ok(response);
        }
    };
    // A session that the browser had before ends with this sign-in.
    if let Some(old) = page_token(&headers) {
        state.store.end_page_session(&old).await?;
    }
    recognised.set_client(&client);
    begin_session(&state, client.id, &headers, next).await
}

/// A new session, and the way on.
pub(super) async fn begin_session(
    state: &AppState,
    client: ClientId,
    headers: &HeaderMap,
    next: &str,
) -> Result<Response, PageError> {
    let token = state.store.begin_page_session(client).await?;
    let mut response = Redirect::to(next).into_response();
    response.headers_mut().extend(cookie(&token, headers, &state.config).map(|value| (header::SET_COOKIE, value)));
    Ok(response)
}

/// The user of a name and a password, and whether the password has to be changed first.
async fn with_password(
    state: &AppState,
    sent: &SignInForm,
    from: IpAddr,
) -> Result<Result<(Client, bool), Refusal>, PageError> {
    const WRONG: &str = "Name and password do not fit, or the account is disabled. After a few failures there is a wait. \
                         An administrator can give you a new password.";
    const LOCKED: &str =
        "Too many sign-ins with this name have failed in a row. An administrator has to give you a new password.";
    let typed = Password::from_text(&sent.password);
    Ok(match state.store.sign_in(&sent.name, &typed, from).await? {
        SignIn::Welcome(user) => Ok((user.client, user.must_change_password)),
        SignIn::Refused => Err(Refusal::For(StatusCode::UNAUTHORIZED, WRONG)),
        SignIn::Wait(wait) => Err(Refusal::Wait(wait)),
        SignIn::Locked => Err(Refusal::For(StatusCode::FORBIDDEN, LOCKED)),
    })
}

/// The client of a key. Nobody guesses 256 random bits, so failures count against the address only.
async fn with_key(state: &AppState, key: &str, from: IpAddr) -> Result<Result<(Client, bool), Refusal>, PageError> {
    const UNKNOWN: &str =
        "This key is unknown or was revoked. Check that you copied all of it, or ask an administrator for a new one.";
    const EXPIRED: &str =
        "This key has expired, or it was replaced by a new one. Ask an administrator for the new key.";
    const DEVICE: &str = "This is the key of a device. Devices upload recordings; to read the pages, use the key of a clinician or of \
                          an administrator.";
    let concerned = [Concerned::Address(from)];
    if let MaySignIn::After(wait) = state.store.may_sign_in(&concerned).await? {
        return Ok(Err(Refusal::Wait(wait)));
    }
    let (status, why) = match state.store.holder_of_key(&ApiKey::from_text(key)).await? {
        KeyHolder::Valid(client) if is_of_pages(client.role) => return Ok(Ok((client, false))),
        KeyHolder::Valid(_) => (StatusCode::FORBIDDEN, DEVICE),
        KeyHolder::Expired => (StatusCode::UNAUTHORIZED, EXPIRED),
        KeyHolder::Unknown => (StatusCode::UNAUTHORIZED, UNKNOWN),
    };
    state.store.note_failed_sign_in(&concerned).await?;
    tracing::warn!(event = "sign_in_refused", %from, "a sign-in with a key was refused");
    Ok(Err(Refusal::For(status, why)))
}

/// Signs out.
pub(super) async fn sign_out(
    State(state): State<AppState>,
    Extension(recognised): Extension<Recognised>,
    headers: HeaderMap,
) -> Result<Response, PageError> {
    check_form_is_own(&headers)?;
    if let Some(token) = page_token(&headers) {
        if let Some(client) = state.store.client_of_page_session(&token).await? {
            recognised.set_client(&client);
        }
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
