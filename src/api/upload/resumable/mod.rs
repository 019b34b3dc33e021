//! Uploads that go on where they broke off: [tus 1.0](https://tus.io/protocols/resumable-upload), with the extensions
//! creation, expiration, checksum and termination.
//!
//! `protocol` is what the crate `tus-protocol` does, `receiving` how bytes come in, `finishing` what happens after the last.

mod finishing;
mod protocol;
mod receiving;

pub use finishing::{keep_in_order, look_after};
pub use protocol::Transfers;

use super::admission::{Refused, admit};
use super::announced::Announced;
use super::arrival::limit;
use crate::api::auth::Caller;
use crate::api::error::{ApiError, Problem};
use crate::api::request::{ApiPath, media_type};
use crate::api::sessions::SessionPath;
use crate::api::state::AppState;
use crate::storage::{JobId, RecordingId, ResumableState, ResumableUpload, ResumableUploadId, SessionId, StorageError};
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware;
use axum::response::{IntoResponse, Response};
use protocol::{ADDRESS, Protocol, expired, offset_mismatch, protocol_id, refusal};
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use time::macros::format_description;
use tus_protocol::{Headers, StateStore, Storage, TUS_RESUMABLE, UploadId, UploadState, WriteMode};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Content type of bytes that are added to an upload.
const OFFSET_STREAM: &str = "application/offset+octet-stream";
const VERSION: HeaderName = HeaderName::from_static("tus-resumable");
const VERSIONS: HeaderName = HeaderName::from_static("tus-version");
const OFFSET: HeaderName = HeaderName::from_static("upload-offset");
const LENGTH: HeaderName = HeaderName::from_static("upload-length");
const EXPIRES: HeaderName = HeaderName::from_static("upload-expires");
const CHECKSUM: &str = "upload-checksum";

/// Routes of this file. No time limit on the whole: a request takes as long as its line is slow.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create_upload, read_upload_options_of_session))
        .routes(routes!(read_upload_options))
        .routes(routes!(read_upload, read_upload_offset, continue_upload, terminate_upload))
        .layer(middleware::map_response(speak_tus))
}

/// Every answer says which protocol this is.
async fn speak_tus(mut response: Response) -> Response {
    let headers = response.headers_mut();
    headers.insert(VERSION, HeaderValue::from_static(TUS_RESUMABLE));
    let is_refused_version = response.status() == StatusCode::PRECONDITION_FAILED;
    if is_refused_version {
        response.headers_mut().insert(VERSIONS, HeaderValue::from_static(TUS_RESUMABLE));
    }
    response
}

/// Address of one upload.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct ResumableUploadPath {
    /// The upload.
    #[param(value_type = String, format = Uuid)]
    pub upload_id: ResumableUploadId,
}

/// Where a resumable upload stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ResumableUploadState {
    /// Bytes are missing, or the last have come and the recording is being looked at.
    Receiving,
    /// It is a recording, and a job assesses it.
    Stored,
    /// Its bytes are no recording that is taken; `problem` says why. They were not kept.
    Refused,
}

/// A resumable upload.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ResumableUploadResponse {
    /// Identity.
    pub id: ResumableUploadId,
    /// The session that the recording belongs to.
    pub session_id: SessionId,
    /// Where it stands.
    pub state: ResumableUploadState,
    /// Bytes that have arrived and will not be lost.
    pub received_bytes: u64,
    /// Bytes of the whole recording.
    pub length_bytes: u64,
    /// When it was begun.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// When what has arrived is given up, unless more comes; of an upload that is over, when this answer is forgotten.
    #[serde(with = "time::serde::rfc3339")]
    pub expires_at: OffsetDateTime,
    /// The recording, once it is stored.
    pub recording_id: Option<RecordingId>,
    /// The job that assesses it.
    pub job_id: Option<JobId>,
    /// Why it was refused: the problem document of the request that brought the last byte.
    pub problem: Option<Problem>,
}

impl TryFrom<ResumableUpload> for ResumableUploadResponse {
    type Error = ApiError;

