//! Changing one's password.

use super::access::{HOME, Peer, check_form_is_own};
use super::error::PageError;
use super::frame::{Frame, page};
use super::sign_in::begin_session;
use crate::api::AppState;
use crate::api::auth::page_token;
use crate::api::observe::ForPerson;
use crate::storage::users::SHORTEST_PASSWORD;
use crate::storage::{Password, SignIn, User};
use askama::Template;
use axum::extract::{Form, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use std::fmt;

/// Address of the form.
pub(super) const ADDRESS: &str = "/app/password";

/// What the form sends.
#[derive(Deserialize)]
pub(super) struct PasswordForm {
    current: String,
    new: String,
    again: String,
}

impl fmt::Debug for PasswordForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PasswordForm").finish_non_exhaustive()
    }
}

#[derive(Template)]
#[template(path = "password.html")]
struct PasswordPage<'a> {
    frame: Frame,
    /// Name of the user, for password managers.
    name: &'a str,
    must_change: bool,
    shortest: usize,
    /// Why the last attempt failed.
    problem: Option<&'a str>,
}

/// The user who is signed in; keys have no password.
async fn user_of(state: &AppState, headers: &HeaderMap) -> Result<User, PageError> {
    let user = match page_token(headers) {
        Some(token) => state.store.user_of_page_session(&token).await?,
        None => None,
    };
    user.filter(|user| user.name.is_some()).ok_or_else(|| PageError::SignInFirst { next: HOME.to_owned() })
}

/// The form.
pub(super) async fn show(State(state): State<AppState>, headers: HeaderMap) -> Result<Response, PageError> {
    form(&user_of(&state, &headers).await?, None, StatusCode::OK)
}

/// Changes the password. Every session of the user ends; a new one begins here.
pub(super) async fn change(
    State(state): State<AppState>,
    Peer(from): Peer,
    headers: HeaderMap,
    Form(sent): Form<PasswordForm>,
) -> Result<Response, PageError> {
    check_form_is_own(&headers)?;
    let user = user_of(&state, &headers).await?;
    let refuse = |why: &str| form(&user, Some(why), StatusCode::UNPROCESSABLE_ENTITY);
    let name = user.name.as_deref().unwrap_or_default();
    let (current, new) = (Password::from_text(&sent.current), Password::from_text(&sent.new));
    if new != Password::from_text(&sent.again) {
        return refuse("The new password was not typed the same twice.");
    }
    if new == current {
        return refuse("The new password is the current one. Choose another.");
    }
    if let Some(why) = new.weakness(name) {
        return refuse(&why);
    }
    // Asking as a sign-in does counts failures: a screen that somebody left must not be a place to guess at.
    match state.store.sign_in(name, &current, from).await? {
        SignIn::Welcome(_) => {}
        SignIn::Refused => return refuse("The current password is not right."),
        SignIn::Wait(_) | SignIn::Locked => {
            return refuse(
                "Too many attempts have failed. Wait and try again, or ask an administrator for a new password.",
            );
        }
    }
    state.store.set_password(user.client.id, &new, false).await?;
    tracing::info!(event = "password_changed", user = %user.client.id, %from, "a user has changed the password");
    begin_session(&state, user.client.id, &headers, HOME).await
}

fn form(user: &User, problem: Option<&str>, status: StatusCode) -> Result<Response, PageError> {
    let frame = Frame::of_user(user, "Change password");
    let name = user.name.as_deref().unwrap_or_default();
    let must_change = user.must_change_password;
    let shown = page(&PasswordPage { frame, name, must_change, shortest: SHORTEST_PASSWORD, problem })?;
    let mut response = (status, shown).into_response();
    response.extensions_mut().insert(ForPerson);
    Ok(response)
}
