//! Consent: nothing is uploaded or computed without it, and a withdrawal ends what goes on.

use crate::support::{TestApp, samples, text};
use axum::body::Body;
use axum::http::StatusCode;
use futures::StreamExt;
use serde_json::{Value, json};
use surefoot::config::Config;
use surefoot::storage::Role;

async fn new_session(app: &TestApp, patient: &str) -> String {
    let made = app.post("/v1/sessions").json(&json!({"patient_id": patient})).send().await;
    text(&made.expect(StatusCode::CREATED)["id"]).to_owned()
}

async fn withdraw(app: &TestApp, patient: &str) -> Value {
    let body = json!({"scope": "assessment"});
    let sent = app.post(&format!("/v1/patients/{patient}/consents/withdrawal")).json(&body).send().await;
    sent.expect(StatusCode::OK)
}

fn upload_to(session: &str) -> String {
    format!("/v1/sessions/{session}/recordings")
}

#[tokio::test]
async fn an_upload_without_consent_is_refused_with_a_code_of_its_own_before_its_body_is_read() {
    let app = TestApp::new().await;
    let patient = app.patient_without_consent("P-1").await;
    let session = new_session(&app, &patient).await;
    // A body that never comes would be waited for if anybody read it.
    let never = Body::from_stream(futures::stream::pending::<Result<bytes::Bytes, std::io::Error>>());
    let refused = app.post(&upload_to(&session)).body("application/json", never).send().await;
    let problem = refused.refused(403, "consent_required");
    assert_eq!(problem["type"], "urn:surefoot:problem:consent_required");
    assert_eq!(app.stored_uploads().await, 0);

    app.consent(&patient, &app.admin).await;
    let upload = app.post(&upload_to(&session)).body("application/json", samples::json_recording());
    upload.send().await.expect(StatusCode::ACCEPTED);
}

#[tokio::test]
async fn consents_are_listed_with_their_state_and_who_recorded_them() {
    let app = TestApp::new().await;
    let patient = app.patient_without_consent("P-1").await;
    let path = format!("/v1/patients/{patient}/consents");
    let none = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!((&none["assessment"], &none["items"]), (&json!("missing"), &json!([])));
    let past = json!({"scope": "assessment", "text_version": "v1", "given_at": "2020-01-01T00:00:00Z",
        "expires_at": "2021-01-01T00:00:00Z"});
    let recorded = app.post(&path).json(&past).send().await.expect(StatusCode::CREATED);
    assert_eq!(recorded["state"], "expired");
    app.post(&path).json(&json!({"scope": "research", "text_version": "v1"})).send().await.expect(StatusCode::CREATED);
    let listed = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!((&listed["assessment"], &listed["research"]), (&json!("expired"), &json!("valid")));
    assert_eq!(listed["items"].as_array().unwrap().len(), 2);
    assert!(listed["items"][0]["created_by"].is_string());

    for bad in [
        json!({"scope": "assessment", "text_version": "v", "given_at": "2999-01-01T00:00:00Z"}),
        json!({"scope": "assessment", "text_version": "v", "expires_at": "2020-01-01T00:00:00Z"}),
        json!({"scope": "assessment", "text_version": ""}),
        json!({"scope": "anything", "text_version": "v"}),
    ] {
        app.post(&path).json(&bad).send().await.refused(422, "invalid_body");
    }
    let device = app.key(Role::Device).await;
    app.post(&path).key(&device).json(&past).send().await.refused(403, "forbidden");
    let stranger = app.stranger().await;
    app.get(&path).key(&stranger).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_withdrawal_cancels_what_waits_and_keeps_uploads_and_jobs_out() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let patient = text(&uploaded["recording"]["patient_id"]).to_owned();
    let done = withdraw(&app, &patient).await;
    assert_eq!((&done["jobs_cancelled"], &done["jobs_stopped"]), (&json!(1), &json!(0)));
    assert_eq!(done["withdrawn"][0]["state"], "withdrawn");
    let job = app.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).send().await.expect(StatusCode::OK);
    assert_eq!(job["state"], "cancelled");

    let again = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    let again = app.post(&again).json(&json!({"pipeline": "joint_angles"})).send().await;
    let problem = again.refused(403, "consent_required");
    assert!(text(&problem["detail"]).contains("withdrawn"), "{problem:#}");
    let upload = app.post(&upload_to(text(&uploaded["recording"]["session_id"])));
    upload.body("application/json", samples::json_recording()).send().await.refused(403, "consent_required");
    assert_eq!(withdraw(&app, &patient).await["withdrawn"], json!([]), "a second time changes nothing");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_withdrawal_ends_an_upload_under_way_and_leaves_nothing_of_it() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let session = new_session(&app, &patient).await;
    let first =
        futures::stream::iter([Ok::<_, std::io::Error>(bytes::Bytes::from_static(b"{\"format\": \"surefoot\""))]);
    let (began, beginning) = tokio::sync::oneshot::channel();
    let told = futures::stream::once(async move {
        began.send(()).unwrap();
        Ok(bytes::Bytes::from_static(b","))
    });
    let body = Body::from_stream(first.chain(told).chain(futures::stream::pending()));
    let upload = app.post(&upload_to(&session)).body("application/json", body).send();
    let withdrawal = async {
        beginning.await.unwrap();
        withdraw(&app, &patient).await
    };
    let (refused, _) = tokio::join!(upload, withdrawal);
    refused.refused(403, "consent_required");
    assert_eq!(app.stored_uploads().await, 0);
}

#[tokio::test]
async fn a_test_stand_may_go_without_consent() {
    let app = TestApp::with_config(Config { require_consent: false, ..Config::default() }).await;
    let patient = app.patient_without_consent("P-1").await;
    let session = new_session(&app, &patient).await;
    let upload = app.post(&upload_to(&session)).body("application/json", samples::json_recording());
    upload.send().await.expect(StatusCode::ACCEPTED);
}