    fn try_from(upload: ResumableUpload) -> Result<Self, ApiError> {
        let state = match upload.state {
            ResumableState::Receiving => ResumableUploadState::Receiving,
            ResumableState::Stored => ResumableUploadState::Stored,
            ResumableState::Refused => ResumableUploadState::Refused,
            ResumableState::Expired => return Err(expired()),
        };
        let problem = upload.problem.as_deref().map(serde_json::from_str).transpose().map_err(ApiError::internal)?;
        let ResumableUpload { id, session_id, received_bytes, length_bytes, created_at, expires_at, .. } = upload;
        let ResumableUpload { recording_id, job_id, .. } = upload;
        Ok(Self {
            id,
            session_id,
            state,
            received_bytes,
            length_bytes,
            created_at,
            expires_at,
            recording_id,
            job_id,
            problem,
        })
    }
}

/// Begin a resumable upload
///
/// For large recordings over bad lines: [tus 1.0](https://tus.io/protocols/resumable-upload), which many libraries speak.
/// Only the length and what the recording is are told here; `Location` is where its bytes go, by PATCH, in as many requests as
/// it takes. What has arrived is kept for a day after its last byte (an operator may choose otherwise).
///
/// `Upload-Metadata` may hold `filetype` (the content type, as of a direct upload), `sha256` (hexadecimal, of the whole
/// recording, compared at the end) and `filename`, which is given back by HEAD and forgotten with the last byte.
#[utoipa::path(post, path = "/v1/sessions/{id}/uploads", tag = "recordings", operation_id = "create_upload", security(("api_key" = ["device"])),
    params(SessionPath,
        ("Tus-Resumable" = String, Header, description = "Version of the protocol", pattern = "^1\\.0\\.0$"),
        ("Upload-Length" = u64, Header, description = "Bytes of the whole recording", minimum = 1),
        ("Upload-Metadata" = Option<String>, Header, description = "Pairs of a key and a value in base64, separated by \
            commas", pattern = "^[!-+.-~-]+( ([A-Za-z0-9+/]{4})*)?(,[!-+.-~-]+( ([A-Za-z0-9+/]{4})*)?)*$")),
    responses(
        (status = 201, description = "Begun; Location says where its bytes go", body = ResumableUploadResponse,
            headers(("Location" = String, description = "Address of the upload"),
                    ("Tus-Resumable" = String, description = "Version of the protocol"),
                    ("Upload-Expires" = String, description = "When what has arrived is given up, unless more comes"))),
        (status = 412, description = "The version of the protocol is not known here", body = Problem,
            content_type = "application/problem+json"),
        (status = 413, description = "The recording is larger than what is accepted", body = Problem,
            content_type = "application/problem+json"),
        (status = 415, description = "`filetype` is not accepted", body = Problem,
            content_type = "application/problem+json"),
        Refused))]
async fn create_upload(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<SessionPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let asked = Headers::from_headers(&headers).map_err(refusal)?;
    let session = admit(&state, &caller.access, path.id).await?;
    if asked.upload_defer_length || asked.upload_concat.is_some() {
        return Err(ApiError::field(
            "Upload-Length",
            "must say how long the whole recording is; parts are not joined here",
        ));
    }
    if asked.content_length.is_some_and(|length| length > 0) {
        return Err(ApiError::field("Content-Length", "must be 0: bytes go to the address in Location"));
    }
    let length = asked.upload_length.filter(|length| *length > 0);
    let length =
        length.ok_or_else(|| ApiError::field("Upload-Length", "must be the bytes of the recording, 1 or more"))?;
    let metadata = asked.upload_metadata.unwrap_or_default();
    let limit = limit(&state, Announced::from_metadata(&metadata, length)?.format);
    if length > limit {
        return Err(ApiError::TooLarge(limit));
    }
    // Not by the protocol's own creation, which knows of no session and would give the upload an id of its own making.
    let id = ResumableUploadId::new();
    let mut upload = UploadState::new(id.to_string()).with_length(length).with_metadata(metadata);
    let files = state.store.partial_files();
    upload.set_storage_handle(files.create(upload.id()).await.map_err(refusal)?);
    let states = state.transfers.states(&state, caller.access, Some(session.id));
    if let Err(error) = states.set(&upload, WriteMode::CreateNew).await {
        files.remove(id).await?;
        return Err(refusal(error));
    }
    let upload = state.store.resumable_upload(&caller.access, id).await?;
    let headers = [(header::LOCATION, format!("{ADDRESS}/{id}")), (EXPIRES, http_date(upload.expires_at)?)];
    Ok((StatusCode::CREATED, headers, Json(ResumableUploadResponse::try_from(upload)?)).into_response())
}

