//! The clinician's pages, under `/app`: written on the server, readable without a script, printed as they are.
//!
//! A page asks the storage what the API would ask, and fills a template of `web/templates`. One script and one style sheet
//! (`bundle`) come from this binary; the script reads the API of the same origin with the visitor's cookie. Nothing comes from
//! outside, and the content security policy of `headers` forbids that it ever does.

mod access;
mod assessment;
mod bundle;
mod error;
mod footfall;
mod frame;
mod headers;
mod password;
mod patients;
mod report;
mod session;
mod sign_in;
mod sparkline;
mod words;

use crate::api::{self, AppState};
use axum::extract::DefaultBodyLimit;
use axum::http::StatusCode;
use axum::response::Redirect;
use axum::routing::{get, post};
use axum::{Router, middleware};
use error::PageError;
use std::time::Duration;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::timeout::TimeoutLayer;

/// Time in which a page is answered.
const TIMEOUT: Duration = Duration::from_secs(30);
/// Largest form, bytes: a key and an address.
const MAX_FORM_BYTES: usize = 8 << 10;

/// Every address of the service: the API and the pages.
pub fn router(state: AppState) -> Router {
    api::router_with(routes(), state)
}

fn routes() -> Router<AppState> {
    Router::new()
        .route("/app", get(|| async { Redirect::to(access::HOME) }))
        .route("/app/sign-in", get(sign_in::show).post(sign_in::sign_in))
        .route("/app/sign-out", post(sign_in::sign_out))
        .route(password::ADDRESS, get(password::show).post(password::change))
        .route("/app/patients", get(patients::show))
        .route("/app/patients/{id}", get(report::show))
        .route("/app/sessions/{id}", get(session::show))
        .route("/app/recordings/{id}", get(session::show_recording))
        .route("/app/assessments/{id}", get(assessment::show))
        .route("/app/assets/{name}", get(bundle::serve))
        .route("/app/{*rest}", get(|| async { PageError::NotFound("page") }))
        .layer(DefaultBodyLimit::max(MAX_FORM_BYTES))
        .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, TIMEOUT))
        .layer(CatchPanicLayer::custom(api::observe::problem_of_panic))
        .layer(middleware::from_fn(headers::complete))
}
