//! HTTP: one file per resource.
//!
//! Handlers extract, validate, ask the storage or the queue one question, and map the answer. Around all of them stand
//! [`observe`] (name, count, log, form of refusals), a guard against panics, and compression. Routes and the OpenAPI
//! document come from the same lines, so they cannot disagree.

pub mod assessments;
pub mod audit;
pub mod auditing;
pub mod auth;
pub mod clients;
pub mod consents;
mod docs;
pub mod entries;
pub mod erasures;
pub mod error;
pub mod etag;
pub mod exports;
pub mod fhir;
pub mod health;
pub mod jobs;
pub mod metrics;
pub mod noise_models;
pub mod observe;
pub mod oidc;
mod openapi;
pub mod page;
pub mod patient_export;
pub mod patients;
pub mod peer;
pub mod protocols;
pub mod rates;
pub mod recordings;
pub mod report;
pub mod request;
pub mod series;
pub mod sessions;
pub mod shares;
pub mod state;
pub mod text;
pub mod upload;
pub mod users;

pub use state::AppState;

use axum::Router;
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware;
use std::time::Duration;
use tower::util::option_layer;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{NotForContentType, Predicate, SizeAbove};
use tower_http::sensitive_headers::SetSensitiveRequestHeadersLayer;
use tower_http::set_header::SetResponseHeaderLayer;
use tower_http::timeout::TimeoutLayer;
use utoipa_axum::router::OpenApiRouter;

/// Time in which an ordinary request is answered. Uploads, downloads and event streams have no such bound; uploads are
/// given up when nothing arrives for a while.
const ORDINARY_TIMEOUT: Duration = Duration::from_secs(30);
/// Answers below this size are cheaper to send than to compress, bytes.
const COMPRESS_ABOVE: u64 = 4096;
/// Headers that no log shows.
const SECRET_HEADERS: [HeaderName; 2] = [header::AUTHORIZATION, header::COOKIE];

/// Every address of the API.
pub fn router(state: AppState) -> Router {
    router_with(Router::new(), state)
}

/// Every address of the API and `others`, which are observed, guarded and compressed in the same way.
pub fn router_with(others: Router<AppState>, state: AppState) -> Router {
    let (routes, document) = documented_routes().split_for_parts();
    let compressible = SizeAbove::new(COMPRESS_ABOVE)
        .and(NotForContentType::SSE)
        .and(NotForContentType::const_new("application/octet-stream"))
        .and(NotForContentType::const_new("application/zip"))
        .and(NotForContentType::const_new("application/vnd.surefoot.mcap"));
    routes
        .merge(docs::router(&openapi::complete(&document)))
        .merge(others)
        .fallback(|| async { StatusCode::NOT_FOUND })
        .layer(middleware::from_fn_with_state(state.clone(), rates::count_strangers))
        .layer(CatchPanicLayer::custom(observe::problem_of_panic))
        .layer(middleware::from_fn_with_state(state.clone(), auditing::audit))
        .layer(middleware::from_fn(observe::observe))
        .layer(option_layer(state.config.behind_tls.then(only_by_tls)))
        .layer(CompressionLayer::new().compress_when(compressible))
        .layer(middleware::map_response(etag::weaken_when_compressed))
        .layer(SetSensitiveRequestHeadersLayer::new(SECRET_HEADERS))
        .with_state(state)
}

/// Tells browsers to come by TLS only, for a year (RFC 6797); said only where the operator has it.
fn only_by_tls() -> SetResponseHeaderLayer<HeaderValue> {
    let policy = HeaderValue::from_static("max-age=31536000");
    SetResponseHeaderLayer::overriding(header::STRICT_TRANSPORT_SECURITY, policy)
}

/// The OpenAPI document, as it is served and as it stands in `openapi/openapi.json`.
pub fn openapi_document() -> String {
    let (_, document) = documented_routes().split_for_parts();
    format!("{:#}\n", openapi::complete(&document))
}

fn documented_routes() -> OpenApiRouter<AppState> {
    let timeout = TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, ORDINARY_TIMEOUT);
    let ordinary = OpenApiRouter::new()
        .merge(patients::router())
        .merge(consents::router())
        .merge(sessions::router())
        .merge(recordings::router())
        .merge(jobs::router())
        .merge(assessments::router())
        .merge(series::router())
        .merge(noise_models::router())
        .merge(protocols::router())
        .merge(entries::router())
        .merge(report::router())
        .merge(exports::router())
        .merge(fhir::router())
        .merge(clients::router())
        .merge(users::router())
        .merge(shares::router())
        .merge(audit::router())
        .merge(health::router())
        .merge(metrics::router())
        .layer(timeout);
    OpenApiRouter::with_openapi(openapi::base())
        .merge(ordinary)
        .merge(upload::router())
        .merge(erasures::router())
        .merge(patient_export::router())
        .merge(recordings::content_router())
        .merge(jobs::events_router())
}
