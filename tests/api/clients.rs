use crate::support::{TestApp, text};
use axum::http::{Method, StatusCode};
use serde_json::json;
use std::sync::Arc;
use surefoot::config::Config;
use surefoot::storage::{ManualClock, Role};
use time::Duration;
use time::macros::datetime;

#[tokio::test]
async fn a_key_is_shown_once_works_and_stops_working_when_revoked() {
    let app = TestApp::new().await;
    let new = json!({"role": "clinician", "label": "ward 3"});
    let made = app.post("/v1/clients").json(&new).send().await.expect(StatusCode::CREATED);
    let key = text(&made["key"]);
    app.get("/v1/patients").key(key).send().await.expect(StatusCode::OK);

    let listed = app.get("/v1/clients").send().await;
    assert!(!String::from_utf8_lossy(&listed.body).contains(key), "a list must not show keys");
    assert_eq!(listed.expect(StatusCode::OK)["items"].as_array().unwrap().len(), 2);

    let path = format!("/v1/clients/{}", text(&made["client"]["id"]));
    let revoked = app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert!(revoked["revoked_at"].is_string());
    let again = app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert_eq!(again["revoked_at"], revoked["revoked_at"], "revoking again changes nothing");
    app.get("/v1/patients").key(key).send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn only_an_admin_of_the_organisation_manages_its_keys() {
    let app = TestApp::new().await;
    for role in [Role::Device, Role::Clinician] {
        let key = app.key(role).await;
        app.get("/v1/clients").key(&key).send().await.refused(403, "forbidden");
        let new = json!({"role": "admin", "label": "me"});
        app.post("/v1/clients").key(&key).json(&new).send().await.refused(403, "forbidden");
    }
    let clients = app.get("/v1/clients").send().await.expect(StatusCode::OK);
    let path = format!("/v1/clients/{}", text(&clients["items"][1]["id"]));
    let elsewhere = app.stranger().await;
    app.request(Method::DELETE, &path).key(&elsewhere).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_key_cannot_revoke_itself() {
    let app = TestApp::new().await;
    let clients = app.get("/v1/clients").send().await.expect(StatusCode::OK);
    let path = format!("/v1/clients/{}", text(&clients["items"][0]["id"]));
    app.request(Method::DELETE, &path).send().await.refused(409, "own_key");
}

#[tokio::test]
async fn a_role_that_does_not_exist_is_refused_by_its_path() {
    let app = TestApp::new().await;
    let new = json!({"role": "root", "label": "me"});
    let problem = app.post("/v1/clients").json(&new).send().await.refused(422, "invalid_body");
    assert_eq!(problem["errors"][0]["path"], "role");
}

#[tokio::test]
async fn a_key_ends_when_it_was_said_and_says_so() {
    let clock = ManualClock::at(datetime!(2026-11-28 08:00 UTC));
    let app = TestApp::with_clock(Config::default(), Arc::new(clock.clone())).await;
    let new = json!({"role": "clinician", "label": "locum", "expires_at": "2026-11-28T09:00:00Z"});
    let made = app.post("/v1/clients").json(&new).send().await.expect(StatusCode::CREATED);
    assert_eq!(made["client"]["expires_at"], "2026-11-28T09:00:00Z");
    let key = text(&made["key"]);
    clock.advance(Duration::minutes(59));
    app.get("/v1/patients").key(key).send().await.expect(StatusCode::OK);
    clock.advance(Duration::minutes(1));
    let problem = app.get("/v1/patients").key(key).send().await.refused(401, "key_expired");
    assert!(text(&problem["detail"]).contains("expired"), "{problem:#}");

    let past = json!({"role": "device", "label": "late", "expires_at": "2026-11-28T09:00:00Z"});
    let problem = app.post("/v1/clients").json(&past).send().await.refused(422, "invalid_body");
    assert_eq!(problem["errors"][0]["path"], "expires_at");
}

#[tokio::test]
async fn a_rotated_key_gives_way_at_once_or_after_its_overlap_and_keeps_what_it_made() {
    let clock = ManualClock::at(datetime!(2026-11-28 08:00 UTC));
    let app = TestApp::with_clock(Config::default(), Arc::new(clock.clone())).await;
    let new = json!({"role": "device", "label": "kit 7"});
    let made = app.post("/v1/clients").json(&new).send().await.expect(StatusCode::CREATED);
    let (first, id) = (text(&made["key"]), text(&made["client"]["id"]));
    let patient = app.patient("P-1").await;
    let session = app.post("/v1/sessions").key(first).json(&json!({"patient_id": patient})).send().await;
    let session = format!("/v1/sessions/{}", text(&session.expect(StatusCode::CREATED)["id"]));

    let rotate = format!("/v1/clients/{id}/rotate");
    let rotated = app.post(&rotate).json(&json!({"overlap_s": 3600})).send().await.expect(StatusCode::OK);
    let second = text(&rotated["key"]);
    assert_eq!(rotated["client"]["previous_key_until"], "2026-11-28T09:00:00Z");
    for key in [first, second] {
        app.get(&session).key(key).send().await.expect(StatusCode::OK);
    }
    clock.advance(Duration::hours(1));
    app.get(&session).key(first).send().await.refused(401, "key_expired");
    app.get(&session).key(second).send().await.expect(StatusCode::OK);

    let rotated = app.post(&rotate).json(&json!({})).send().await.expect(StatusCode::OK);
    app.get(&session).key(second).send().await.refused(401, "key_expired");
    app.get(&session).key(first).send().await.refused(401, "unauthenticated");
    app.get(&session).key(text(&rotated["key"])).send().await.expect(StatusCode::OK);

    app.request(Method::DELETE, &format!("/v1/clients/{id}")).send().await.expect(StatusCode::OK);
    app.post(&rotate).json(&json!({})).send().await.refused(409, "client_revoked");
    let too_long = json!({"overlap_s": 2_592_001});
    app.post(&rotate).json(&too_long).send().await.refused(422, "invalid_body");
}

#[tokio::test]
async fn a_key_that_ended_is_replaced_only_by_one_that_ends_later() {
    let clock = ManualClock::at(datetime!(2026-11-28 08:00 UTC));
    let app = TestApp::with_clock(Config::default(), Arc::new(clock.clone())).await;
    let new = json!({"role": "clinician", "label": "locum", "expires_at": "2026-11-28T09:00:00Z"});
    let made = app.post("/v1/clients").json(&new).send().await.expect(StatusCode::CREATED);
    clock.advance(Duration::hours(2));
    let rotate = format!("/v1/clients/{}/rotate", text(&made["client"]["id"]));
    app.post(&rotate).json(&json!({"overlap_s": 60})).send().await.refused(409, "key_expired");
    let later = json!({"overlap_s": 60, "expires_at": "2026-12-28T09:00:00Z"});
    let rotated = app.post(&rotate).json(&later).send().await.expect(StatusCode::OK);
    app.get("/v1/patients").key(text(&rotated["key"])).send().await.expect(StatusCode::OK);
    // An overlap does not bring a key back to life.
    app.get("/v1/patients").key(text(&made["key"])).send().await.refused(401, "key_expired");
}
