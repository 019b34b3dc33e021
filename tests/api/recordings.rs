use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use base64::Engine;
use serde_json::json;
use sha2::{Digest, Sha256};
use surefoot::storage::Role;

fn hex_digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[tokio::test]
async fn an_upload_answers_with_the_recording_and_the_address_of_its_job() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let bytes = samples::json_recording();
    let upload = app.post(&format!("/v1/sessions/{session}/recordings"));
    let answer = upload.body("application/json", bytes.clone()).send().await;
    let body = answer.expect(StatusCode::ACCEPTED);
    insta::assert_json_snapshot!(body, {
        ".**.id" => "[id]", ".**.session_id" => "[id]", ".**.patient_id" => "[id]", ".**.created_by" => "[id]",
        ".**.recording_id" => "[id]", ".**.created_at" => "[time]", ".**.queued_at" => "[time]",
        ".**.sha256" => "[digest]", ".**.size_bytes" => "[size]", ".**.joints" => "[joints]",
    });
    assert_eq!(answer.header("location"), format!("/v1/jobs/{}", text(&body["job"]["id"])));
    assert_eq!(body["recording"]["sha256"], hex_digest(&bytes));
    assert_eq!(body["recording"]["size_bytes"], bytes.len());
    app.get(answer.header("location")).send().await.expect(StatusCode::OK);
}

#[tokio::test]
async fn both_formats_are_taken_and_recognised_by_their_first_bytes_when_unnamed() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    for (kind, bytes, format) in [
        ("application/mcap", samples::mcap_recording(), "mcap"),
        ("application/vnd.surefoot.mcap", samples::mcap_recording(), "mcap"),
        ("application/octet-stream", samples::mcap_recording(), "mcap"),
        ("application/octet-stream", samples::json_recording(), "json"),
        ("application/json; charset=utf-8", samples::json_recording(), "json"),
    ] {
        let body = app.post(&path).body(kind, bytes).send().await.expect(StatusCode::ACCEPTED);
        assert_eq!(body["recording"]["inspection"]["format"], format, "{kind}");
        assert_eq!(body["recording"]["inspection"]["n_frames"], 60);
    }
    let list = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"].as_array().unwrap().len(), 5, "without a key each upload is a recording");
}

#[tokio::test]
async fn the_content_comes_back_to_the_byte_and_is_not_sent_twice() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let bytes = samples::mcap_recording();
    let upload = app.post(&format!("/v1/sessions/{session}/recordings"));
    let body = upload.body("application/mcap", bytes.clone()).send().await.expect(StatusCode::ACCEPTED);
    let path = format!("/v1/recordings/{}", text(&body["recording"]["id"]));
    assert_eq!(app.get(&path).send().await.expect(StatusCode::OK), body["recording"]);

    let content = app.get(&format!("{path}/content")).send().await;
    assert_eq!((content.status, content.header("content-type")), (StatusCode::OK, "application/mcap"));
    assert_eq!(content.body, bytes);
    let again = app.get(&format!("{path}/content")).header("if-none-match", content.header("etag"));
    assert_eq!(again.send().await.status, StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn a_digest_that_matches_is_accepted_in_both_spellings() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let bytes = samples::json_recording();
    let base64 = base64::engine::general_purpose::STANDARD.encode(Sha256::digest(&bytes));
    let upload = || app.post(&path).body("application/json", bytes.clone());
    let rfc = upload().header("content-digest", &format!("sha-256=:{base64}:")).send().await;
    rfc.expect(StatusCode::ACCEPTED);
    let plain = upload().header("x-content-sha256", &hex_digest(&bytes)).send().await;
    plain.expect(StatusCode::ACCEPTED);
}

#[tokio::test]
async fn the_same_upload_under_one_key_is_stored_once_and_answered_alike() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let upload =
        |bytes: Vec<u8>| app.post(&path).header("idempotency-key", "kit-7:0001").body("application/json", bytes).send();
    let first = upload(samples::json_recording()).await;
    let second = upload(samples::json_recording()).await;
    assert_eq!(first.expect(StatusCode::ACCEPTED), second.expect(StatusCode::ACCEPTED));
    assert_eq!(first.header("location"), second.header("location"));
    assert_eq!((first.header("idempotency-replayed"), second.header("idempotency-replayed")), ("", "true"));

    let other = surefoot::recording::encode::json(&samples::recording(61)).unwrap();
    upload(other).await.refused(422, "idempotency_key_reused");
    let list = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_key_is_free_again_after_a_refused_upload_and_belongs_to_one_client() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let upload = |bytes: Vec<u8>| app.post(&path).header("idempotency-key", "a").body("application/json", bytes);
    upload(b"{}".to_vec()).send().await.refused(422, "missing_field");
    upload(samples::json_recording()).send().await.expect(StatusCode::ACCEPTED);
    let clinician = app.key(Role::Clinician).await;
    let other = surefoot::recording::encode::json(&samples::recording(61)).unwrap();
    upload(other).key(&clinician).send().await.expect(StatusCode::ACCEPTED);
}

