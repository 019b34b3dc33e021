use crate::support::TestApp;
use axum::http::StatusCode;

#[tokio::test]
async fn a_service_lives_and_is_ready() {
    let app = TestApp::new().await;
    for path in ["/health/live", "/health/ready"] {
        let health = app.get(path).without_key().send().await.expect(StatusCode::OK);
        assert_eq!(health["status"], "ok");
    }
}

#[tokio::test]
async fn a_service_without_its_folder_of_parts_lives_but_is_not_ready() {
    let app = TestApp::new().await;
    std::fs::remove_dir_all(app.folder.path().join("parts")).unwrap();
    app.get("/health/live").without_key().send().await.expect(StatusCode::OK);
    app.get("/health/ready").without_key().send().await.refused(503, "unavailable");
}

#[tokio::test]
async fn a_service_whose_database_is_closed_lives_but_is_not_ready() {
    let app = TestApp::new().await;
    app.state.store.close().await;
    app.get("/health/ready").without_key().send().await.refused(503, "unavailable");
    let problem = app.get("/v1/patients").send().await.refused(500, "internal_error");
    assert!(!problem.to_string().contains("pool"), "{problem:#}");
}

#[tokio::test]
async fn metrics_count_requests_by_route_and_jobs_by_state() {
    let app = TestApp::new().await;
    app.uploaded().await;
    let metrics = app.get("/metrics").without_key().send().await;
    let text = String::from_utf8_lossy(&metrics.body);
    assert_eq!(metrics.status, StatusCode::OK);
    for expected in [
        r#"surefoot_http_requests_total{method="POST",route="/v1/sessions/{id}/recordings",status="202"}"#,
        "surefoot_http_request_duration_seconds_bucket",
        r#"surefoot_jobs{state="queued"}"#,
        "surefoot_upload_bytes_total",
        "surefoot_half_uploads 0",
        "surefoot_half_upload_bytes 0",
    ] {
        assert!(text.contains(expected), "no `{expected}` in\n{text}");
    }
}
