//! Upload of a recording: streamed, checked while it arrives, stored whole or not at all.
//!
//! Nothing is a row before the last byte was seen: the bytes go to a part file that vanishes when anything is wrong
//! with them or the client goes away. [`resumable`] is for those who cannot send a recording in one go.

mod admission;
mod announced;
mod arrival;
pub mod resumable;

use super::auth::Caller;
use super::error::ApiError;
use super::jobs::JobResponse;
use super::recordings::RecordingResponse;
use super::request::ApiPath;
use super::sessions::SessionPath;
use super::state::AppState;
use crate::assessment::Settings;
use crate::queue::{Job, Submission};
use crate::storage::{ConsentState, NewRecording, SessionId, StoredRecording, StoredResponse};
use admission::{Refused, admit, suited_settings};
use announced::Announced;
use arrival::Arrived;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use sha2::{Digest, Sha256};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Says that an answer was given before.
const REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");

/// Routes of this file. No time limit on the whole: an upload takes as long as its line is slow.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(upload_recording)).merge(resumable::router())
}

/// A stored recording and the job that assesses it.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct UploadResponse {
    /// The recording.
    pub recording: RecordingResponse,
    /// The job.
    pub job: JobResponse,
}

/// Upload a recording
///
/// The body is the recording itself: MCAP with the profile `surefoot`, or a JSON recording; `application/octet-stream`
/// is recognised by its first bytes. Everything in it is checked while it arrives, so a defect is told at once, with
/// its place. The answer names the job that assesses it: `skeleton_fusion` where the recording has inertial units on the
/// body, `joint_angles` otherwise.
///
/// The session's patient must have consented to assessment (`POST /v1/patients/{id}/consents`); otherwise the answer is 403
/// with the code `consent_required`, before anything of the body is read.
///
/// A digest, when one is sent, is compared with what arrived. An `Idempotency-Key` makes it safe to send the same
/// upload again: the first answer is repeated and nothing is stored twice. Without one, a second upload is a second
/// recording.
#[utoipa::path(post, path = "/v1/sessions/{id}/recordings", tag = "recordings", operation_id = "upload_recording",
    security(("api_key" = ["device"])),
    params(SessionPath,
        ("Content-Digest" = Option<String>, Header, description = "SHA-256 of the body (RFC 9530)",
            pattern = "^(sha-256=:[A-Za-z0-9+/]{42}[AEIMQUYcgkosw048]=:)?$"),
        ("X-Content-SHA256" = Option<String>, Header, description = "SHA-256 of the body, hexadecimal",
            pattern = "^[0-9a-fA-F]{64}$"),
        ("Idempotency-Key" = Option<String>, Header, description = "Name of this upload, chosen by the client; the \
            same key for the same upload", pattern = "^[A-Za-z0-9._:-]{1,128}$")),
    request_body(description = "The recording", content(
        (Vec<u8> = "application/mcap"), (Vec<u8> = "application/octet-stream"), (Object = "application/json"))),
    responses((status = 202, description = "Stored; Location says where its job lives", body = UploadResponse,
                headers(("Location" = String, description = "Address of the job"))),
              (status = 403, description = "The patient has not consented to assessment (`consent_required`), or the role of \
                the key does not reach this far", body = super::error::Problem, content_type = "application/problem+json"),
              Refused))]
async fn upload_recording(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<SessionPath>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, ApiError> {
    let session = admit(&state, &caller.access, path.id).await?;
    let announced = Announced::from_headers(&headers)?;
    let under_way = state.store.uploads().begin(session.patient_id);
    let arrived = tokio::select! {
        arrived = arrival::receive(&state, &announced, body) => arrived?,
        () = under_way.stopped() => return Err(ApiError::NoConsent(ConsentState::Withdrawn)),
    };
    announced.check_digest(arrived.sealed.sha256())?;

    let fingerprint = fingerprint(session.id, &arrived);
    let settings = suited_settings(&state, &caller.access, &session, &arrived.inspection).await?;
    let blob = arrived.sealed.keep().await?;
    let new = NewRecording { session_id: session.id, blob, inspection: arrived.inspection };
    let submitted = submit(&state, &caller, &announced, fingerprint, &new, &settings).await;
    if submitted.is_err() {
        // A withdrawal or an erasure may have come meanwhile: nothing of the upload may stay.
        state.store.remove_blob_if_unnamed(&new.blob.key).await?;
    }
    // Until here: whoever waits for the end of this upload finds nothing of it afterwards.
    drop(under_way);
    submitted
}

async fn submit(
    state: &AppState,
    caller: &Caller,
    announced: &Announced,
    fingerprint: String,
    new: &NewRecording,
    settings: &Settings,
) -> Result<Response, ApiError> {
    let Some(key) = &announced.idempotency_key else {
        let (recording, job) = state.queue.submit(&caller.access, new, settings).await?;
        return Ok(response(&answer(recording, job).map_err(ApiError::internal)?));
    };
    match state.queue.submit_once(&caller.access, key, fingerprint, new, settings, answer).await? {
        Submission::Stored(answer) => Ok(response(&answer)),
        Submission::Replayed(answer) => Ok(replayed(&answer)),
        Submission::KeyReused => Err(ApiError::IdempotencyKeyReused),
    }
}

/// What decides whether two uploads under one key are the same.
fn fingerprint(session: SessionId, arrived: &Arrived) -> String {
    let mut hash = Sha256::new();
    hash.update(session.0.as_bytes());
    hash.update([arrived.inspection.format as u8]);
    hash.update(arrived.sealed.sha256().as_bytes());
    hex::encode(hash.finalize())
}

/// What the client gets; kept for a repeated request.
fn answer(recording: StoredRecording, job: Job) -> serde_json::Result<StoredResponse> {
    let location = format!("/v1/jobs/{}", job.id);
    let body = UploadResponse { recording: recording.into(), job: job.into() };
    Ok(StoredResponse {
        status: StatusCode::ACCEPTED.as_u16(),
        headers: vec![(header::LOCATION.to_string(), location)],
        body: serde_json::to_vec(&body)?,
    })
}

fn response(answer: &StoredResponse) -> Response {
    let status = StatusCode::from_u16(answer.status).unwrap_or(StatusCode::ACCEPTED);
    let mut response = (status, answer.body.clone()).into_response();
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
    for (name, value) in &answer.headers {
        if let (Ok(name), Ok(value)) = (HeaderName::try_from(name), HeaderValue::try_from(value)) {
            response.headers_mut().insert(name, value);
        }
    }
    response
}

fn replayed(answer: &StoredResponse) -> Response {
    let mut response = response(answer);
    response.headers_mut().insert(REPLAYED, HeaderValue::from_static("true"));
    response
}
