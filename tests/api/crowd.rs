//! Uploads when too many jobs wait: told to come again, and when.

use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use surefoot::config::Config;

async fn second_upload(config: Config) -> (StatusCode, serde_json::Value, Option<String>) {
    let app = TestApp::with_config(config).await;
    let uploaded = app.uploaded().await;
    let session = text(&uploaded["recording"]["session_id"]).to_owned();
    let job = app.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).send().await.expect(StatusCode::OK);
    assert_eq!(job["n_ahead"], 0, "{job:#}");
    let upload = app.post(&format!("/v1/sessions/{session}/recordings"));
    let answer = upload.body("application/json", samples::json_recording()).send().await;
    let retry_after = answer.headers.get("retry-after").map(|value| value.to_str().unwrap().to_owned());
    let status = answer.status;
    app.run_pending_jobs().await;
    let upload = app.post(&format!("/v1/sessions/{session}/recordings"));
    upload.body("application/json", samples::json_recording()).send().await.expect(StatusCode::ACCEPTED);
    (status, answer.expect(status), retry_after)
}

#[tokio::test]
async fn an_organisation_with_too_many_waiting_jobs_is_told_to_come_again() {
    let config = Config { max_waiting_jobs_of_organisation: 1, ..Config::default() };
    let (status, problem, retry_after) = second_upload(config).await;
    assert_eq!((status, text(&problem["code"])), (StatusCode::TOO_MANY_REQUESTS, "too_many_waiting_jobs"));
    assert_eq!(retry_after.as_deref(), Some("5"));
    assert_eq!(problem["retry_after_s"], 5);
}

#[tokio::test]
async fn a_full_queue_is_the_services_affair() {
    let config = Config { max_waiting_jobs: 1, ..Config::default() };
    let (status, problem, retry_after) = second_upload(config).await;
    assert_eq!((status, text(&problem["code"])), (StatusCode::SERVICE_UNAVAILABLE, "queue_full"));
    assert!(retry_after.is_some());
}
