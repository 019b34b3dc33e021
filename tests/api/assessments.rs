use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use serde_json::json;

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
