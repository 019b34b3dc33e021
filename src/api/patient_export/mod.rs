//! Everything about one patient as one archive.

mod archive;
mod contents;

pub use archive::ManifestFile;

use super::auth::{Admin, Caller};
use super::error::ApiError;
use super::patients::PatientPath;
use super::request::ApiPath;
use super::state::AppState;
use crate::queue::Queue;
use crate::storage::PatientId;
use archive::Archive;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::stream;
use std::io;
use tokio::sync::mpsc;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Pieces of the archive that may wait for a slow reader.
const WAITING: usize = 4;

/// The route of this file. It lasts as long as the client reads.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(export_patient))
}

/// Export everything about a patient
///
/// A ZIP archive: what is known of the patient, consents, sessions, recordings as they were uploaded, jobs, assessments, series
/// as CSV and joint places as TRC, measures, answers, results of tests, plans, the report as JSON and as FHIR R4, and the audit
/// entries about the patient. `manifest.json`, the last file, lists all others with their digests; an archive without it was cut
/// off. JSON files have the shapes that the API gives: each is one object or an array of them.
#[utoipa::path(get, path = "/v1/patients/{id}/export", tag = "patients", operation_id = "export_patient", security(("api_key" = ["admin"])),
    params(PatientPath),
    responses((status = 200, description = "The archive", content((Vec<u8> = "application/zip")))))]
async fn export_patient(
    State(state): State<AppState>,
    Admin(caller): Admin,
    ApiPath(path): ApiPath<PatientPath>,
) -> Result<Response, ApiError> {
    state.store.patient(&caller.access, path.id).await?;
    // What was read of the patient a moment ago belongs in it.
    state.audit.flush().await;
    let pieces = archive_of(state.queue.clone(), caller, path.id);
    let body = Body::from_stream(stream::unfold(pieces, |mut pieces| async { Some((pieces.recv().await?, pieces)) }));
    let name =
        HeaderValue::from_str(&format!("attachment; filename=\"{}.zip\"", path.id)).map_err(ApiError::internal)?;
    let headers =
        [(header::CONTENT_TYPE, HeaderValue::from_static("application/zip")), (header::CONTENT_DISPOSITION, name)];
    Ok((headers, body).into_response())
}

/// The pieces of a patient's archive, as they are made. A failure ends them with an error, and without the end of the archive.
pub fn archive_of(queue: Queue, caller: Caller, patient: PatientId) -> mpsc::Receiver<io::Result<Bytes>> {
    let (sender, pieces) = mpsc::channel(WAITING);
    tokio::spawn(async move {
        let mut archive = Archive::new(sender.clone());
        let written = async {
            contents::write(&mut archive, &queue, &caller, patient).await?;
            archive.finish().await.map_err(ApiError::internal)
        };
        if let Err(error) = written.await
            && !sender.is_closed()
        {
            tracing::error!(%patient, ?error, "an export was cut off");
            // Whoever reads may have gone meanwhile.
            let _ = sender.send(Err(io::Error::other("the export failed; see the log of the service"))).await;
        }
    });
    pieces
}
