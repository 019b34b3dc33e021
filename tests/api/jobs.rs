use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use serde_json::{Value, json};
use std::sync::Arc;
use surefoot::queue::JobError;
use surefoot::worker::AttemptError;

#[tokio::test]
async fn a_finished_job_names_its_assessment() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/jobs/{}", text(&uploaded["job"]["id"]));
    let queued = app.get(&path).send().await;
    assert_eq!(queued.expect(StatusCode::OK)["state"], "queued");

    app.run_pending_jobs().await;
    let done = app.get(&path).header("if-none-match", queued.header("etag")).send().await;
    insta::assert_json_snapshot!(done.expect(StatusCode::OK), {
        ".id" => "[id]", ".recording_id" => "[id]", ".session_id" => "[id]", ".assessment_id" => "[id]",
        ".queued_at" => "[time]", ".started_at" => "[time]", ".finished_at" => "[time]", ".progress" => "[progress]",
    });
    let again = app.get(&path).header("if-none-match", done.header("etag")).send().await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn a_recording_that_cannot_be_assessed_is_a_failed_job_with_code_place_and_sentence() {
    let refuse = Arc::new(|_, _: &_, _: &_, _: &_, _: &_| {
        let sentence = "the left and the right side change places".to_owned();
        let place = Some("frames[17]".to_owned());
        Err(AttemptError::Refused(JobError { code: "handedness_mismatch".into(), place, sentence }))
    });
    let app = TestApp::with_assess(refuse).await;
    let uploaded = app.uploaded().await;
    app.run_pending_jobs().await;
    let path = format!("/v1/jobs/{}", text(&uploaded["job"]["id"]));
    let job = app.get(&path).send().await.expect(StatusCode::OK);
    let expected = json!({"code": "handedness_mismatch", "place": "frames[17]",
                          "sentence": "the left and the right side change places"});
    assert_eq!((&job["state"], &job["error"], &job["assessment_id"]), (&json!("failed"), &expected, &Value::Null));
}

#[tokio::test]
async fn a_waiting_job_is_cancelled_at_once_and_never_runs() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/jobs/{}", text(&uploaded["job"]["id"]));
    let cancelled = app.post(&format!("{path}/cancel")).send().await.expect(StatusCode::ACCEPTED);
    assert_eq!(cancelled["state"], "cancelled");
    app.post(&format!("{path}/cancel")).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    assert_eq!(app.get(&path).send().await.expect(StatusCode::OK)["state"], "cancelled");
    let assessments = app.get("/v1/assessments").send().await.expect(StatusCode::OK);
    assert_eq!(assessments["items"], json!([]));
}

#[tokio::test]
async fn a_job_that_is_over_cannot_be_cancelled() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    app.run_pending_jobs().await;
    let path = format!("/v1/jobs/{}/cancel", text(&uploaded["job"]["id"]));
    app.post(&path).send().await.refused(409, "job_over");
}

#[tokio::test]
async fn another_organisations_job_does_not_exist() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/jobs/{}", text(&uploaded["job"]["id"]));
    let elsewhere = app.stranger().await;
    app.get(&path).key(&elsewhere).send().await.refused(404, "not_found");
    app.get(&format!("{path}/events")).key(&elsewhere).send().await.refused(404, "not_found");
    app.post(&format!("{path}/cancel")).key(&elsewhere).send().await.refused(404, "not_found");
    let list = app.get("/v1/jobs").key(&elsewhere).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"], json!([]));
}

#[tokio::test]
async fn jobs_are_listed_by_state_and_recording() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    let recording = text(&uploaded["recording"]["id"]);
    app.run_pending_jobs().await;
    let settings = json!({"pipeline": "joint_angles", "method": "ik"});
    app.post(&format!("/v1/recordings/{recording}/jobs")).json(&settings).send().await.expect(StatusCode::ACCEPTED);
    let count = async |query: String| {
        let list = app.get(&format!("/v1/jobs?{query}")).send().await.expect(StatusCode::OK);
        list["items"].as_array().unwrap().len()
    };
    assert_eq!(count(format!("recording_id={recording}")).await, 2);
    assert_eq!(count("state=queued".into()).await, 1);
    assert_eq!(count("state=failed".into()).await, 0);
    app.get("/v1/jobs?state=lost").send().await.refused(400, "invalid_request");
}
