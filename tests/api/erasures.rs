//! Erasure over HTTP: nothing is left, in rows, answers and files.

use crate::support::{TestApp, samples, text};
use axum::http::{Method, StatusCode};
use serde_json::{Value, json};
use std::path::Path;
use surefoot::storage::Role;

const MARKER: &str = "qz7x4marker";

fn files_with(folder: &Path, marks: &[Vec<u8>]) -> Vec<String> {
    let mut found = Vec::new();
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            found.extend(files_with(&path, marks));
        } else {
            let bytes = std::fs::read(&path).unwrap();
            if marks.iter().any(|mark| bytes.windows(mark.len()).any(|part| part == mark)) {
                found.push(path.display().to_string());
            }
        }
    }
    found
}

/// A recording whose header holds the marker; JSON, because nothing in it is compressed.
fn marked_recording() -> Vec<u8> {
    let mut recording: Value = serde_json::from_slice(&samples::json_recording()).unwrap();
    recording["header"]["protocol"] = json!(format!("seen by {MARKER}"));
    recording.to_string().into_bytes()
}

fn erase<'a>(app: &'a TestApp, patient: &str, pseudonym: &str) -> crate::support::Call<'a> {
    app.request(Method::DELETE, &format!("/v1/patients/{patient}")).header("x-confirm-pseudonym", pseudonym)
}

#[tokio::test]
async fn everything_of_an_erased_patient_is_gone_from_answers_and_files() {
    let app = TestApp::new().await;
    let other = app.patient("P-other").await;
    let pseudonym = format!("P-{MARKER}");
    let patient = app.patient(&pseudonym).await;
    let new = json!({"patient_id": patient, "notes": format!("{MARKER} wears slippers"), "protocol": MARKER});
    let session = app.post("/v1/sessions").json(&new).send().await.expect(StatusCode::CREATED);
    let session = text(&session["id"]).to_owned();
    let upload = app.post(&format!("/v1/sessions/{session}/recordings")).header("idempotency-key", MARKER);
    let uploaded = upload.body("application/json", marked_recording()).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let answers = json!({"falls_12_months": 1, "lives_in_community": true});
    app.post(&format!("/v1/patients/{patient}/questionnaires")).json(&answers).send().await.expect(StatusCode::CREATED);
    let tests = json!({"measures": {"usual_speed_mps": {"value": 0.9}}});
    app.post(&format!("/v1/patients/{patient}/measurements")).json(&tests).send().await.expect(StatusCode::CREATED);
    let plan = json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee"}]});
    app.post(&format!("/v1/patients/{patient}/training-plans")).json(&plan).send().await.expect(StatusCode::CREATED);
    let job = text(&uploaded["job"]["id"]).to_owned();
    let done = app.get(&format!("/v1/jobs/{job}")).send().await.expect(StatusCode::OK);
    let assessment = text(&done["assessment_id"]).to_owned();
    app.get(&format!("/v1/assessments/{assessment}/series")).send().await.expect(StatusCode::OK);
    // One more that waits.
    let recording = text(&uploaded["recording"]["id"]).to_owned();
    let wanted = json!({"pipeline": "joint_angles"});
    app.post(&format!("/v1/recordings/{recording}/jobs")).json(&wanted).send().await.expect(StatusCode::ACCEPTED);

    let ids = [&patient, &session, &recording, &job, &assessment];
    let raw = |id: &&String| id.parse::<uuid::Uuid>().unwrap().as_bytes().to_vec();
    let mut marks: Vec<Vec<u8>> = ids.iter().map(raw).collect();
    marks.extend(ids.iter().map(|id| id.as_bytes().to_vec()));
    marks.push(MARKER.as_bytes().to_vec());
    assert!(files_with(app.folder.path(), &marks).len() >= 2, "database or its log, and blob");

    let clinician = app.key(Role::Clinician).await;
    erase(&app, &patient, &pseudonym).key(&clinician).send().await.refused(403, "forbidden");
    let bare = app.request(Method::DELETE, &format!("/v1/patients/{patient}")).send().await;
    bare.refused(400, "invalid_request");
    erase(&app, &patient, "P-other").send().await.refused(409, "confirmation_mismatch");
    let erased = erase(&app, &patient, &pseudonym).send().await.expect(StatusCode::OK);
    assert_eq!(erased["state"], "done");
    let removed = &erased["removed"];
    for table in [
        "patients",
        "sessions",
        "recordings",
        "assessments",
        "questionnaires",
        "measurements",
        "training_plans",
        "consents",
        "idempotency_keys",
    ] {
        assert_eq!(removed[table], 1, "{table}: {erased:#}");
    }
    assert!(
        removed["jobs"] == 2 && removed["measures"].as_u64() >= Some(1) && removed["series_chunks"].as_u64() > Some(1)
    );
    assert_eq!(files_with(app.folder.path(), &marks), [""; 0]);

    for path in [
        format!("/v1/patients/{patient}"),
        format!("/v1/jobs/{job}"),
        format!("/v1/sessions/{session}"),
        format!("/v1/assessments/{assessment}"),
        format!("/v1/assessments/{assessment}/series"),
        format!("/v1/recordings/{recording}/content"),
    ] {
        app.get(&path).send().await.refused(404, "not_found");
    }
    app.run_pending_jobs().await;
    let again = erase(&app, &patient, "anything").send().await.expect(StatusCode::OK);
    assert_eq!(again["id"], erased["id"]);
    app.get(&format!("/v1/patients/{other}")).send().await.expect(StatusCode::OK);
    let audit = app.get(&format!("/v1/audit?patient_id={patient}&limit=200")).send().await.expect(StatusCode::OK);
    let entry = audit["items"].as_array().unwrap().iter().find(|entry| entry["action"] == "erasure").unwrap().clone();
    assert_eq!((&entry["detail"]["erasure"], &entry["thing"]["id"]), (&erased["id"], &Value::Null));
    assert_eq!(files_with(app.folder.path(), &marks), [""; 0], "what was asked for afterwards brings nothing back");
    let stranger = app.stranger().await;
    erase(&app, &patient, &pseudonym).key(&stranger).send().await.refused(404, "not_found");
}
