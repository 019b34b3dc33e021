//! What is in the archive, file by file.

use super::archive::{Archive, ManifestFile};
use crate::api::assessments::AssessmentResponse;
use crate::api::audit::AuditEntryResponse;
use crate::api::auth::Caller;
use crate::api::consents::ConsentsResponse;
use crate::api::entries::{MeasurementResponse, QuestionnaireResponse, TrainingPlanResponse};
use crate::api::error::ApiError;
use crate::api::fhir;
use crate::api::jobs::JobResponse;
use crate::api::patients::PatientResponse;
use crate::api::recordings::{RecordingResponse, next_chunk};
use crate::api::report::report_of;
use crate::api::sessions::SessionResponse;
use crate::queue::{JobFilter, Queue};
use crate::recording::decode::Format;
use crate::report::export::{Export, Samples, csv, trc};
use crate::storage::audit::AuditFilter;
use crate::storage::page::MAX_PAGE_ITEMS;
use crate::storage::{
    AssessmentFilter, AssessmentId, MeasureFilter, PageRequest, PatientId, RecordingFilter, SeriesQuery, SessionFilter,
    StoredRecording,
};
use serde::Serialize;
use std::convert::identity;
use std::io;
use time::OffsetDateTime;

/// The last file: what the archive is and what is in it.
#[derive(Debug, Serialize)]
struct Manifest<'a> {
    format: &'static str,
    software_version: &'static str,
    #[serde(with = "time::serde::rfc3339")]
    created_at: OffsetDateTime,
    patient_id: PatientId,
    files: &'a [ManifestFile],
}

/// Writes the rows that a question gives, page by page, as an array.
macro_rules! list {
    ($archive:ident, $path:expr, $shape:path, |$page:ident| $question:expr) => {
        let mut items = Items::begin($archive, String::from($path))?;
        let mut $page = PageRequest::first(MAX_PAGE_ITEMS);
        loop {
            let found = $question.await?;
            for row in found.items {
                items.add($archive, &$shape(row)).await?;
            }
            $page.after = found.next;
            if $page.after.is_none() {
                break;
            }
        }
        items.end($archive).await?;
    };
}

/// Writes every file but the end of the archive.
pub(super) async fn write(
    archive: &mut Archive,
    queue: &Queue,
    caller: &Caller,
    patient: PatientId,
) -> Result<(), ApiError> {
    let (store, access) = (queue.store(), &caller.access);
    let created_at = store.now();
    archive
        .json("patient.json", &PatientResponse::from(store.patient(access, patient).await?))
        .await
        .map_err(failed)?;
    let consents = store.consents_of_patient(access, patient).await?;
    archive.json("consents.json", &ConsentsResponse::of(consents, created_at).items).await.map_err(failed)?;

    let sessions = SessionFilter { patient_id: Some(patient), ..SessionFilter::default() };
    list!(archive, "sessions.json", SessionResponse::from, |page| store.sessions(access, &sessions, &page));
    list!(archive, "questionnaires.json", QuestionnaireResponse::from, |page| {
        store.answers_of_patient(access, patient, &page)
    });
    list!(archive, "measurements.json", MeasurementResponse::from, |page| {
        store.occasions_of_patient(access, patient, &page)
    });
    list!(archive, "training_plans.json", TrainingPlanResponse::from, |page| {
        store.plans_of_patient(access, patient, &page)
    });
    let all = MeasureFilter::default();
    list!(archive, "measures.json", identity, |page| { store.measures_of_patient(access, patient, &all, &page) });
    let assessments = AssessmentFilter { patient_id: Some(patient), ..AssessmentFilter::default() };
    list!(archive, "assessments.json", AssessmentResponse::from, |page| store.assessments(access, &assessments, &page));
    let recordings = RecordingFilter { patient_id: Some(patient), ..RecordingFilter::default() };
    list!(archive, "recordings.json", RecordingResponse::from, |page| store.recordings(access, &recordings, &page));

    let mut page = PageRequest::first(MAX_PAGE_ITEMS);
    loop {
        let found = store.recordings(access, &recordings, &page).await?;
        for recording in &found.items {
            let filter = JobFilter { recording_id: Some(recording.id), ..JobFilter::default() };
            let path = format!("recordings/{}.jobs.json", recording.id);
            list!(archive, path, JobResponse::from, |page| queue.jobs(access, &filter, &page));
            content(archive, queue, recording).await?;
        }
        page.after = found.next;
        if page.after.is_none() {
            break;
        }
    }
    let mut page = PageRequest::first(MAX_PAGE_ITEMS);
    loop {
        let found = store.assessments(access, &assessments, &page).await?;
        for assessment in &found.items {
            results(archive, queue, caller, assessment.id).await?;
        }
        page.after = found.next;
        if page.after.is_none() {
            break;
        }
    }
    let report = report_of(store, caller, patient, None).await?;
    archive.json("report.json", &report).await.map_err(failed)?;
    archive.json("report.fhir.json", &fhir::bundle_of(store, caller, &report).await?).await.map_err(failed)?;
    audit(archive, queue, caller, patient).await?;
    let files = archive.files().to_vec();
    let manifest = Manifest {
        format: "surefoot patient export 1",
        software_version: env!("CARGO_PKG_VERSION"),
        created_at,
        patient_id: patient,
        files: &files,
    };
    archive.json("manifest.json", &manifest).await.map_err(failed)
}