/// What of tus is spoken here, asked where uploads begin
#[utoipa::path(options, path = "/v1/sessions/{id}/uploads", tag = "recordings", security(()),
    operation_id = "read_upload_options_of_session", params(SessionPath),
    responses((status = 204, description = "Version, extensions, checksums, and the largest recording", headers(
        ("Tus-Resumable" = String, description = "Version of the protocol"),
        ("Tus-Version" = String, description = "Versions of the protocol"),
        ("Tus-Extension" = String, description = "Extensions of the protocol"),
        ("Tus-Checksum-Algorithm" = String, description = "Algorithms of Upload-Checksum"),
        ("Tus-Max-Size" = u64, description = "Bytes of the largest recording")))))]
async fn read_upload_options_of_session(
    State(state): State<AppState>,
    ApiPath(_path): ApiPath<SessionPath>,
) -> Response {
    options(&state)
}

/// What of tus is spoken here
#[utoipa::path(options, path = "/v1/uploads", tag = "recordings", security(()), operation_id = "read_upload_options",
    responses((status = 204, description = "Version, extensions, checksums, and the largest recording", headers(
        ("Tus-Resumable" = String, description = "Version of the protocol"),
        ("Tus-Version" = String, description = "Versions of the protocol"),
        ("Tus-Extension" = String, description = "Extensions of the protocol"),
        ("Tus-Checksum-Algorithm" = String, description = "Algorithms of Upload-Checksum"),
        ("Tus-Max-Size" = u64, description = "Bytes of the largest recording")))))]
async fn read_upload_options(State(state): State<AppState>) -> Response {
    options(&state)
}

fn options(state: &AppState) -> Response {
    (StatusCode::NO_CONTENT, state.transfers.options()).into_response()
}

/// Read what became of a resumable upload
///
/// The recording and its job once they are stored, or why it was refused; how many bytes have arrived until then.
#[utoipa::path(get, path = "/v1/uploads/{upload_id}", tag = "recordings", operation_id = "read_upload", security(("api_key" = ["device"])),
    params(ResumableUploadPath),
    responses((status = 200, description = "The upload", body = ResumableUploadResponse,
                headers(("Tus-Resumable" = String, description = "Version of the protocol"))),
              (status = 410, description = "Nothing came for too long; what had arrived was given up", body = Problem,
               content_type = "application/problem+json")))]
async fn read_upload(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<ResumableUploadPath>,
) -> Result<Json<ResumableUploadResponse>, ApiError> {
    let mut upload = alive(&state, &caller, path.upload_id).await?;
    if upload.state == ResumableState::Receiving {
        // The row may be behind the disk: of a request that is under way, or of a process that died.
        let on_disk = state.store.partial_files().size_bytes(upload.id).await?.unwrap_or(0);
        upload.received_bytes = on_disk.min(upload.length_bytes);
    }
    Ok(Json(upload.try_into()?))
}

/// Ask how much of a resumable upload has arrived
///
/// `Upload-Offset` is where the next PATCH goes on. Of an upload that was refused, the answer has the status of the refusal.
#[utoipa::path(head, path = "/v1/uploads/{upload_id}", tag = "recordings", operation_id = "read_upload_offset", security(("api_key" = ["device"])),
    params(ResumableUploadPath,
        ("Tus-Resumable" = String, Header, description = "Version of the protocol", pattern = "^1\\.0\\.0$")),
    responses(
        (status = 200, description = "So much", headers(
            ("Tus-Resumable" = String, description = "Version of the protocol"),
            ("Upload-Offset" = u64, description = "Bytes that have arrived"),
            ("Upload-Length" = u64, description = "Bytes of the whole recording"),
            ("Upload-Metadata" = String, description = "What the client said of it, until the last byte has arrived"),
            ("Upload-Expires" = String, description = "When what has arrived is given up, unless more comes"))),
        (status = 410, description = "Nothing came for too long; what had arrived was given up", body = Problem,
            content_type = "application/problem+json"),
        (status = 412, description = "The version of the protocol is not known here", body = Problem,
            content_type = "application/problem+json"),
        (status = 422, description = "The recording was refused; GET says why", body = Problem,
            content_type = "application/problem+json"),
        (status = 423, description = "Another request is busy with this upload", body = Problem,
            content_type = "application/problem+json")))]
