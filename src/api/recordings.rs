//! Recordings: what was uploaded, its bytes, and further assessments of it. The upload itself is in `upload`.

use super::auth::Caller;
use super::error::ApiError;
use super::etag::{ETag, tagged_json};
use super::jobs::JobResponse;
use super::noise_models::pinned;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::{ApiJson, ApiPath, ApiQuery};
use super::sessions::SessionPath;
use super::state::AppState;
use crate::assessment::{LegPoseSettings, Settings, SkeletonFusionSettings};
use crate::recording::decode::Inspection;
use crate::storage::{
    BlobReader, ClientId, PageRequest, PatientId, RecordingFilter, RecordingId, SessionId, StoredRecording,
};
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::stream;
use garde::Validate;
use serde::{Deserialize, Serialize};
use std::io::Read;
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Bytes of a download that are in memory at a time.
const DOWNLOAD_CHUNK: usize = 256 << 10;
/// Seeds above this would not survive a client whose numbers are all floats: 2^53 - 1.
const MAX_SEED: u64 = (1 << 53) - 1;

/// Ordinary routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list_recordings)).routes(routes!(read_recording)).routes(routes!(create_job))
}

/// The route whose answer lasts as long as the client reads.
pub fn content_router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(read_recording_content))
}

/// One upload.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct RecordingResponse {
    /// Identity.
    pub id: RecordingId,
    /// The session it belongs to.
    pub session_id: SessionId,
    /// The session's patient.
    pub patient_id: PatientId,
    /// The client that uploaded it.
    pub created_by: ClientId,
    /// Bytes.
    pub size_bytes: u64,
    /// SHA-256 of the bytes, lower-case hexadecimal.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub sha256: String,
    /// What is in it.
    pub inspection: Inspection,
    /// When it was stored.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// Since when its bytes are gone, by a rule of retention; null while they are there. What was found in them stays.
    #[serde(with = "time::serde::rfc3339::option")]
    pub content_removed_at: Option<OffsetDateTime>,
}

impl From<StoredRecording> for RecordingResponse {
    fn from(stored: StoredRecording) -> Self {
        let StoredRecording {
            id,
            session_id,
            patient_id,
            created_by,
            blob,
            inspection,
            created_at,
            content_removed_at,
        } = stored;
        let (size_bytes, sha256) = (blob.size_bytes, blob.sha256);
        Self { id, session_id, patient_id, created_by, size_bytes, sha256, inspection, created_at, content_removed_at }
    }
}

/// Address of one recording.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct RecordingPath {
    /// The recording.
    #[param(value_type = String, format = Uuid)]
    pub id: RecordingId,
}

/// Which recordings are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct RecordingsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
}

/// Which pipeline is to run on a recording, and how.
#[derive(Debug, Clone, Deserialize)]
#[serde(transparent)]
pub struct JobRequest(pub Settings);

impl Validate for JobRequest {
    type Context = ();

    fn validate_into(&self, _: &(), parent: &mut dyn FnMut() -> garde::Path, report: &mut garde::Report) {
        let settings = match &self.0 {
            Settings::JointAngles(settings) => settings,
            Settings::SkeletonFusion(settings) => return validate_fusion(settings, parent, report),
            Settings::LegPose(settings) => return validate_leg_pose(settings, parent, report),
            Settings::NoiseModel(_) => {
                let message = "must be joint_angles, skeleton_fusion or leg_pose; noise models are trained by POST /v1/noise-models";
                return report.append(parent().join("pipeline"), garde::Error::new(message));
            }
        };
        if settings.particles.is_some_and(|n| !(16..=65_536).contains(&n)) {
            report.append(parent().join("particles"), garde::Error::new("must lie between 16 and 65536"));
        }
        if !(0.0..=1.0).contains(&settings.min_confidence) {
            report.append(parent().join("min_confidence"), garde::Error::new("must lie between 0 and 1"));
        }
        if let Err(error) = settings.chosen_pass() {
            report.append(parent().join("pass"), garde::Error::new(error.to_string()));
        }
        if let Err(error) = settings.chosen_noise_model() {
            report.append(parent().join("noise_model"), garde::Error::new(error.to_string()));
        }
        if settings.seed > MAX_SEED {
            report.append(parent().join("seed"), garde::Error::new(format!("must be at most {MAX_SEED}")));
        }
    }
}

fn validate_leg_pose(settings: &LegPoseSettings, parent: &mut dyn FnMut() -> garde::Path, report: &mut garde::Report) {
    let mut refuse = |field: &str, message: &str| report.append(parent().join(field), garde::Error::new(message));
    if !(64..=65_536).contains(&settings.particles) {
        refuse("particles", "must lie between 64 and 65536");
    }
    if settings.seed > MAX_SEED {
        refuse("seed", &format!("must be at most {MAX_SEED}"));
    }
    let is_range = |[low, high]: [f64; 2], [least, most]: [f64; 2]| least <= low && low < high && high <= most;
    if !is_range(settings.depth_m, [0.0, 5.0]) {
        refuse("depth_m", "must be a nearer and a farther depth, 0 to 5 m");
    }
    if !is_range(settings.x_m, [-3.0, 3.0]) {
        refuse("x_m", "must be a left and a right limit, -3 to 3 m");
    }
}

