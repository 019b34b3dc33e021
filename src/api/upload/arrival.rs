//! The body of an upload, as it arrives.
//!
//! Chunks go two ways, both in batches on blocking threads: to the part file (which digests them) and to the inspector.
//! One batch is inspected while the next arrives; nothing else is kept.

use super::announced::Announced;
use crate::api::error::ApiError;
use crate::api::metrics::UPLOAD_BYTES;
use crate::api::state::AppState;
use crate::recording::DecodeError;
use crate::recording::decode::{Format, Inspection, Inspector};
use crate::storage::SealedBlob;
use axum::body::{Body, BodyDataStream};
use bytes::Bytes;
use futures::StreamExt;
use std::time::Duration;
use tokio::sync::OwnedSemaphorePermit;
use tokio::task::{JoinHandle, spawn_blocking};

/// An upload of which nothing arrives for this long is given up.
const IDLE_TIMEOUT: Duration = Duration::from_secs(30);
/// Bytes that are handed to a blocking thread at once: enough to make the hop cheap.
pub(super) const BATCH_BYTES: usize = 256 << 10;
/// Bytes that tell one format from another.
pub(super) const SNIFFED_BYTES: usize = 8;
/// After a refusal this much more is read and dropped, so that a client which only listens once it has sent everything
/// hears the reason and not a broken connection.
const DRAINED_BYTES: usize = 4 << 20;

/// A complete, sound upload that is not stored yet.
#[derive(Debug)]
pub(super) struct Arrived {
    /// The bytes.
    pub(super) sealed: SealedBlob,
    /// What is in them.
    pub(super) inspection: Inspection,
}

/// Receives a body to its end.
pub(super) async fn receive(state: &AppState, announced: &Announced, body: Body) -> Result<Arrived, ApiError> {
    let limit = limit(state, announced.format);
    if announced.length.is_some_and(|length| length > limit) {
        // Nothing of it is read: a client that asked with `Expect: 100-continue` has not even begun to send.
        return Err(ApiError::TooLarge(limit));
    }
    let mut chunks = Chunks::new(body, limit);
    let result = receive_chunks(state, announced, &mut chunks).await;
    if matches!(result, Err(ApiError::Recording(_) | ApiError::TooLarge(_))) {
        chunks.drain().await;
    }
    result
}

async fn receive_chunks(state: &AppState, announced: &Announced, chunks: &mut Chunks) -> Result<Arrived, ApiError> {
    let mut first = Vec::new();
    while first.len() < SNIFFED_BYTES {
        let Some(chunk) = chunks.next().await? else { break };
        first.extend_from_slice(&chunk);
    }
    let format = announced.format.or_else(|| Format::sniff(&first)).ok_or_else(unknown_format)?;
    chunks.limit = limit(state, Some(format));
    let _permit = permit(state, format).await?;

    let mut inspection = InspectionUnderWay::new(Inspector::new(format, &state.limits));
    let mut blob = state.store.blobs().writer().await?;
    let mut next = Some(Bytes::from(first));
    while let Some(chunk) = next {
        inspection.push(chunk.clone()).await?;
        blob.write(chunk).await?;
        next = chunks.next().await?;
    }
    let inspection = inspection.finish().await?;
    Ok(Arrived { sealed: blob.seal().await?, inspection })
}

/// Most bytes of a recording in this format.
pub(super) fn limit(state: &AppState, format: Option<Format>) -> u64 {
    let config = &state.config;
    match format {
        Some(Format::Json) => config.max_json_recording_bytes.min(config.max_recording_bytes),
        Some(Format::Mcap) | None => config.max_recording_bytes,
    }
}

/// JSON is parsed as a whole, so only a few may be in memory at a time.
pub(super) async fn permit(state: &AppState, format: Format) -> Result<Option<OwnedSemaphorePermit>, ApiError> {
    match format {
        Format::Mcap => Ok(None),
        Format::Json => state.json_uploads.clone().acquire_owned().await.map(Some).map_err(ApiError::internal),
    }
}

