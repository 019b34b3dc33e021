use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use serde_json::{Value, json};

/// A new session of a patient.
async fn session_of(app: &TestApp, key: &str, patient: &str) -> String {
    let made = app.post("/v1/sessions").key(key).json(&json!({"patient_id": patient})).send().await;
    text(&made.expect(StatusCode::CREATED)["id"]).to_owned()
}

/// Uploads five seconds of standing and assesses them; ids of the recording and its assessment.
async fn assessed(app: &TestApp, key: &str, patient: &str, seed: u64) -> (String, Value) {
    let session = session_of(app, key, patient).await;
    let call = app.post(&format!("/v1/sessions/{session}/recordings")).key(key);
    let body = samples::standing_still(5, seed);
    let uploaded = call.body("application/mcap", body).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).key(key).send().await;
    (text(&uploaded["recording"]["id"]).to_owned(), job.expect(StatusCode::OK)["assessment_id"].clone())
}

/// Assesses a recording on the patient's calibration.
async fn with_patients(app: &TestApp, recording: &str) -> Value {
    let wanted = json!({"pipeline": "joint_angles", "calibration": "patient"});
    let asked = app.post(&format!("/v1/recordings/{recording}/jobs")).json(&wanted).send().await;
    let job = asked.expect(StatusCode::ACCEPTED);
    assert_eq!(job["settings"]["calibration"], "patient");
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&job["id"]))).send().await.expect(StatusCode::OK);
    assert_eq!(job["state"], "done", "{job:#}");
    assessment(app, &job["assessment_id"]).await
}

async fn assessment(app: &TestApp, id: &Value) -> Value {
    app.get(&format!("/v1/assessments/{}", text(id))).send().await.expect(StatusCode::OK)
}

fn has_warning(assessment: &Value, code: &str) -> bool {
    assessment["quality"]["warnings"].as_array().unwrap().iter().any(|warning| warning["code"] == code)
}

#[tokio::test]
async fn the_calibration_of_the_patients_other_recording_is_used_and_named() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let (_, first) = assessed(&app, &app.admin, &patient, 1).await;
    let (second, own) = assessed(&app, &app.admin, &patient, 2).await;
    let own = assessment(&app, &own).await;
    assert_eq!(own["provenance"]["settings"]["calibration"], "recording");
    assert_eq!(own["provenance"]["patient_assessment_id"], Value::Null);

    let found = with_patients(&app, &second).await;
    assert_eq!(found["provenance"]["patient_assessment_id"], first);
    let calibration = &found["quality"]["calibration"];
    assert_eq!((&calibration["patient_assessment_id"], &calibration["knowledge"]), (&first, &json!(["patient"])));
    let other = assessment(&app, &first).await;
    for i in 0..8 {
        let length =
            |document: &Value, field: &str| document["quality"]["calibration"]["segments"][i][field].as_f64().unwrap();
        let (mine, theirs) = (length(&own, "length_m"), length(&other, "length_m"));
        let used = length(&found, "length_m");
        assert!((mine.min(theirs)..=mine.max(theirs)).contains(&used), "{used} of {mine} and {theirs}");
        assert_eq!(length(&found, "measured_m"), mine);
    }
    // The same question later finds the same: what this recording brought forth itself is not the patient's other.
    let again = with_patients(&app, &second).await;
    assert_eq!(again["provenance"]["patient_assessment_id"], first);
    assert_eq!(again["summary"], found["summary"]);
}

#[tokio::test]
async fn the_newest_of_several_static_calibrations_is_taken() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let (first, _) = assessed(&app, &app.admin, &patient, 1).await;
    assessed(&app, &app.admin, &patient, 2).await;
    let (_, newest) = assessed(&app, &app.admin, &patient, 3).await;
    assert_eq!(with_patients(&app, &first).await["provenance"]["patient_assessment_id"], newest);
}

#[tokio::test]
async fn the_calibration_of_another_patient_or_organisation_is_never_used() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let other = app.patient("P-2").await;
    assessed(&app, &app.admin, &other, 1).await;
    // The same pseudonym elsewhere is another person.
    let stranger = app.stranger().await;
    let made = app.post("/v1/patients").key(&stranger).json(&json!({"pseudonym": "P-1"})).send().await;
    let elsewhere = text(&made.expect(StatusCode::CREATED)["id"]).to_owned();
    app.consent(&elsewhere, &stranger).await;
    assessed(&app, &stranger, &elsewhere, 2).await;

    let (recording, own) = assessed(&app, &app.admin, &patient, 3).await;
    let found = with_patients(&app, &recording).await;
    assert_eq!(found["provenance"]["patient_assessment_id"], Value::Null);
    assert!(has_warning(&found, "no_patient_calibration"), "{:#}", found["quality"]["warnings"]);
    assert_eq!(found["summary"], assessment(&app, &own).await["summary"]);
}

#[tokio::test]
async fn a_calibration_that_does_not_exist_is_refused_by_its_place() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let (recording, _) = assessed(&app, &app.admin, &patient, 1).await;
    let wanted = json!({"pipeline": "joint_angles", "calibration": "guess"});
    let asked = app.post(&format!("/v1/recordings/{recording}/jobs")).json(&wanted).send().await;
    asked.refused(422, "invalid_body");
}

#[tokio::test]
async fn lengths_in_the_header_of_an_upload_are_used_and_wrong_ones_are_refused_with_the_names() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let upload = |name: &str| {
        let mut recording = samples::recording(60);
        recording.header.segment_lengths_m.insert(name.into(), 0.42);
        let body = surefoot::recording::encode::mcap(&recording).unwrap();
        app.post(&format!("/v1/sessions/{session}/recordings")).body("application/mcap", body)
    };
    let refused = upload("left_tigh").send().await.refused(422, "invalid_value");
    assert!(refused.to_string().contains("left_upper_arm, left_forearm"), "{refused:#}");
    let uploaded = upload("left_thigh").send().await.expect(StatusCode::ACCEPTED);
    assert_eq!(uploaded["recording"]["inspection"]["header"]["segment_lengths_m"], json!({"left_thigh": 0.42}));
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).send().await.expect(StatusCode::OK);
    let found = assessment(&app, &job["assessment_id"]).await;
    let calibration = &found["quality"]["calibration"];
    assert_eq!(calibration["knowledge"], json!(["segment_lengths"]));
    let thigh = calibration["segments"][4]["length_m"].as_f64().unwrap();
    assert!(0.40 < thigh && thigh < 0.42, "{thigh}");
}
