use crate::support::{TestApp, text};
use axum::http::StatusCode;
use serde_json::json;
use surefoot::storage::Role;

#[tokio::test]
async fn a_session_is_made_and_found_again() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let new = json!({"patient_id": patient, "started_at": "2026-11-20T09:30:00.25+01:00", "protocol": "sit_to_stand",
                     "notes": "slept badly"});
    let made = app.post("/v1/sessions").json(&new).send().await;
    let session = made.expect(StatusCode::CREATED);
    insta::assert_json_snapshot!(session, {".id" => "[id]", ".patient_id" => "[id]", ".created_by" => "[id]",
                                           ".created_at" => "[time]"}, @r#"
    {
      "created_at": "[time]",
      "created_by": "[id]",
      "id": "[id]",
      "noise_model": null,
      "notes": "slept badly",
      "patient_id": "[id]",
      "protocol": "sit_to_stand",
      "started_at": "2026-11-20T08:30:00.25Z"
    }
    "#);
    let read = app.get(made.header("location")).send().await;
    assert_eq!(read.expect(StatusCode::OK), session);
    let again = app.get(made.header("location")).header("if-none-match", read.header("etag")).send().await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn a_session_needs_a_patient_of_the_callers_organisation() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let elsewhere = app.stranger().await;
    let new = json!({"patient_id": patient});
    app.post("/v1/sessions").key(&elsewhere).json(&new).send().await.refused(404, "not_found");
    let nobody = json!({"patient_id": "00000000-0000-7000-8000-000000000000"});
    app.post("/v1/sessions").json(&nobody).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_device_sees_its_own_sessions_only() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let (device, other) = (app.key(Role::Device).await, app.key(Role::Device).await);
    let new = json!({"patient_id": patient});
    let made = app.post("/v1/sessions").key(&device).json(&new).send().await;
    made.expect(StatusCode::CREATED);
    let path = made.header("location");

    app.get(path).key(&device).send().await.expect(StatusCode::OK);
    app.get(path).key(&other).send().await.refused(404, "not_found");
    let listed = async |key: String| app.get("/v1/sessions").key(&key).send().await.expect(StatusCode::OK);
    assert_eq!(listed(device).await["items"].as_array().unwrap().len(), 1);
    assert_eq!(listed(other).await["items"], json!([]));
    let clinician = app.key(Role::Clinician).await;
    app.get(path).key(&clinician).send().await.expect(StatusCode::OK);
}

#[tokio::test]
async fn sessions_are_listed_by_patient() {
    let app = TestApp::new().await;
    let (anna, bert) = (app.patient("A").await, app.patient("B").await);
    for patient in [&anna, &anna, &bert] {
        let new = json!({"patient_id": patient});
        app.post("/v1/sessions").json(&new).send().await.expect(StatusCode::CREATED);
    }
    let first = app.get(&format!("/v1/sessions?patient_id={anna}&limit=1")).send().await.expect(StatusCode::OK);
    let second = app.get(text(&first["next"])).send().await.expect(StatusCode::OK);
    assert_eq!((first["items"].as_array().unwrap().len(), second["items"].as_array().unwrap().len()), (1, 1));
    assert!(second["next"].is_null());
    assert_ne!(first["items"][0]["id"], second["items"][0]["id"]);
    assert_eq!(second["items"][0]["patient_id"], anna);
}

#[tokio::test]
async fn a_session_with_an_impossible_time_or_text_is_refused() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let cases = [
        json!({"patient_id": patient, "started_at": "yesterday"}),
        json!({"patient_id": patient, "started_at": "9999-12-31T23:59:59-10:00"}),
        json!({"patient_id": patient, "protocol": ""}),
        json!({"patient_id": patient, "protocol": "x".repeat(65)}),
        json!({"patient_id": patient, "notes": "a\u{0}b"}),
        json!({"patient_id": "not an id"}),
    ];
    for case in cases {
        app.post("/v1/sessions").json(&case).send().await.refused(422, "invalid_body");
    }
}