async fn read_upload_offset(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<ResumableUploadPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    Headers::from_headers(&headers).map_err(refusal)?;
    let mut upload = finishing::outcome(alive(&state, &caller, path.upload_id).await?)?;
    if upload.state == ResumableState::Receiving {
        let protocol = state.transfers.protocol(&state, caller.access);
        match protocol.head(&protocol_id(upload.id)?).await {
            Ok(answer) => {
                let expires = [(EXPIRES, http_date(upload.expires_at)?)];
                return Ok((answer.status, answer.headers, expires).into_response());
            }
            // While this request waited for its turn, the upload came to its end.
            Err(tus_protocol::Error::NotFound(_)) => {
                upload = finishing::outcome(alive(&state, &caller, path.upload_id).await?)?;
            }
            Err(error) => return Err(refusal(error)),
        }
    }
    let length = upload.length_bytes.to_string();
    Ok([(OFFSET, length.clone()), (LENGTH, length)].into_response())
}

/// Go on with a resumable upload
///
/// The body is what follows the `Upload-Offset` bytes that have arrived; any number of bytes will do. If the connection breaks,
/// what came through stays. With `Upload-Checksum`, all bytes of the request are kept or none.
///
/// When the last byte has arrived, the recording passes the same checks as a direct upload before this is answered: a refusal
/// is the answer to this request, and stays the answer. GET then names the recording and its job. A client that missed the
/// answer may ask for it again by a PATCH without a body at the end.
#[utoipa::path(patch, path = "/v1/uploads/{upload_id}", tag = "recordings", operation_id = "continue_upload", security(("api_key" = ["device"])),
    params(ResumableUploadPath,
        ("Tus-Resumable" = String, Header, description = "Version of the protocol", pattern = "^1\\.0\\.0$"),
        ("Upload-Offset" = u64, Header, description = "Bytes that have arrived"),
        ("Upload-Checksum" = Option<String>, Header, description = "Algorithm (sha1, sha256) and checksum of this body in \
            base64", pattern = "^sha256 [A-Za-z0-9+/]{42}[AEIMQUYcgkosw048]=$")),
    request_body(description = "The bytes that follow", content((Vec<u8> = "application/offset+octet-stream"))),
    responses(
        (status = 204, description = "They have arrived", headers(
            ("Tus-Resumable" = String, description = "Version of the protocol"),
            ("Upload-Offset" = u64, description = "Bytes that have arrived"),
            ("Upload-Expires" = String, description = "When what has arrived is given up, unless more comes"))),
        (status = 409, description = "Another number of bytes has arrived", body = Problem,
            content_type = "application/problem+json"),
        (status = 410, description = "Nothing came for too long; what had arrived was given up", body = Problem,
            content_type = "application/problem+json"),
        (status = 412, description = "The version of the protocol is not known here", body = Problem,
            content_type = "application/problem+json"),
        (status = 423, description = "Another request is busy with this upload", body = Problem,
            content_type = "application/problem+json"),
        (status = 460, description = "The bytes of this request have another checksum", body = Problem,
            content_type = "application/problem+json"),
        (status = 503, description = "The service is ending; what arrived is kept", body = Problem,
            content_type = "application/problem+json"),
        (status = 507, description = "There is no room left; what arrived before is kept", body = Problem,
            content_type = "application/problem+json")))]
