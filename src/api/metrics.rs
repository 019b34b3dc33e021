//! Numbers for the operator, in the Prometheus text form.

use super::error::ApiError;
use super::state::AppState;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use metrics_exporter_prometheus::{BuildError, Matcher, PrometheusBuilder, PrometheusHandle};
use std::sync::Mutex;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Requests that were answered, by method, route and status.
pub const REQUESTS: &str = "surefoot_http_requests_total";
/// Time to the first byte of an answer, seconds, by method and route.
pub const LATENCY: &str = "surefoot_http_request_duration_seconds";
/// Bytes of recordings that arrived.
pub const UPLOAD_BYTES: &str = "surefoot_upload_bytes_total";
/// Time from the request for a job to the beginning of an attempt, seconds; the worker records it.
pub const JOB_WAIT: &str = "surefoot_job_wait_seconds";
/// Jobs by state.
pub const JOBS: &str = "surefoot_jobs";
/// Expected computation of the jobs that wait, seconds: what to scale workers on.
pub const EXPECTED: &str = "surefoot_queue_expected_seconds";
/// Resumable uploads of which bytes are missing.
pub const HALF_UPLOADS: &str = "surefoot_half_uploads";
/// What has arrived of them and lies on the disk until they are complete or given up.
pub const HALF_UPLOAD_BYTES: &str = "surefoot_half_upload_bytes";

/// Upper bounds of the buckets of every time, seconds: from a small read to a long assessment.
const TIME_BUCKETS: [f64; 14] =
    [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0, 30.0, 120.0];

static INSTALLED: Mutex<Option<PrometheusHandle>> = Mutex::new(None);

/// The process's recorder, installed by the first caller and shared by all.
///
/// # Errors
/// When another recorder was installed before.
pub fn recorder() -> Result<PrometheusHandle, BuildError> {
    let mut installed = INSTALLED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(handle) = installed.as_ref() {
        return Ok(handle.clone());
    }
    let handle = PrometheusBuilder::new()
        .set_buckets_for_metric(Matcher::Suffix("_seconds".into()), &TIME_BUCKETS)?
        .install_recorder()?;
    metrics::describe_counter!(REQUESTS, "Requests answered");
    metrics::describe_histogram!(LATENCY, metrics::Unit::Seconds, "Time to the first byte of the answer");
    metrics::describe_histogram!(JOB_WAIT, metrics::Unit::Seconds, "Time from the request for a job to its beginning");
    metrics::describe_counter!(UPLOAD_BYTES, metrics::Unit::Bytes, "Bytes of recordings that arrived");
    metrics::describe_gauge!(JOBS, "Jobs by state");
    metrics::describe_gauge!(EXPECTED, metrics::Unit::Seconds, "Expected computation of the jobs that wait");
    metrics::describe_gauge!(HALF_UPLOADS, "Resumable uploads of which bytes are missing");
    metrics::describe_gauge!(HALF_UPLOAD_BYTES, metrics::Unit::Bytes, "Bytes that have arrived of half uploads");
    *installed = Some(handle.clone());
    Ok(handle)
}

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(read_metrics))
}

/// Numbers for the operator
///
/// Prometheus text: requests and their times, jobs by state, bytes uploaded, half uploads.
#[utoipa::path(get, path = "/metrics", tag = "health", security(()), operation_id = "read_metrics",
    responses((status = 200, description = "The numbers", body = String, content_type = "text/plain")))]
async fn read_metrics(State(state): State<AppState>) -> Result<Response, ApiError> {
    for (job_state, count) in state.queue.counts().await? {
        metrics::gauge!(JOBS, "state" => job_state.name()).set(count as f64);
    }
    metrics::gauge!(EXPECTED).set(state.queue.expected_wait().await?.as_secs_f64());
    let (half_uploads, bytes) = state.store.count_half_uploads().await?;
    metrics::gauge!(HALF_UPLOADS).set(half_uploads as f64);
    metrics::gauge!(HALF_UPLOAD_BYTES).set(bytes as f64);
    let content_type = (header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8");
    Ok(([content_type], state.metrics.render()).into_response())
}