/// Why bytes are no recording at all.
pub(super) fn unknown_format() -> ApiError {
    let sentence = "the first bytes are neither those of MCAP nor of a JSON object; see the documentation of the \
                    recording format";
    ApiError::Recording(DecodeError::new("not_a_recording", sentence).at("byte 0"))
}

/// The chunks of a body, counted.
pub(super) struct Chunks {
    stream: BodyDataStream,
    received: u64,
    limit: u64,
}

impl Chunks {
    /// At most `limit` bytes of a body.
    pub(super) fn new(body: Body, limit: u64) -> Self {
        Self { stream: body.into_data_stream(), received: 0, limit }
    }

    /// The next bytes; none at the end.
    pub(super) async fn next(&mut self) -> Result<Option<Bytes>, ApiError> {
        const STALLED: &str = "Nothing arrived for 30 seconds, so the upload was given up. Send it again.";
        let next = tokio::time::timeout(IDLE_TIMEOUT, self.stream.next());
        let chunk = match next.await.map_err(|_| ApiError::Timeout(STALLED))? {
            None => return Ok(None),
            Some(Ok(chunk)) => chunk,
            Some(Err(_)) => return Err(ApiError::IncompleteBody),
        };
        self.received += chunk.len() as u64;
        metrics::counter!(UPLOAD_BYTES).increment(chunk.len() as u64);
        if self.received > self.limit { Err(ApiError::TooLarge(self.limit)) } else { Ok(Some(chunk)) }
    }

    /// Reads on for a moment, so that a client which only listens once it has sent everything hears why it was refused.
    pub(super) async fn drain(&mut self) {
        let mut dropped = 0;
        let rest = async {
            while let Some(Ok(chunk)) = self.stream.next().await {
                dropped += chunk.len();
                if dropped > DRAINED_BYTES {
                    return;
                }
            }
        };
        // Best effort: who sends too slowly may miss the reason.
        let _ = tokio::time::timeout(Duration::from_secs(1), rest).await;
    }
}

type Inspected = Result<Inspector, DecodeError>;

/// An inspector that works on a blocking thread.
struct InspectionUnderWay {
    inspector: Option<Inspector>,
    running: Option<JoinHandle<Inspected>>,
    batch: Vec<Bytes>,
    batch_bytes: usize,
}

impl InspectionUnderWay {
    fn new(inspector: Inspector) -> Self {
        Self { inspector: Some(inspector), running: None, batch: Vec::new(), batch_bytes: 0 }
    }

    async fn push(&mut self, chunk: Bytes) -> Result<(), ApiError> {
        self.batch_bytes += chunk.len();
        self.batch.push(chunk);
        if self.batch_bytes < BATCH_BYTES {
            return Ok(());
        }
        let inspector = self.settle().await?;
        let batch = std::mem::take(&mut self.batch);
        self.batch_bytes = 0;
        self.running = Some(spawn_blocking(move || push_all(inspector, &batch)));
        Ok(())
    }

    async fn finish(mut self) -> Result<Inspection, ApiError> {
        let inspector = self.settle().await?;
        let batch = self.batch;
        let last = spawn_blocking(move || push_all(inspector, &batch)?.finish());
        last.await.map_err(ApiError::internal)?.map_err(ApiError::Recording)
    }

    async fn settle(&mut self) -> Result<Inspector, ApiError> {
        if let Some(running) = self.running.take() {
            self.inspector = Some(running.await.map_err(ApiError::internal)?.map_err(ApiError::Recording)?);
        }
        self.inspector.take().ok_or_else(|| ApiError::internal(anyhow::anyhow!("an inspection went on after a defect")))
    }
}

fn push_all(mut inspector: Inspector, batch: &[Bytes]) -> Inspected {
    for bytes in batch {
        inspector.push(bytes)?;
    }
    Ok(inspector)
}
