use crate::support::{TestApp, samples, text};
use axum::body::BodyDataStream;
use futures::StreamExt;
use serde_json::Value;

/// The next event's job.
async fn next_job(events: &mut BodyDataStream) -> Option<Value> {
    loop {
        let chunk = events.next().await?.unwrap();
        let event = String::from_utf8(chunk.to_vec()).unwrap();
        // Lines that begin with a colon keep the connection alive and say nothing.
        if let Some(data) = event.lines().find_map(|line| line.strip_prefix("data: ")) {
            assert!(event.lines().any(|line| line == "event: job"), "{event}");
            return Some(serde_json::from_str(data).unwrap());
        }
    }
}

#[tokio::test]
async fn events_tell_every_change_of_a_job_and_end_with_it() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/jobs/{}/events", text(&uploaded["job"]["id"]));
    let response = app.get(&path).open().await;
    assert_eq!(response.headers()["content-type"], "text/event-stream");
    let mut events = response.into_body().into_data_stream();
    assert_eq!(next_job(&mut events).await.unwrap()["state"], "queued");
    app.run_pending_jobs().await;
    let mut last = Value::Null;
    while let Some(job) = next_job(&mut events).await {
        last = job;
    }
    assert_eq!(last["state"], "done");
    assert!(last["assessment_id"].is_string());
}

#[tokio::test]
async fn the_events_of_a_job_that_is_over_are_one() {
    let app = TestApp::with_assess(samples::known_result()).await;
    let uploaded = app.uploaded().await;
    app.run_pending_jobs().await;
    let path = format!("/v1/jobs/{}/events", text(&uploaded["job"]["id"]));
    let mut events = app.get(&path).open().await.into_body().into_data_stream();
    assert_eq!(next_job(&mut events).await.unwrap()["state"], "done");
    assert_eq!(next_job(&mut events).await, None);
}

#[tokio::test]
async fn a_cancelled_job_ends_its_events() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/jobs/{}", text(&uploaded["job"]["id"]));
    let mut events = app.get(&format!("{path}/events")).open().await.into_body().into_data_stream();
    assert_eq!(next_job(&mut events).await.unwrap()["state"], "queued");
    app.post(&format!("{path}/cancel")).send().await;
    assert_eq!(next_job(&mut events).await.unwrap()["state"], "cancelled");
    assert_eq!(next_job(&mut events).await, None);
}

#[tokio::test]
async fn events_end_when_the_service_does() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/jobs/{}/events", text(&uploaded["job"]["id"]));
    let mut events = app.get(&path).open().await.into_body().into_data_stream();
    assert_eq!(next_job(&mut events).await.unwrap()["state"], "queued");
    app.state.shutdown.cancel();
    assert_eq!(next_job(&mut events).await, None);
}
