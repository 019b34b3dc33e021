//! Traces arrive at a collector, and say nothing of a patient.

use crate::support::{App, PATIENCE, Service, recording};
use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::routing::post;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

type Arrived = Arc<Mutex<Vec<u8>>>;

/// A collector that keeps every byte; where it answers.
async fn collector(arrived: Arrived) -> String {
    let keep = async |State(arrived): State<Arrived>, body: Bytes| arrived.lock().unwrap().extend(body);
    let router = Router::new().route("/v1/traces", post(keep)).with_state(arrived);
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async { axum::serve(listener, router).await });
    format!("http://{address}")
}

fn holds(bytes: &[u8], text: &str) -> bool {
    bytes.windows(text.len()).any(|window| window == text.as_bytes())
}

#[tokio::test(flavor = "multi_thread")]
async fn spans_of_requests_and_jobs_arrive_at_a_collector_without_names_or_values() {
    let arrived = Arrived::default();
    let endpoint = collector(arrived.clone()).await;
    let folder = tempfile::tempdir().unwrap();
    let settings = [("OTEL_EXPORTER_OTLP_ENDPOINT", endpoint.as_str()), ("OTEL_BSP_SCHEDULE_DELAY", "100")];
    let service = Service::start(&folder.path().join("data"), &settings);
    let app = App::new(&service, service.admin_key.as_ref().unwrap());
    let session = app.session("PSEUDONYM-7").await;
    let (status, answer) = app.try_upload(&session, "traced", recording(2, 0)).await.unwrap();
    assert_eq!(status, 202, "{answer:#}");
    app.until_all_jobs_are_over().await;

    let job = answer["job"]["id"].as_str().unwrap();
    let begun = Instant::now();
    while !["/v1/sessions/{id}/recordings", job, "joint_angles"]
        .iter()
        .all(|text| holds(&arrived.lock().unwrap(), text))
    {
        assert!(begun.elapsed() < PATIENCE, "the spans do not arrive");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let bytes = arrived.lock().unwrap();
    for text in ["PSEUDONYM-7", "knee_flexion", service.admin_key.as_ref().unwrap()] {
        assert!(!holds(&bytes, text), "{text} is in the traces");
    }
}
