use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use serde_json::json;
use surefoot::body::Joint;
use surefoot::recording::encode;

#[tokio::test]
async fn an_assessment_comes_with_summary_quality_and_provenance() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let path = format!("/v1/assessments/{}", app.assessed().await);
    let answer = app.get(&path).send().await;
    insta::assert_json_snapshot!(answer.expect(StatusCode::OK), {
        ".id" => "[id]", ".recording_id" => "[id]", ".session_id" => "[id]", ".patient_id" => "[id]",
        ".job_id" => "[id]", ".created_at" => "[time]", ".provenance.recording_sha256" => "[digest]",
    });
    let again = app.get(&path).header("if-none-match", answer.header("etag")).send().await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn what_went_wrong_in_a_recording_is_told_with_its_times_and_counts() {
    let app = TestApp::new().await;
    let mut recording = samples::recording(90);
    let skeleton = recording.skeleton.as_mut().unwrap();
    let (n, hand) = (skeleton.joints.len(), skeleton.column(Joint::LeftHand).unwrap());
    for t in 30..60 {
        skeleton.positions[t * n + hand] = nalgebra::Vector3::repeat(f64::NAN);
        skeleton.confidence[t * n + hand] = 0.0;
    }
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let body = encode::json(&recording).unwrap();
    app.post(&path).body("application/json", body).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let listed = app.get("/v1/assessments").send().await.expect(StatusCode::OK);
    let path = format!("/v1/assessments/{}", text(&listed["items"][0]["id"]));
    let quality = app.get(&path).send().await.expect(StatusCode::OK)["quality"].clone();
    let [event] = quality["events"].as_array().unwrap().as_slice() else { panic!("one event: {quality}") };
    assert_eq!((&event["kind"], &event["subject"]), (&json!("lost_joint"), &json!("left_hand")));
    assert_eq!(event["n_frames"], 30);
    assert!((event["start_s"].as_f64().unwrap() - 1.0).abs() < 0.001);
    assert!((event["end_s"].as_f64().unwrap() - 59.0 / 30.0).abs() < 0.001);
    let counts = quality["event_counts"].as_array().unwrap();
    let of = |kind: &str| counts.iter().find(|c| c["kind"] == kind).unwrap();
    assert_eq!(of("lost_joint"), &json!({"kind": "lost_joint", "n_events": 1, "n_frames": 30}));
    assert_eq!(of("limb_swap"), &json!({"kind": "limb_swap", "n_events": 0, "n_frames": 0}));
}

#[tokio::test]
async fn assessments_are_listed_by_everything_they_hang_on() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let id = app.assessed().await;
    let assessment = app.get(&format!("/v1/assessments/{id}")).send().await.expect(StatusCode::OK);
    let nobody = "00000000-0000-7000-8000-000000000000";
    for filter in ["patient_id", "session_id", "recording_id"] {
        let of = |value: &str| format!("/v1/assessments?{filter}={value}");
        let found = app.get(&of(text(&assessment[filter]))).send().await.expect(StatusCode::OK);
        assert_eq!(found["items"][0]["id"], id, "{filter}");
        let none = app.get(&of(nobody)).send().await.expect(StatusCode::OK);
        assert_eq!(none["items"], json!([]), "{filter}");
    }
    let other = app.get("/v1/assessments?pipeline=leg_pose").send().await.expect(StatusCode::OK);
    assert_eq!(other["items"], json!([]));
}

#[tokio::test]
async fn another_organisations_assessment_does_not_exist() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let id = app.assessed().await;
    let elsewhere = app.stranger().await;
    app.get(&format!("/v1/assessments/{id}")).key(&elsewhere).send().await.refused(404, "not_found");
    app.get(&format!("/v1/assessments/{id}/series")).key(&elsewhere).send().await.refused(404, "not_found");
}
