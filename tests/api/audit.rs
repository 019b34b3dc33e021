//! Who did or read what: entries of requests, their order, and what is not in them.

use crate::support::{TestApp, samples, text};
use axum::http::{Method, StatusCode};
use serde_json::{Value, json};
use surefoot::storage::Role;

async fn entries(app: &TestApp, query: &str) -> Vec<Value> {
    let page = app.get(&format!("/v1/audit?limit=200{query}")).send().await.expect(StatusCode::OK);
    page["items"].as_array().unwrap().clone()
}

#[tokio::test]
async fn every_request_with_a_key_leaves_an_entry_without_what_it_was_about_in_words() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let patient = text(&uploaded["recording"]["patient_id"]).to_owned();
    let job = text(&uploaded["job"]["id"]).to_owned();
    let read = app.get(&format!("/v1/patients/{patient}")).header("x-request-id", "request-0001").send().await;
    read.expect(StatusCode::OK);
    let device = app.key(Role::Device).await;
    app.get(&format!("/v1/patients/{patient}")).key(&device).send().await.refused(403, "forbidden");
    app.get("/v1/patients?pseudonym_prefix=P-1").send().await.expect(StatusCode::OK);
    app.get("/v1/patients").without_key().send().await.refused(401, "unauthenticated");
    app.get("/v1/protocols").send().await.expect(StatusCode::OK);

    let found = entries(&app, "").await;
    let of = |entry: &Value| (text(&entry["action"]).to_owned(), entry["status"].as_u64().unwrap());
    let mut actions: Vec<_> = found.iter().map(of).collect();
    actions.reverse();
    let expected = [
        ("POST /v1/patients", 201),
        ("POST /v1/patients/{id}/consents", 201),
        ("POST /v1/sessions", 201),
        ("POST /v1/sessions/{id}/recordings", 202),
        ("GET /v1/patients/{id}", 200),
        ("GET /v1/patients/{id}", 403),
        ("GET /v1/patients", 200),
    ];
    assert_eq!(actions, expected.map(|(action, status)| (action.to_owned(), status)));
    let upload = &found[3];
    assert_eq!((&upload["thing"]["kind"], &upload["made"]["id"]), (&json!("session"), &json!(job)));
    assert_eq!(upload["patient"]["hash"], found[2]["thing"]["hash"]);
    assert_eq!((&found[2]["request_id"], &found[2]["actor"]["role"]), (&json!("request-0001"), &json!("admin")));
    assert_eq!(found[1]["actor"]["role"], "device");
    let all = serde_json::to_string(&found).unwrap();
    assert!(!all.contains("P-1") && !all.contains("pseudonym"), "{all}");
    assert_eq!(app.state.store.verify_audit(None).await.unwrap().broken, None);
}

#[tokio::test]
async fn entries_are_for_administrators_of_the_organisation_and_come_in_pages_and_by_patient() {
    let app = TestApp::new().await;
    let first = app.patient("P-1").await;
    let second = app.patient("P-2").await;
    for key in [app.key(Role::Device).await, app.key(Role::Clinician).await] {
        app.get("/v1/audit").key(&key).send().await.refused(403, "forbidden");
    }
    let of_first = entries(&app, &format!("&patient_id={first}")).await;
    assert_eq!(of_first.len(), 2, "made, and the consent");
    assert!(of_first.iter().all(|entry| entry["patient"]["id"] == json!(first)));
    let stranger = app.stranger().await;
    let elsewhere = app.get("/v1/audit").key(&stranger).send().await.expect(StatusCode::OK);
    assert_eq!(elsewhere["items"], json!([]));

    let mut path = "/v1/audit?limit=2".to_owned();
    let mut seen = Vec::new();
    for _ in 0..3 {
        let page = app.get(&path).send().await.expect(StatusCode::OK);
        seen.extend(page["items"].as_array().unwrap().iter().map(|entry| entry["sequence"].as_i64().unwrap()));
        path = text(&page["next"]).to_owned();
    }
    assert!(seen.is_sorted_by(|a, b| a > b) && seen.len() == 6, "{seen:?}");
    let actor = of_first[0]["actor"]["id"].as_str().unwrap();
    let none = entries(&app, &format!("&patient_id={second}&actor_id={actor}&before=2020-01-01T00:00:00Z")).await;
    assert_eq!(none.len(), 0);
}

#[tokio::test]
async fn a_change_whose_entry_cannot_be_written_is_not_acknowledged() {
    let app = TestApp::new().await;
    app.get("/v1/patients").send().await.expect(StatusCode::OK);
    let file = sqlx::sqlite::SqliteConnectOptions::new().filename(app.folder.path().join("surefoot.sqlite"));
    let pool = sqlx::sqlite::SqlitePool::connect_with(file).await.unwrap();
    let full = "CREATE TRIGGER disk_full BEFORE INSERT ON audit_entries BEGIN SELECT RAISE(ABORT, 'full'); END";
    sqlx::query(full).execute(&pool).await.unwrap();
    let made = app.post("/v1/patients").json(&json!({"pseudonym": "P-1"})).send().await;
    made.refused(500, "internal_error");
    sqlx::query("DROP TRIGGER disk_full").execute(&pool).await.unwrap();
    tokio::time::sleep(std::time::Duration::from_millis(1500)).await;
    let actions: Vec<Value> = entries(&app, "").await.into_iter().map(|entry| entry["action"].clone()).collect();
    assert!(actions.contains(&json!("POST /v1/patients")), "it is entered as soon as that is possible: {actions:?}");
}

#[tokio::test]
async fn a_client_that_goes_away_takes_no_entry_with_it() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let upload = app.post(&format!("/v1/sessions/{session}/recordings"));
    let upload = upload.body("application/json", samples::json_recording()).send();
    // Given up as soon as it has begun.
    let _ = tokio::time::timeout(std::time::Duration::from_millis(1), upload).await;
    for _ in 0..200 {
        let jobs = app.get("/v1/jobs").send().await.expect(StatusCode::OK);
        if jobs["items"].as_array().unwrap().len() == 1 {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    let found = entries(&app, "").await;
    assert!(found.iter().any(|entry| entry["action"] == "POST /v1/sessions/{id}/recordings"), "{found:#?}");
}

#[tokio::test]
async fn a_method_that_does_not_exist_and_an_address_that_does_not_leave_no_entry() {
    let app = TestApp::new().await;
    app.request(Method::PUT, "/v1/patients").send().await.refused(405, "method_not_allowed");
    app.get("/nowhere").send().await.refused(404, "unknown_address");
    assert_eq!(entries(&app, "").await.len(), 0);
}
