//! Jobs: the work on a recording. Their state, their events, their end on request.

use super::auth::Caller;
use super::error::ApiError;
use super::etag::tagged_json;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::{ApiPath, ApiQuery};
use super::state::AppState;
use crate::assessment::Settings;
use crate::progress::Progress;
use crate::queue::{Job, JobError, JobFilter, JobState};
use crate::storage::{Access, AssessmentId, JobId, NoiseModelId, PageRequest, RecordingId, SessionId};
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use axum::response::sse::{Event, KeepAlive, Sse};
use futures::stream::{self, Stream};
use garde::Validate;
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::time::Duration;
use time::OffsetDateTime;
use tokio::sync::broadcast;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// A change that another process made shows up after this at the latest; those of this process show up at once.
const LOOK_AGAIN: Duration = Duration::from_secs(2);

/// Ordinary routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list_jobs)).routes(routes!(read_job)).routes(routes!(cancel_job))
}

/// The route whose answer lasts as long as the job.
pub fn events_router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(read_job_events))
}

/// The work on one recording, or on several that make a noise model.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct JobResponse {
    /// Identity.
    pub id: JobId,
    /// The recording that is assessed; of a training the first static one.
    pub recording_id: RecordingId,
    /// The recording's session.
    pub session_id: SessionId,
    /// Where it is in its life.
    pub state: JobState,
    /// How often it was begun.
    pub attempt: u32,
    /// How often it may be begun.
    pub max_attempts: u32,
    /// Whether somebody asked to stop it.
    pub cancel_requested: bool,
    /// How many waiting jobs of this service have their turn before it; null unless it waits and is read by itself.
    pub n_ahead: Option<u64>,
    /// How far the latest attempt is.
    pub progress: Progress,
    /// What is computed.
    pub settings: Settings,
    /// Why the latest attempt failed.
    pub error: Option<JobError>,
    /// The assessment, once the job is done.
    pub assessment_id: Option<AssessmentId>,
    /// The noise model, once a training is done.
    pub noise_model_id: Option<NoiseModelId>,
    /// When it was asked for.
    #[serde(with = "time::serde::rfc3339")]
    pub queued_at: OffsetDateTime,
    /// When its latest attempt began.
    #[serde(with = "time::serde::rfc3339::option")]
    pub started_at: Option<OffsetDateTime>,
    /// When it was over.
    #[serde(with = "time::serde::rfc3339::option")]
    pub finished_at: Option<OffsetDateTime>,
}

impl From<Job> for JobResponse {
    fn from(job: Job) -> Self {
        Self {
            id: job.id,
            recording_id: job.recording_id,
            session_id: job.session_id,
            state: job.state,
            attempt: job.attempt,
            max_attempts: job.max_attempts,
            cancel_requested: job.cancel_requested,
            n_ahead: job.n_ahead,
            progress: job.progress,
            settings: job.settings,
            error: job.error,
            assessment_id: job.assessment_id,
            noise_model_id: job.noise_model_id,
            queued_at: job.queued_at,
            started_at: job.started_at,
            finished_at: job.finished_at,
        }
    }
}

/// Address of one job.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct JobPath {
    /// The job.
    #[param(value_type = String, format = Uuid)]
    pub id: JobId,
}

/// Which jobs are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct JobsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
    /// Only in this state.
    #[garde(skip)]
    pub state: Option<JobState>,
    /// Only about this recording.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub recording_id: Option<RecordingId>,
}

/// List jobs
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs", operation_id = "list_jobs",
    security(("api_key" = ["device"])), params(JobsQuery),
    responses((status = 200, description = "One page", body = Page<JobResponse>)))]