fn failed(error: io::Error) -> ApiError {
    ApiError::internal(error)
}

/// An array that is written piece by piece.
struct Items {
    before: &'static str,
}

impl Items {
    fn begin(archive: &mut Archive, path: String) -> Result<Self, ApiError> {
        archive.begin(path).map_err(failed)?;
        Ok(Self { before: "[\n" })
    }

    async fn add(&mut self, archive: &mut Archive, item: &impl Serialize) -> Result<(), ApiError> {
        let text = serde_json::to_string(item).map_err(ApiError::internal)?;
        archive.write(self.before.as_bytes()).await.map_err(failed)?;
        archive.write(text.as_bytes()).await.map_err(failed)?;
        self.before = ",\n";
        Ok(())
    }

    async fn end(self, archive: &mut Archive) -> Result<(), ApiError> {
        let end = if self.before == "[\n" { "[]\n" } else { "\n]\n" };
        archive.write(end.as_bytes()).await.map_err(failed)?;
        archive.end();
        Ok(())
    }
}

/// The bytes of a recording, unless a rule of retention has removed them.
async fn content(archive: &mut Archive, queue: &Queue, recording: &StoredRecording) -> Result<(), ApiError> {
    if recording.content_removed_at.is_some() {
        return Ok(());
    }
    let extension = match recording.inspection.format {
        Format::Mcap => "mcap",
        Format::Json => "json",
    };
    archive.begin(format!("recordings/{}.{extension}", recording.id)).map_err(failed)?;
    let mut reader = queue.store().blobs().reader(&recording.blob).await?;
    while let Some((chunk, rest)) = next_chunk(reader).await.map_err(failed)? {
        archive.write(&chunk).await.map_err(failed)?;
        reader = rest;
    }
    archive.end();
    Ok(())
}

/// The series of an assessment, and where joints were.
async fn results(archive: &mut Archive, queue: &Queue, caller: &Caller, id: AssessmentId) -> Result<(), ApiError> {
    let (store, access) = (queue.store(), &caller.access);
    let slice = store.series_of_assessment(access, id, &SeriesQuery::default()).await?;
    let samples = Samples { time_ns: slice.time_ns, series: slice.series };
    text(archive, format!("series/{id}.csv"), csv(samples)).await?;
    if let Some(track) = store.joints_of_assessment(access, id).await? {
        text(archive, format!("joints/{id}.trc"), trc(track)).await?;
    }
    Ok(())
}

async fn text(archive: &mut Archive, path: String, export: Export) -> Result<(), ApiError> {
    archive.begin(path).map_err(failed)?;
    for piece in export.pieces() {
        archive.write(piece.as_bytes()).await.map_err(failed)?;
    }
    archive.end();
    Ok(())
}

/// The audit entries about the patient, newest first.
async fn audit(archive: &mut Archive, queue: &Queue, caller: &Caller, patient: PatientId) -> Result<(), ApiError> {
    let filter = AuditFilter { patient: Some(patient), ..AuditFilter::default() };
    let (organisation, store) = (caller.access.organisation, queue.store());
    let mut items = Items::begin(archive, "audit.json".to_owned())?;
    let mut last = None;
    loop {
        let mut entries = store.audit_entries(organisation, &filter, last, MAX_PAGE_ITEMS).await?;
        let more = entries.len() > MAX_PAGE_ITEMS as usize;
        entries.truncate(MAX_PAGE_ITEMS as usize);
        last = entries.last().map(|entry| entry.sequence);
        for entry in entries {
            items.add(archive, &AuditEntryResponse::from(entry)).await?;
        }
        if !more {
            return items.end(archive).await;
        }
    }
}
