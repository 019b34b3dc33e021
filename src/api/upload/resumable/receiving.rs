//! The bytes of one request, added to an upload.
//!
//! A body is taken in pieces. Each is added by the protocol as if it were a request of its own: on the disk, and then counted. So
//! a connection that breaks loses nothing that had come through, a request that was given up does not keep the next one
//! waiting, and a body may be as long as the recording without being in memory. Only a body with a checksum is added as a whole
//! or not at all.

use super::protocol::{Protocol, offset_mismatch, protocol_id, refusal, told};
use super::{OFFSET_STREAM, offset_of};
use crate::api::error::ApiError;
use crate::api::upload::arrival::Chunks;
use crate::storage::ResumableUpload;
use axum::body::Body;
use bytes::{Bytes, BytesMut};
use futures::stream;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tus_protocol::{BodyFrame, Headers, RequestBody, UploadId};

/// Bytes that are added at once: enough that syncing them costs little, few enough that many uploads fit into memory.
const PIECE_BYTES: usize = 4 << 20;
/// On a slow line less is added at once, so that a service which is killed has not much to ask for again.
const PIECE_AGE: Duration = Duration::from_secs(5);

/// Adds a body to an upload; how many bytes there are then.
pub(super) async fn receive(
    protocol: &Protocol,
    upload: &ResumableUpload,
    headers: Headers,
    has_checksum: bool,
    body: Body,
    shutdown: &CancellationToken,
) -> Result<u64, ApiError> {
    let id = protocol_id(upload.id)?;
    let at = headers.upload_offset.ok_or_else(|| ApiError::field("Upload-Offset", "must be there"))?;
    let known = offset_of(protocol, &id).await?;
    let missing = upload.length_bytes.saturating_sub(known);
    let announced = headers.content_length;
    let mut chunks = Chunks::new(body, missing);
    if at != known {
        chunks.drain().await;
        return Err(offset_mismatch(known, at));
    }
    if announced.is_some_and(|length| length > missing) {
        return Err(ApiError::TooLarge(missing));
    }
    if missing == 0 {
        return Ok(known);
    }
    if has_checksum {
        return whole(protocol, &id, headers, chunks).await;
    }
    let (reached, end) = pieces(protocol, &id, known, &mut chunks, shutdown).await;
    if matches!(end, Err(ApiError::TooLarge(_))) {
        chunks.drain().await;
    }
    end?;
    if announced.is_some_and(|length| reached != known + length) {
        return Err(incomplete());
    }
    Ok(reached)
}

/// How a piece ended.
enum Ended {
    /// More may follow.
    Full,
    /// It was the last.
    Body,
    /// The body broke off.
    Broken(ApiError),
}

async fn pieces(
    protocol: &Protocol,
    id: &UploadId,
    mut offset: u64,
    chunks: &mut Chunks,
    shutdown: &CancellationToken,
) -> (u64, Result<(), ApiError>) {
    loop {
        let (piece, ended) = next_piece(chunks, shutdown).await;
        let length = piece.len() as u64;
        if length > 0 {
            let mut headers = Headers::default();
            headers.upload_offset = Some(offset);
            headers.content_length = Some(length);
            headers.content_type = Some(OFFSET_STREAM.to_owned());
            if let Err(error) = protocol.patch(headers, id, RequestBody::from_bytes(piece)).await {
                return (offset, Err(refusal(error)));
            }
            offset += length;
        }
        match ended {
            Ended::Full => {}
            Ended::Body => return (offset, Ok(())),
            Ended::Broken(error) => return (offset, Err(error)),
        }
    }
}

/// What comes until there is enough, it has waited long enough, or there is no more.
async fn next_piece(chunks: &mut Chunks, shutdown: &CancellationToken) -> (Bytes, Ended) {
    const ENDING: &str =
        "The service is ending. What arrived is kept: ask with HEAD in some seconds and go on from there.";
    let mut piece = BytesMut::new();
    let old = Instant::now() + PIECE_AGE;
    let ended = loop {
        if piece.len() >= PIECE_BYTES {
            break Ended::Full;
        }
        tokio::select! {
            () = shutdown.cancelled() => break Ended::Broken(ApiError::Unavailable(ENDING)),
            () = sleep_until(old), if !piece.is_empty() => break Ended::Full,
            chunk = chunks.next() => match chunk {
                Ok(Some(chunk)) => piece.extend_from_slice(&chunk),
                Ok(None) => break Ended::Body,
                Err(error) => break Ended::Broken(broken(error)),
            },
        }
    };
    (piece.freeze(), ended)
}

/// Adds a body with its checksum: the protocol adds it when it has seen all of it.
async fn whole(protocol: &Protocol, id: &UploadId, headers: Headers, chunks: Chunks) -> Result<u64, ApiError> {
    let why = Arc::new(Mutex::new(None));
    let frames = stream::unfold((chunks, why.clone()), |(mut chunks, why)| async move {
        let frame = match chunks.next().await {
            Ok(chunk) => Ok(BodyFrame::Data(chunk?)),
            Err(error) => {
                *why.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                Err(io::Error::from(io::ErrorKind::ConnectionReset))
            }
        };
        Some((frame, (chunks, why)))
    });
    let response = protocol.patch(headers, id, RequestBody::from_stream(Box::pin(frames))).await;
    match response {
        Ok(_) => offset_of(protocol, id).await,
        Err(error) => {
            let broke_off = why.lock().unwrap_or_else(PoisonError::into_inner).take();
            Err(broke_off.map_or_else(|| refusal(error), broken))
        }
    }
}

/// A body that broke off, to the client that may still listen.
fn broken(error: ApiError) -> ApiError {
    match error {
        ApiError::IncompleteBody => incomplete(),
        ApiError::Timeout(_) => {
            told(408, "timeout", "Nothing arrived for 30 seconds. Ask with HEAD what has arrived and go on from there.")
        }
        other => other,
    }
}

fn incomplete() -> ApiError {
    let detail = "The body ended before it was complete. Ask with HEAD what has arrived and go on from there.";
    told(400, "incomplete_body", detail)
}