/// List the recordings of a session
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/sessions/{id}/recordings", tag = "recordings", operation_id = "list_recordings",
    security(("api_key" = ["device"])),
    params(SessionPath, RecordingsQuery),
    responses((status = 200, description = "One page", body = Page<RecordingResponse>)))]
async fn list_recordings(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<SessionPath>,
    ApiQuery(query): ApiQuery<RecordingsQuery>,
) -> Result<Json<Page<RecordingResponse>>, ApiError> {
    let session = state.store.session(&caller.access, path.id).await?;
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(RecordingId), limit };
    let link = PageLink::new(format!("/v1/sessions/{}/recordings", session.id), limit, &[]);
    let filter = RecordingFilter { session_id: Some(session.id), ..RecordingFilter::default() };
    let found = state.store.recordings(&caller.access, &filter, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, RecordingResponse::from)))
}

/// Read a recording
///
/// What is known of it; its bytes are at `/v1/recordings/{id}/content`.
#[utoipa::path(get, path = "/v1/recordings/{id}", tag = "recordings", operation_id = "read_recording",
    security(("api_key" = ["device"])),
    params(RecordingPath),
    responses((status = 200, description = "The recording", body = RecordingResponse),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_recording(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<RecordingPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let recording = state.store.recording(&caller.access, path.id).await?;
    Ok(tagged_json(&headers, &RecordingResponse::from(recording)))
}

/// Download a recording
///
/// The very bytes that were uploaded.
#[utoipa::path(get, path = "/v1/recordings/{id}/content", tag = "recordings", operation_id = "read_recording_content",
    security(("api_key" = ["device"])),
    params(RecordingPath),
    responses((status = 200, description = "The bytes", content(
                (Vec<u8> = "application/mcap"), (Object = "application/json"))),
              (status = 410, description = "The bytes were removed by a rule of retention (`content_removed`)",
               body = super::error::Problem, content_type = "application/problem+json"),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_recording_content(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<RecordingPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let recording = state.store.recording(&caller.access, path.id).await?;
    if recording.content_removed_at.is_some() {
        return Err(ApiError::ContentRemoved);
    }
    let tag = ETag::of(&[recording.blob.sha256.as_bytes()]);
    if tag.is_known(&headers) {
        return Ok(tag.not_modified());
    }
    let reader = state.store.blobs().reader(&recording.blob).await?;
    let format = recording.inspection.format;
    let mut response = tag.on(Body::from_stream(stream::try_unfold(reader, next_chunk)).into_response());
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(format.content_type()));
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(recording.blob.size_bytes));
    Ok(response)
}

/// Reads on a blocking thread, one chunk at a time: memory does not grow with the recording.
pub(super) async fn next_chunk(mut reader: BlobReader) -> std::io::Result<Option<(Bytes, BlobReader)>> {
    let reading = tokio::task::spawn_blocking(move || {
        let mut chunk = Vec::with_capacity(DOWNLOAD_CHUNK);
        reader.by_ref().take(DOWNLOAD_CHUNK as u64).read_to_end(&mut chunk)?;
        Ok((!chunk.is_empty()).then(|| (Bytes::from(chunk), reader)))
    });
    reading.await.map_err(std::io::Error::other)?
}

fn validate_fusion(
    settings: &SkeletonFusionSettings,
    parent: &mut dyn FnMut() -> garde::Path,
    report: &mut garde::Report,
) {
    let mut refuse = |field: &str, message: &str| report.append(parent().join(field), garde::Error::new(message));
    if settings.gain.is_some_and(|gain| !(0.0..=10.0).contains(&gain)) {
        refuse("gain", "must lie between 0 and 10");
    }
    if settings.rate_hz.is_some_and(|rate| !(1.0..=1000.0).contains(&rate)) {
        refuse("rate_hz", "must lie between 1 and 1000");
    }
    if !(0.0..=1.0).contains(&settings.min_confidence) {
        refuse("min_confidence", "must lie between 0 and 1");
    }
    if let Some((field, reason)) = settings.unused() {
        refuse(field, reason);
    }
}

/// Assess a recording again
///
/// With a pipeline and settings of the caller's choice. Earlier assessments stay.
#[utoipa::path(post, path = "/v1/recordings/{id}/jobs", tag = "recordings", operation_id = "create_job",
    security(("api_key" = ["device"])),
    params(RecordingPath), request_body = Settings,
    responses((status = 202, description = "Queued; Location says where the job lives", body = JobResponse),
              (status = 403, description = "The patient has not consented to assessment (`consent_required`), or the role of \
                the key does not reach this far", body = super::error::Problem, content_type = "application/problem+json"),
              (status = 409, description = "The bytes were removed by a rule of retention (`content_removed`)",
               body = super::error::Problem, content_type = "application/problem+json")))]
async fn create_job(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<RecordingPath>,
    ApiJson(JobRequest(settings)): ApiJson<JobRequest>,
) -> Result<Response, ApiError> {
    let settings = match settings {
        Settings::JointAngles(settings) => Settings::JointAngles(pinned(&state, &caller.access, settings).await?),
        other => other,
    };
    let job = state.queue.enqueue(&caller.access, path.id, &settings).await?;
    let location = format!("/v1/jobs/{}", job.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(JobResponse::from(job))).into_response())
}
