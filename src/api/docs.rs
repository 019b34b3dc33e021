//! The document and the page that shows it, both from this binary: they work without a network.

use super::state::AppState;
use axum::Router;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use bytes::Bytes;
use serde_json::Value;
use utoipa_swagger_ui::{Config, SwaggerUi};

use super::etag::ETag;

/// `/openapi.json` and `/docs`.
pub(super) fn router(document: &Value) -> Router<AppState> {
    let body = Bytes::from(format!("{document:#}\n"));
    let tag = ETag::of(&[&body]);
    let serve = move |headers: HeaderMap| async move { document_response(&headers, &tag, body) };
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", get(serve)).merge(page)
}

fn document_response(headers: &HeaderMap, tag: &ETag, body: Bytes) -> Response {
    if tag.is_known(headers) {
        return tag.not_modified();
    }
    tag.on(([(header::CONTENT_TYPE, "application/json")], body).into_response())
}
