//! From the last byte of an upload to its recording; and uploads that nobody finishes.

use super::protocol::expired;
use crate::api::error::{ApiError, Problem};
use crate::api::state::AppState;
use crate::api::upload::admission::{permitted, suited_settings};
use crate::api::upload::announced::Announced;
use crate::api::upload::arrival::{BATCH_BYTES, SNIFFED_BYTES, limit, permit, unknown_format};
use crate::recording::decode::{Format, Inspection, Inspector};
use crate::storage::{NewRecording, ResumableState, ResumableUpload, ResumableUploadId, StorageError};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use std::time::Duration;
use tokio::task::spawn_blocking;
use tus_protocol::StateStore;

/// How often uploads are looked after.
const ROUND: Duration = Duration::from_secs(300);
/// A file without a row may be of an upload that is just being made; one as old as this is not.
const ORPHANED: Duration = Duration::from_secs(3600);

/// Makes a recording of an upload whose bytes are all there, or says why not. However often it is asked, the recording is
/// stored once and the answer stays the same.
///
/// Where the fault is ours (no room, a database that fails) the upload stays as it is and is finished another time.
pub(super) async fn finish(state: &AppState, id: ResumableUploadId) -> Result<ResumableUpload, ApiError> {
    let _alone = state.transfers.lock(id).await?;
    let upload = state.store.resumable_upload_to_finish(id).await?;
    if upload.state == ResumableState::Receiving {
        if let Err(error) = store(state, &upload).await {
            if is_ours(&error) {
                return Err(error);
            }
            let problem = serde_json::to_string(&error.problem()).map_err(ApiError::internal)?;
            state.store.refuse_resumable_upload(id, &problem).await?;
        }
        remove_file(state, id).await;
    }
    outcome(state.store.resumable_upload_to_finish(id).await?)
}

/// An upload as it is, or why it is no more.
pub(super) fn outcome(upload: ResumableUpload) -> Result<ResumableUpload, ApiError> {
    match (upload.state, &upload.problem) {
        (ResumableState::Refused, Some(problem)) => {
            let problem: Problem = serde_json::from_str(problem).map_err(ApiError::internal)?;
            Err(ApiError::Told(Box::new(problem)))
        }
        (ResumableState::Expired, _) => Err(expired()),
        _ => Ok(upload),
    }
}

/// True when another try may go better without the client doing anything else.
fn is_ours(error: &ApiError) -> bool {
    use ApiError as E;
    matches!(error, E::OutOfSpace | E::Internal(_) | E::Unavailable(_) | E::Crowded(_) | E::Timeout(_))
}

async fn store(state: &AppState, upload: &ResumableUpload) -> Result<(), ApiError> {
    let access = upload.access();
    let known = state.transfers.states(state, access, None).get(&upload.id.to_string()).await;
    let known = known.map_err(super::protocol::refusal)?.ok_or(ApiError::NotFound("upload"))?;
    let announced = Announced::from_metadata(known.metadata(), upload.length_bytes)?;

    let path = state.store.partial_files().path(upload.id);
    let (sha256, inspection) = examine(state, &announced, path.clone()).await?;
    announced.check_digest(&sha256)?;
    let session = permitted(state, &access, upload.session_id).await?;
    let settings = suited_settings(state, &access, &session, &inspection).await?;
    let blob = state.store.blobs().keep_file(&path, sha256, upload.length_bytes).await?;
    let new = NewRecording { session_id: session.id, blob, inspection };
    state.queue.submit_resumed(&access, upload.id, &new, &settings).await?;
    Ok(())
}

/// The digest of a file and what is in it, by the checks that a direct upload passes while it arrives.
async fn examine(state: &AppState, announced: &Announced, path: PathBuf) -> Result<(String, Inspection), ApiError> {
    let head = in_background({
        let path = path.clone();
        move || {
            let mut head = Vec::new();
            File::open(path)?.take(SNIFFED_BYTES as u64).read_to_end(&mut head).map(|_| head)
        }
    });
    let format = announced.format.or(Format::sniff(&head.await?)).ok_or_else(unknown_format)?;
    let limit = limit(state, Some(format));
    if announced.length.is_some_and(|length| length > limit) {
        return Err(ApiError::TooLarge(limit));
    }
    let _permit = permit(state, format).await?;
    let mut inspector = Inspector::new(format, &state.limits);
    let reading = in_background(move || {
        let mut file = File::open(path)?;
        let (mut digest, mut batch) = (Sha256::new(), vec![0; BATCH_BYTES]);
        loop {
            let n = file.read(&mut batch)?;
            if n == 0 {
                return Ok(inspector.finish().map(|inspection| (hex::encode(digest.finalize()), inspection)));
            }
            digest.update(&batch[..n]);
            if let Err(defect) = inspector.push(&batch[..n]) {
                return Ok(Err(defect));
            }
        }
    });
    reading.await?.map_err(ApiError::Recording)
}

async fn in_background<T: Send + 'static>(
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> Result<T, ApiError> {
    let failed = |source| StorageError::Blob { doing: "reading the file of an upload", source };
    Ok(spawn_blocking(work).await.map_err(ApiError::internal)?.map_err(failed)?)
}

/// Removes the file of an upload that is over. What stays is removed by a later round.
async fn remove_file(state: &AppState, id: ResumableUploadId) {
    if let Err(error) = state.store.partial_files().remove(id).await {
        tracing::warn!(upload = %id, error = format!("{error:#}"), "the file of an upload could not be removed");
    }
}

/// Looks after uploads, at once and then from time to time, until the service ends.
pub async fn keep_in_order(state: &AppState) {
    let mut rounds = tokio::time::interval(ROUND);
    while state.shutdown.run_until_cancelled(rounds.tick()).await.is_some() {
        if let Some(Err(error)) = state.shutdown.run_until_cancelled(look_after(state)).await {
            tracing::error!(error = format!("{error:#}"), "uploads could not be looked after");
        }
    }
}

/// One round: finishes uploads whose service ended between the last byte and the recording, gives up those whose time is over,
/// and removes what they leave.
///
/// # Errors
/// When the database or the folder of uploads fails.
pub async fn look_after(state: &AppState) -> Result<(), StorageError> {
    let files = state.store.partial_files();
    for upload in state.store.resumable_uploads_under_way().await? {
        // Where several services share a database, the bytes lie with the one that received them.
        let size = files.size_bytes(upload.id).await?.unwrap_or(0);
        if size == upload.length_bytes {
            match finish(state, upload.id).await {
                Err(ApiError::Internal(error)) => {
                    tracing::error!(upload = %upload.id, error = format!("{error:#}"), "an upload could not be finished");
                }
                Err(refused) => {
                    tracing::info!(upload = %upload.id, code = refused.problem().code, "an upload is refused")
                }
                Ok(_) => tracing::info!(upload = %upload.id, "finished an upload whose service had ended"),
            }
        } else if state.store.now() >= upload.expires_at {
            state.store.expire_resumable_upload(upload.id).await?;
        }
    }
    for id in files.ids().await? {
        let is_left = match state.store.resumable_upload_to_finish(id).await {
            Ok(upload) => upload.state != ResumableState::Receiving,
            Err(StorageError::NotFound { .. }) => files.age(id).await?.is_some_and(|age| age > ORPHANED),
            Err(error) => return Err(error),
        };
        if is_left {
            remove_file(state, id).await;
        }
    }
    state.store.forget_resumable_uploads().await
}