async fn list_jobs(
    State(state): State<AppState>,
    caller: Caller,
    ApiQuery(query): ApiQuery<JobsQuery>,
) -> Result<Json<Page<JobResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(JobId), limit };
    let filter = JobFilter { state: query.state, recording_id: query.recording_id };
    let filters = [
        ("state", query.state.map(|state| state.name().to_owned())),
        ("recording_id", query.recording_id.map(|id| id.to_string())),
    ];
    let found = state.queue.jobs(&caller.access, &filter, &wanted).await?;
    Ok(Json(Page::from_stored(found, &PageLink::new("/v1/jobs", limit, &filters), |id| id.0, JobResponse::from)))
}

/// Read a job
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "read_job",
    security(("api_key" = ["device"])), params(JobPath),
    responses((status = 200, description = "The job", body = JobResponse),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_job(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<JobPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let job = state.queue.job(&caller.access, path.id).await?;
    Ok(tagged_json(&headers, &JobResponse::from(job)))
}

/// Stop a job
///
/// A job that waits is cancelled at once; one that runs as soon as its worker looks up. Repeating it changes nothing.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", tag = "jobs", operation_id = "cancel_job",
    security(("api_key" = ["device"])), params(JobPath),
    responses((status = 202, description = "The request is noted; the job says how far it is", body = JobResponse),
              (status = 409, description = "The job is done or has failed", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn cancel_job(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<JobPath>,
) -> Result<(axum::http::StatusCode, Json<JobResponse>), ApiError> {
    let job = state.queue.cancel(&caller.access, path.id).await?;
    Ok((axum::http::StatusCode::ACCEPTED, Json(job.into())))
}

/// Follow a job
///
/// Server-sent events named `job`, each with the job as it then is: one at once, one after every change of state or
/// progress, and the last when the job is over; then the stream ends.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", tag = "jobs", operation_id = "read_job_events",
    security(("api_key" = ["device"])), params(JobPath),
    responses((status = 200, description = "The events", body = String, content_type = "text/event-stream")))]
async fn read_job_events(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<JobPath>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    // Subscribed before the first look, so that no change falls between.
    let changes = state.queue.changes();
    state.queue.job(&caller.access, path.id).await?;
    let watch = Watch { state, access: caller.access, id: path.id, changes, sent: None };
    Ok(Sse::new(stream::unfold(Some(watch), next_event)).keep_alive(KeepAlive::default()))
}

/// One client that follows one job.
struct Watch {
    state: AppState,
    access: Access,
    id: JobId,
    changes: broadcast::Receiver<JobId>,
    sent: Option<JobResponse>,
}

/// The next event, and the watch unless the job is over.
async fn next_event(watch: Option<Watch>) -> Option<(Result<Event, Infallible>, Option<Watch>)> {
    let mut watch = watch?;
    loop {
        let job: JobResponse = match watch.state.queue.job(&watch.access, watch.id).await {
            Ok(job) => job.into(),
            Err(error) => {
                tracing::error!(job = %watch.id, error = format!("{error:#}"), "a watched job cannot be read");
                return None;
            }
        };
        if watch.sent.as_ref() != Some(&job) {
            let event = Event::default().event("job").json_data(&job).unwrap_or_default();
            let over = job.state.is_over();
            watch.sent = Some(job);
            return Some((Ok(event), (!over).then_some(watch)));
        }
        if !watch.changed().await {
            return None;
        }
    }
}

impl Watch {
    /// Waits until the job may have changed; `false` when the service shuts down.
    async fn changed(&mut self) -> bool {
        let id = self.id;
        let changes = &mut self.changes;
        let change = async {
            loop {
                match changes.recv().await {
                    Ok(changed) if changed != id => {}
                    Err(broadcast::error::RecvError::Closed) => std::future::pending().await,
                    // The job itself, or changes that were missed: look.
                    Ok(_) | Err(broadcast::error::RecvError::Lagged(_)) => return,
                }
            }
        };
        tokio::select! {
            () = self.state.shutdown.cancelled() => false,
            () = change => true,
            () = tokio::time::sleep(LOOK_AGAIN) => true,
        }
    }
}