#[tokio::test]
async fn another_organisations_recordings_do_not_exist() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let id = text(&uploaded["recording"]["id"]);
    let session = text(&uploaded["recording"]["session_id"]);
    let elsewhere = app.stranger().await;
    for path in [
        format!("/v1/recordings/{id}"),
        format!("/v1/recordings/{id}/content"),
        format!("/v1/sessions/{session}/recordings"),
    ] {
        app.get(&path).key(&elsewhere).send().await.refused(404, "not_found");
    }
    let upload = app.post(&format!("/v1/sessions/{session}/recordings")).key(&elsewhere);
    upload.body("application/json", samples::json_recording()).send().await.refused(404, "not_found");
    let again = app.post(&format!("/v1/recordings/{id}/jobs")).key(&elsewhere);
    again.json(&json!({"pipeline": "joint_angles"})).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_device_uploads_to_its_own_sessions_only() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let (device, other) = (app.key(Role::Device).await, app.key(Role::Device).await);
    let new = json!({"patient_id": patient});
    let session = app.post("/v1/sessions").key(&device).json(&new).send().await.expect(StatusCode::CREATED);
    let path = format!("/v1/sessions/{}/recordings", text(&session["id"]));
    let upload = |key: &str| app.post(&path).key(key).body("application/json", samples::json_recording()).send();
    upload(&other).await.refused(404, "not_found");
    let body = upload(&device).await.expect(StatusCode::ACCEPTED);
    let job = format!("/v1/jobs/{}", text(&body["job"]["id"]));
    app.get(&job).key(&device).send().await.expect(StatusCode::OK);
    app.get(&job).key(&other).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_confidence_limit_that_is_no_share_is_refused() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    let settings = json!({"pipeline": "joint_angles", "min_confidence": -1.0});
    let problem = app.post(&path).json(&settings).send().await.refused(422, "invalid_body");
    assert!(problem.to_string().contains("min_confidence"), "{problem}");
}

#[tokio::test]
async fn a_recording_is_assessed_again_with_other_settings() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    let settings = json!({"pipeline": "joint_angles", "method": "particle", "particles": 128, "min_confidence": 0.5});
    let answer = app.post(&path).json(&settings).send().await;
    let job = answer.expect(StatusCode::ACCEPTED);
    let filled = json!({"pipeline": "joint_angles", "method": "particle", "pass": null, "particles": 128, "min_confidence": 0.5, "seed": 1,
                         "noise_model": null, "calibration": "recording"});
    assert_eq!(job["settings"], filled);
    assert_eq!(answer.header("location"), format!("/v1/jobs/{}", text(&job["id"])));
    app.run_pending_jobs().await;
    let list = app.get("/v1/assessments?method=particle").send().await.expect(StatusCode::OK);
    assert_eq!(list["items"].as_array().unwrap().len(), 1);
    let all = app.get("/v1/assessments").send().await.expect(StatusCode::OK);
    assert_eq!(all["items"].as_array().unwrap().len(), 2, "earlier assessments stay");
}

#[tokio::test]
async fn settings_out_of_range_are_refused_by_field() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    let few = json!({"pipeline": "joint_angles", "particles": 3, "seed": 1u64 << 60});
    let problem = app.post(&path).json(&few).send().await.refused(422, "invalid_body");
    let paths: Vec<&str> = problem["errors"].as_array().unwrap().iter().map(|e| text(&e["path"])).collect();
    assert_eq!(paths, ["particles", "seed"]);
    for bad in [json!({}), json!({"pipeline": "gait"}), json!({"pipeline": "joint_angles", "speed": 1})] {
        app.post(&path).json(&bad).send().await.refused(422, "invalid_body");
    }
}
