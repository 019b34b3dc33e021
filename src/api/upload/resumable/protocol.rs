//! The protocol's own part: what of tus is spoken here, and its refusals as problem documents.

use crate::api::error::{ApiError, Problem};
use crate::api::state::AppState;
use crate::config::Config;
use crate::storage::{Access, PartialFiles, ResumableUploadId, SessionId, StorageError, UploadStates};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use std::error::Error as StdError;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;
use tus_protocol::locking::memory::MemoryLocker;
use tus_protocol::{
    ChecksumAlgorithm, Config as ProtocolConfig, Error, Extension, LockGuard, Locker, NoopHookExecutor, ProtocolHandle,
    TUS_VERSION, UploadId,
};

/// Where uploads live.
pub(super) const ADDRESS: &str = "/v1/uploads";
/// How long a request waits for another of the same upload: longer than a body may be silent.
const LOCK_TIMEOUT: Duration = Duration::from_secs(40);

/// tus as it is spoken here.
pub(super) type Protocol = ProtocolHandle<PartialFiles, UploadStates, MemoryLocker, NoopHookExecutor>;

/// What requests of resumable uploads share.
#[derive(Clone)]
pub struct Transfers {
    config: Arc<ProtocolConfig>,
    locker: Arc<MemoryLocker>,
    hooks: Arc<NoopHookExecutor>,
    kept: time::Duration,
}

impl fmt::Debug for Transfers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Transfers(…)")
    }
}

impl Transfers {
    /// Those of one service.
    pub fn new(config: &Config) -> Self {
        let protocol = ProtocolConfig::new()
            .without_extension(Extension::CreationDeferLength)
            .with_extension(Extension::Expiration)
            .with_checksum(ChecksumAlgorithm::Sha256)
            .with_max_size(config.max_recording_bytes)
            .with_base_path(ADDRESS)
            .with_lock_timeout(LOCK_TIMEOUT)
            .without_download();
        Self {
            config: Arc::new(protocol),
            locker: Arc::default(),
            hooks: Arc::default(),
            // A century is for ever here, and within the calendar.
            kept: time::Duration::hours(i64::try_from(config.resumable_upload_hours.min(876_600)).unwrap_or_default()),
        }
    }

    /// The protocol within a caller's reach.
    pub(super) fn protocol(&self, state: &AppState, access: Access) -> Protocol {
        let states = Arc::new(self.states(state, access, None));
        let files = Arc::new(state.store.partial_files().clone());
        ProtocolHandle::from_arcs(self.config.clone(), files, states, self.locker.clone(), self.hooks.clone())
    }

    /// What of the protocol is spoken here, as headers.
    pub(super) fn options(&self) -> HeaderMap {
        let mut headers = HeaderMap::new();
        let said = [
            ("tus-version", TUS_VERSION.to_owned()),
            ("tus-extension", self.config.extensions_string()),
            ("tus-checksum-algorithm", self.config.checksum_algorithms_string()),
            ("tus-max-size", self.config.max_size().map(|size| size.to_string()).unwrap_or_default()),
        ];
        for (name, value) in said {
            headers.extend(HeaderValue::from_str(&value).ok().map(|value| (HeaderName::from_static(name), value)));
        }
        headers
    }

    /// The states of uploads within a caller's reach.
    pub(super) fn states(&self, state: &AppState, access: Access, session: Option<SessionId>) -> UploadStates {
        UploadStates::new(&state.store, access, session, self.kept)
    }

    /// Keeps every other request away from an upload.
    pub(super) async fn lock(&self, id: ResumableUploadId) -> Result<LockGuard, ApiError> {
        self.locker.lock(&id.to_string(), LOCK_TIMEOUT).await.map_err(refusal)
    }
}

/// An id as the protocol takes it.
pub(super) fn protocol_id(id: ResumableUploadId) -> Result<UploadId, ApiError> {
    id.to_string().parse().map_err(refusal)
}

/// A refusal of the protocol as everybody here is refused.
pub(super) fn refusal(error: Error) -> ApiError {
    match error {
        Error::NotFound(_) => ApiError::NotFound("upload"),
        Error::Storage(inner) | Error::StateStore(inner) => of_storage(inner),
        Error::MissingTusResumable | Error::UnsupportedTusVersion(_) => {
            told(412, "tus_version", "This address speaks tus 1.0.0: send the header `Tus-Resumable: 1.0.0`.")
        }
        Error::OffsetMismatch { expected, actual } => offset_mismatch(expected, actual),
        Error::CompletedUploadModificationForbidden(_) => {
            told(409, "offset_mismatch", "All bytes of this upload have arrived. HEAD and GET tell what became of it.")
        }
        Error::SizeExceeded { max, .. } => ApiError::TooLarge(max),
        Error::Locked(_) | Error::LockTimeout(_) => told(
            423,
            "upload_locked",
            "Another request is still busy with this upload. Ask with HEAD in some seconds and go on from there.",
        ),
        Error::Expired(_) => expired(),
        Error::ChecksumMismatch { expected, actual } => told(
            460,
            "upload_checksum_mismatch",
            format!(
                "The bytes of this request have the checksum {actual}, announced was {expected}. They changed on the way; \
                 none of them was kept. Send them again."
            ),
        ),
        Error::InvalidHeader { header, message } => ApiError::field(header, message),
        Error::MissingHeader(header) => ApiError::field(header, "must be there"),
        Error::UnsupportedChecksum(name) => {
            ApiError::field("Upload-Checksum", format!("`{name}` is not known here; sha1 and sha256 are"))
        }
        Error::InvalidMetadata(message) => ApiError::field("Upload-Metadata", message),
        Error::InvalidContentType { .. } => ApiError::UnsupportedMediaType(super::OFFSET_STREAM),
        other if other.status_code() < 500 => ApiError::field("", other.to_string()),
        other => ApiError::internal(other),
    }
}

fn of_storage(error: Box<dyn StdError + Send + Sync>) -> ApiError {
    match error.downcast::<StorageError>() {
        Ok(error) => ApiError::from(*error),
        Err(other) => ApiError::internal(anyhow::anyhow!(other)),
    }
}

/// The client goes on from another place than the service.
pub(super) fn offset_mismatch(expected: u64, actual: u64) -> ApiError {
    let detail = format!(
        "{expected} bytes of this upload have arrived, but these are to follow {actual}. Send what follows {expected}; \
         HEAD tells the number at any time."
    );
    told(409, "offset_mismatch", detail)
}

/// The upload's time is over.
pub(super) fn expired() -> ApiError {
    told(410, "upload_expired", "Nothing came for too long, so what had arrived was given up. Begin a new upload.")
}

/// A problem of this protocol.
pub(super) fn told(status: u16, code: &str, detail: impl Into<String>) -> ApiError {
    let status = StatusCode::from_u16(status).unwrap_or(StatusCode::BAD_REQUEST);
    ApiError::Told(Box::new(Problem::new(status, code, detail)))
}
