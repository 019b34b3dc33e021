//! What happens around every request: its name, its span in the log, its count, its security headers, and the last
//! word on the form of refusals.

use super::error::{PROBLEM_JSON, Problem};
use super::metrics::{LATENCY, REQUESTS};
use axum::body::Body;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use std::any::Any;
use std::time::Instant;
use tracing::Instrument;
use uuid::Uuid;

/// Header that names one request, on the way in (when the client names it) and out.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Headers that no answer lacks. Handlers may set their own value.
const DEFAULT_HEADERS: [(HeaderName, HeaderValue); 6] = [
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY")),
    (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'")),
    (HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin")),
];

/// The documentation page runs its own script and inline styles; everything comes from this server.
const DOCS_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'",
);

/// Name of one request, for handlers and layers inside.
#[derive(Debug, Clone)]
pub struct RequestId(pub String);

/// Middleware around every route.
pub async fn observe(mut request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = request_id(request.headers());
    request.extensions_mut().insert(RequestId(id.clone()));
    let method = request.method().clone();
    let in_docs = request.uri().path().starts_with("/docs");
    let matched = request.extensions().get::<MatchedPath>().cloned();
    let route = matched.as_ref().map_or("unknown", MatchedPath::as_str);
    // The address itself stays out of the log: ids in it point at people.
    let span = tracing::info_span!("request", %method, route, request_id = %id);

    let response = next.run(request).instrument(span.clone()).await;
    let mut response = as_problem(response, &id, &method);

    for (name, value) in DEFAULT_HEADERS {
        response.headers_mut().entry(name).or_insert(value);
    }
    if in_docs {
        response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, DOCS_POLICY);
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    let elapsed = started.elapsed();
    count(&method, route, &response, elapsed.as_secs_f64());
    span.in_scope(|| tracing::debug!(status = response.status().as_u16(), ?elapsed, "answered"));
    response
}

/// What becomes of a panic in a handler: logged by the panic hook, told as an internal error.
pub fn problem_of_panic(panic: Box<dyn Any + Send + 'static>) -> Response {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    tracing::error!(panic = text.unwrap_or("without a message"), "a handler panicked");
    axum::response::IntoResponse::into_response(Problem::of_status(axum::http::StatusCode::INTERNAL_SERVER_ERROR))
}

/// The client's name for the request when it is a plain word, so that it cannot forge lines of a log; else a new one.
fn request_id(headers: &HeaderMap) -> String {
    let given = headers.get(REQUEST_ID).and_then(|value| value.to_str().ok());
    let plain = |id: &&str| {
        (8..=64).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b))
    };
    given.filter(plain).map_or_else(|| Uuid::now_v7().to_string(), str::to_owned)
}

/// Marks a refusal that has its final form already: a page for a person.
#[derive(Debug, Clone, Copy)]
pub struct ForPerson;

/// Every refusal is a problem document, also those that come from the router or a layer, and carries the request's id; unless
/// it is a page [`ForPerson`].
fn as_problem(response: Response, id: &str, method: &Method) -> Response {
    let is_refusal = response.status().is_client_error() || response.status().is_server_error();
    if !is_refusal || response.extensions().get::<ForPerson>().is_some() {
        return response;
    }
    let (mut parts, _) = response.into_parts();
    let mut problem = parts.extensions.remove::<Problem>().unwrap_or_else(|| Problem::of_status(parts.status));
    problem.instance = Some(format!("urn:surefoot:request:{id}"));
    let body = serde_json::to_vec(&problem).unwrap_or_default();
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(PROBLEM_JSON));
    let body = if method == Method::HEAD { Body::empty() } else { Body::from(body) };
    Response::from_parts(parts, body)
}

fn count(method: &Method, route: &str, response: &Response, seconds: f64) {
    let method = match *method {
        Method::GET => "GET",
        Method::POST => "POST",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::HEAD => "HEAD",
        // Anybody can invent a method; each would be a series of its own.
        _ => "other",
    };
    let status = response.status().as_u16().to_string();
    metrics::counter!(REQUESTS, "method" => method, "route" => route.to_owned(), "status" => status).increment(1);
    metrics::histogram!(LATENCY, "method" => method, "route" => route.to_owned()).record(seconds);
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::routing::get;
    use axum::{Router, middleware};
    use std::time::Duration;
    use tower::ServiceExt;
    use tower_http::catch_panic::CatchPanicLayer;
    use tower_http::timeout::TimeoutLayer;

    async fn broken() {
        panic!("index 7 of patients out of range");
    }

    #[tokio::test]
    async fn a_panic_is_an_internal_error_that_tells_nothing() {
        let router = Router::new()
            .route("/", get(broken))
            .layer(CatchPanicLayer::custom(problem_of_panic))
            .layer(middleware::from_fn(observe));
        let response = router.oneshot(Request::new(Body::empty())).await.unwrap();
        assert_eq!(response.status().as_u16(), 500);
        assert_eq!(response.headers()[header::CONTENT_TYPE], PROBLEM_JSON);
        let body = axum::body::to_bytes(response.into_body(), usize::MAX).await.unwrap();
        let problem: Problem = serde_json::from_slice(&body).unwrap();
        assert_eq!(problem.code, "internal_error");
        assert!(problem.instance.is_some() && !problem.detail.contains("patients"), "{problem:?}");
    }

    #[tokio::test]
    async fn an_answer_that_takes_too_long_is_a_problem_too() {
        let router = Router::new()
            .route("/", get(std::future::pending::<()>))
            .layer(TimeoutLayer::with_status_code(axum::http::StatusCode::REQUEST_TIMEOUT, Duration::ZERO))
            .layer(middleware::from_fn(observe));
        let response = router.oneshot(Request::new(Body::empty())).await.unwrap();
        assert_eq!(response.status().as_u16(), 408);
        assert_eq!(response.headers()[header::CONTENT_TYPE], PROBLEM_JSON);
    }

    #[test]
    fn a_request_id_that_could_forge_a_log_line_is_replaced() {
        let given = |text: &'static str| HeaderMap::from_iter([(REQUEST_ID, HeaderValue::from_static(text))]);
        assert_eq!(request_id(&given("upload-0001.a")), "upload-0001.a");
        assert_ne!(request_id(&given("a b; level=error")), "a b; level=error");
        assert_ne!(request_id(&given("short")), "short");
    }
}
