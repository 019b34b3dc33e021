//! Refusals as pages. What went wrong inside is logged and never shown.

use super::frame::{Frame, page};
use crate::api::error::ApiError;
use crate::api::observe::ForPerson;
use crate::storage::StorageError;
use askama::Template;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Redirect, Response};

/// Why there is no page.
#[derive(Debug)]
pub(super) enum PageError {
    /// Nobody is signed in; afterwards this local address is wanted.
    SignInFirst {
        /// Path and query.
        next: String,
    },
    /// Nothing here that the visitor may see; the text names the kind of thing.
    NotFound(&'static str),
    /// The form did not come from a page of this service.
    ForeignForm,
    /// A value of the address cannot be understood; the text says which.
    Unclear(String),
    /// An answer that carries nothing but a status.
    OfStatus(StatusCode),
    /// A refusal of the API.
    Api(ApiError),
}

impl From<ApiError> for PageError {
    fn from(error: ApiError) -> Self {
        match error {
            ApiError::NotFound(what) => Self::NotFound(what),
            other => Self::Api(other),
        }
    }
}

impl From<StorageError> for PageError {
    fn from(error: StorageError) -> Self {
        ApiError::from(error).into()
    }
}

impl From<askama::Error> for PageError {
    fn from(error: askama::Error) -> Self {
        Self::Api(ApiError::internal(error))
    }
}

#[derive(Template)]
#[template(path = "error.html")]
struct ErrorPage {
    frame: Frame,
    heading: String,
    text: String,
}

impl PageError {
    /// Status, heading and text.
    fn told(&self) -> (StatusCode, String, String) {
        use StatusCode as S;
        let say = |status: S, heading: &str, text: &str| (status, heading.to_owned(), text.to_owned());
        match self {
            Self::SignInFirst { .. } => say(S::UNAUTHORIZED, "Please sign in", "This page needs a sign-in."),
            Self::NotFound(what) => (
                S::NOT_FOUND,
                "Not found".to_owned(),
                format!("There is no {what} at this address that your key may see. Check the address."),
            ),
            Self::ForeignForm => say(
                S::FORBIDDEN,
                "The form was refused",
                "It did not come from a page of this service. Open the page again and repeat what you did.",
            ),
            Self::Unclear(text) => (S::BAD_REQUEST, "The address cannot be understood".to_owned(), text.clone()),
            Self::OfStatus(status) => of_status(*status),
            Self::Api(error) => {
                let problem = error.problem();
                let status = S::from_u16(problem.status).unwrap_or(S::INTERNAL_SERVER_ERROR);
                if status.is_server_error() { of_status(status) } else { (status, problem.title, problem.detail) }
            }
        }
    }
}

fn of_status(status: StatusCode) -> (StatusCode, String, String) {
    let (heading, text) = match status {
        StatusCode::NOT_FOUND => ("Not found", "There is no page at this address."),
        StatusCode::METHOD_NOT_ALLOWED => ("Not possible", "This address does not take such a request."),
        StatusCode::REQUEST_TIMEOUT => ("Too slow", "The page took too long. Open it again."),
        status if status.is_server_error() => {
            ("Something went wrong on our side", "Try again. If it stays, tell the operator when it happened.")
        }
        _ => ("The request cannot be understood", "Go back to the list of patients and try again."),
    };
    (status, heading.to_owned(), text.to_owned())
}

impl IntoResponse for PageError {
    fn into_response(self) -> Response {
        if let Self::SignInFirst { next } = &self {
            return Redirect::to(&format!("/app/sign-in?next={}", super::access::escaped(next))).into_response();
        }
        if let Self::Api(ApiError::Internal(error)) = &self {
            tracing::error!(error = format!("{error:#}"), "a page failed");
        }
        let (status, heading, text) = self.told();
        let retry_after = if let Self::Api(error) = &self { error.retry_after() } else { None };
        let shown = page(&ErrorPage { frame: Frame::anonymous(&heading), heading, text });
        let mut response = match shown {
            Ok(page) => (status, page).into_response(),
            Err(_) => status.into_response(),
        };
        response.headers_mut().extend(retry_after);
        response.extensions_mut().insert(ForPerson);
        response
    }
}
