//! The form of refusals that no single resource owns.

use crate::support::{TestApp, text};
use axum::http::{Method, StatusCode};
use serde_json::json;

#[tokio::test]
async fn a_missing_and_a_wrong_key_are_refused_with_a_challenge() {
    let app = TestApp::new().await;
    let missing = app.get("/v1/patients").without_key().send().await;
    missing.refused(401, "unauthenticated");
    assert!(missing.header("www-authenticate").starts_with("Bearer"));
    app.get("/v1/patients").key("surefoot_0000").send().await.refused(401, "unauthenticated");
    let basic = app.get("/v1/patients").without_key().header("authorization", "Basic dXNlcjpwYXNz");
    basic.send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn the_key_is_looked_at_before_the_body() {
    let app = TestApp::new().await;
    let nonsense = app.post("/v1/patients").without_key().body("application/json", "{");
    nonsense.send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn the_routers_own_refusals_are_problems_too() {
    let app = TestApp::new().await;
    app.get("/v2/patients").send().await.refused(404, "unknown_address");
    app.get("/").send().await.refused(404, "unknown_address");
    let method = app.request(Method::PUT, "/v1/patients").send().await;
    method.refused(405, "method_not_allowed");
    assert!(method.header("allow").contains("POST") && method.header("allow").contains("GET"));
}

#[tokio::test]
async fn a_body_that_is_not_json_is_refused_as_such() {
    let app = TestApp::new().await;
    let post = |kind: &str, body: &str| app.post("/v1/patients").body(kind, body.to_owned()).send();
    post("text/plain", "{}").await.refused(415, "unsupported_media_type");
    post("application/json", "{\"pseudonym\": ").await.refused(400, "malformed_json");
    post("application/json", "").await.refused(400, "malformed_json");
    post("application/json", "\u{feff}{}").await.refused(400, "malformed_json");
    post("application/json", &"[".repeat(50_000)).await.refused(422, "invalid_body");
    let padded = format!("{{\"pseudonym\": \"{}\"}}", "x".repeat(100_000));
    post("application/json", &padded).await.refused(413, "too_large");
    app.post("/v1/patients").send().await.refused(415, "unsupported_media_type");
}

#[tokio::test]
async fn a_malformed_id_is_refused_as_a_parameter() {
    let app = TestApp::new().await;
    let problem = app.get("/v1/patients/17").send().await.refused(400, "invalid_request");
    assert_eq!(problem["errors"][0]["path"], "id");
}

#[tokio::test]
async fn a_problem_says_what_where_and_names_its_occurrence() {
    let app = TestApp::new().await;
    let id = "00000000-0000-7000-8000-000000000000";
    let answer = app.get(&format!("/v1/patients/{id}")).header("x-request-id", "kit-7-000123").send().await;
    insta::assert_json_snapshot!(answer.refused(404, "not_found"), @r#"
    {
      "code": "not_found",
      "detail": "There is no patient with this id that your key may see. Check the id.",
      "instance": "urn:surefoot:request:kit-7-000123",
      "status": 404,
      "title": "Not found",
      "type": "urn:surefoot:problem:not_found"
    }
    "#);
    assert_eq!(answer.header("x-request-id"), "kit-7-000123");
}

#[tokio::test]
async fn every_answer_carries_the_security_headers() {
    let app = TestApp::new().await;
    for path in ["/health/live", "/v1/patients", "/nowhere", "/openapi.json"] {
        let answer = app.get(path).send().await;
        assert_eq!(answer.header("x-content-type-options"), "nosniff", "{path}");
        assert!(answer.header("content-security-policy").contains("default-src 'none'"), "{path}");
        assert!(!answer.header("cache-control").is_empty(), "{path}");
    }
}

#[tokio::test]
async fn a_large_json_answer_is_compressed_for_who_accepts_it() {
    let app = TestApp::new().await;
    for i in 0..60 {
        app.patient(&format!("P-{i}")).await;
    }
    let plain = app.get("/v1/patients").send().await;
    assert!(plain.header("content-encoding").is_empty());
    let packed = app.get("/v1/patients").header("accept-encoding", "gzip").open().await;
    assert_eq!(packed.status(), StatusCode::OK);
    assert_eq!(packed.headers()["content-encoding"], "gzip");
    let small = app.get("/health/live").header("accept-encoding", "gzip").send().await;
    assert!(small.header("content-encoding").is_empty());
}

#[tokio::test]
async fn the_document_and_its_page_come_from_the_service_itself() {
    let app = TestApp::new().await;
    let document = app.get("/openapi.json").without_key().send().await;
    assert_eq!(document.expect(StatusCode::OK)["openapi"], json!("3.1.0"));
    let page = app.get("/docs/").without_key().send().await;
    let html = String::from_utf8_lossy(&page.body);
    assert_eq!(page.status, StatusCode::OK);
    assert!(!html.contains("https://") && !html.contains("http://"), "the page needs no other server: {html}");
    let script = app.get("/docs/swagger-initializer.js").without_key().send().await;
    assert!(String::from_utf8_lossy(&script.body).contains("/openapi.json"));
    assert!(text(&document.json()["info"]["description"]).contains("RFC 9457"));
}