async fn continue_upload(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<ResumableUploadPath>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, ApiError> {
    let asked = Headers::from_headers(&headers).map_err(refusal)?;
    let upload = finishing::outcome(alive(&state, &caller, path.upload_id).await?)?;
    if media_type(&headers).as_deref() != Some(OFFSET_STREAM) {
        return Err(ApiError::UnsupportedMediaType(OFFSET_STREAM));
    }
    // A task of its own: when the client goes away, what has come through is still added, and a recording that is complete is
    // still stored.
    let has_checksum = headers.contains_key(CHECKSUM);
    let added = tokio::spawn(async move { add(&state, &caller, upload, asked, has_checksum, body).await });
    let upload = added.await.map_err(ApiError::internal)??;
    let offset = [(OFFSET, upload.received_bytes.to_string())];
    if upload.state == ResumableState::Stored {
        return Ok((StatusCode::NO_CONTENT, offset).into_response());
    }
    let expires = [(EXPIRES, http_date(upload.expires_at)?)];
    Ok((StatusCode::NO_CONTENT, offset, expires).into_response())
}

async fn add(
    state: &AppState,
    caller: &Caller,
    upload: ResumableUpload,
    asked: Headers,
    has_checksum: bool,
    body: Body,
) -> Result<ResumableUpload, ApiError> {
    let at = asked.upload_offset;
    if upload.state == ResumableState::Stored {
        return at_the_end(upload, at);
    }
    let protocol = state.transfers.protocol(state, caller.access);
    let received = receiving::receive(&protocol, &upload, asked, has_checksum, body, &state.shutdown).await;
    let reached = match received {
        Ok(reached) => reached,
        Err(error) => {
            // While this request waited for its turn, another one may have brought the upload to its end.
            let upload = state.store.resumable_upload(&caller.access, upload.id).await?;
            if upload.state == ResumableState::Receiving {
                return Err(error);
            }
            return at_the_end(finishing::outcome(upload)?, at);
        }
    };
    if reached == upload.length_bytes {
        return finishing::finish(state, upload.id).await;
    }
    Ok(state.store.resumable_upload(&caller.access, upload.id).await?)
}

/// The answer to bytes for an upload that is stored: all of them are there.
fn at_the_end(upload: ResumableUpload, at: Option<u64>) -> Result<ResumableUpload, ApiError> {
    match at {
        Some(at) if at == upload.length_bytes => Ok(upload),
        at => Err(offset_mismatch(upload.length_bytes, at.unwrap_or(0))),
    }
}

/// Give up a resumable upload
///
/// What has arrived is removed. A recording that was stored stays.
#[utoipa::path(delete, path = "/v1/uploads/{upload_id}", tag = "recordings", operation_id = "terminate_upload", security(("api_key" = ["device"])),
    params(ResumableUploadPath,
        ("Tus-Resumable" = String, Header, description = "Version of the protocol", pattern = "^1\\.0\\.0$")),
    responses(
        (status = 204, description = "It is no more",
            headers(("Tus-Resumable" = String, description = "Version of the protocol"))),
        (status = 412, description = "The version of the protocol is not known here", body = Problem,
            content_type = "application/problem+json"),
        (status = 423, description = "Another request is busy with this upload", body = Problem,
            content_type = "application/problem+json")))]
async fn terminate_upload(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<ResumableUploadPath>,
    headers: HeaderMap,
) -> Result<StatusCode, ApiError> {
    let asked = Headers::from_headers(&headers).map_err(refusal)?;
    let upload = state.store.resumable_upload(&caller.access, path.upload_id).await?;
    if upload.state == ResumableState::Receiving {
        let protocol = state.transfers.protocol(&state, caller.access);
        match protocol.delete(asked, &protocol_id(upload.id)?).await {
            // It was finished while this request waited for its turn.
            Ok(_) | Err(tus_protocol::Error::NotFound(_)) => {}
            Err(error) => return Err(refusal(error)),
        }
    }
    let states = state.transfers.states(&state, caller.access, None);
    states.delete(&upload.id.to_string()).await.map_err(refusal)?;
    Ok(StatusCode::NO_CONTENT)
}

/// An upload within the caller's reach whose time is not over.
async fn alive(state: &AppState, caller: &Caller, id: ResumableUploadId) -> Result<ResumableUpload, ApiError> {
    let upload = state.store.resumable_upload(&caller.access, id).await?;
    if upload.is_expired(state.store.now()) { Err(expired()) } else { Ok(upload) }
}

/// How many bytes of an upload have arrived, by the protocol, which looks at the disk too.
async fn offset_of(protocol: &Protocol, id: &UploadId) -> Result<u64, ApiError> {
    let answer = protocol.head(id).await.map_err(refusal)?;
    let offset = answer.headers.get(OFFSET).and_then(|value| value.to_str().ok()?.parse().ok());
    offset.ok_or_else(|| ApiError::internal(anyhow::anyhow!("the protocol knows no offset")))
}

/// A time as headers of HTTP say it (RFC 9110, section 5.6.7).
fn http_date(time: OffsetDateTime) -> Result<String, ApiError> {
    let form =
        format_description!("[weekday repr:short], [day] [month repr:short] [year] [hour]:[minute]:[second] GMT");
    let unwritable = |error| StorageError::Corrupt(format!("a time cannot be written: {error}"));
    Ok(time.to_offset(time::UtcOffset::UTC).format(form).map_err(unwritable)?)
}
