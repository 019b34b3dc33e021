//! A session: its recordings, the work on each as it goes on, and what came of it.

use super::access::{PageId, Visitor};
use super::error::PageError;
use super::frame::{Frame, page};
use super::words;
use crate::api::AppState;
use crate::queue::{Job, JobFilter};
use crate::storage::{
    AssessmentFilter, AssessmentId, JobId, PageRequest, PatientId, RecordingFilter, RecordingId, SessionId,
    StoredAssessment, StoredRecording,
};
use askama::Template;
use axum::extract::State;
use axum::response::{Html, Redirect};

/// Recordings of a session, and jobs and assessments of a recording, that are shown; the newest.
const MOST_SHOWN: u32 = 50;

#[derive(Template)]
#[template(path = "session.html")]
struct SessionPage {
    frame: Frame,
    patient: PatientId,
    pseudonym: String,
    started: String,
    protocol: String,
    notes: String,
    noise_model: String,
    recordings: Vec<RecordingView>,
    are_more: bool,
}

struct RecordingView {
    id: RecordingId,
    protocol: String,
    stored: String,
    content: String,
    /// When its bytes were removed; empty while they are there.
    removed: String,
    jobs: Vec<JobView>,
    assessments: Vec<AssessmentView>,
}

struct JobView {
    id: JobId,
    state: &'static str,
    is_over: bool,
    asked: String,
    error: String,
}

struct AssessmentView {
    id: AssessmentId,
    name: String,
    made: String,
    coverage: String,
    warnings: usize,
}

/// The page.
pub(super) async fn show(
    State(state): State<AppState>,
    Visitor(caller): Visitor,
    PageId(id): PageId<SessionId>,
) -> Result<Html<String>, PageError> {
    let session = state.store.session(&caller.access, id).await?;
    let patient = state.store.patient(&caller.access, session.patient_id).await?;
    let filter = RecordingFilter { session_id: Some(id), ..RecordingFilter::default() };
    let found = state.store.recordings(&caller.access, &filter, &PageRequest::first(MOST_SHOWN)).await?;
    let mut recordings = Vec::with_capacity(found.items.len());
    for recording in found.items {
        let jobs = JobFilter { recording_id: Some(recording.id), state: None };
        let jobs = state.queue.jobs(&caller.access, &jobs, &PageRequest::first(MOST_SHOWN)).await?;
        let assessments = AssessmentFilter { recording_id: Some(recording.id), ..AssessmentFilter::default() };
        let assessments =
            state.store.assessments(&caller.access, &assessments, &PageRequest::first(MOST_SHOWN)).await?;
        recordings.push(RecordingView::of(recording, &jobs.items, &assessments.items));
    }
    Ok(page(&SessionPage {
        frame: Frame::of(&caller, format!("Session of {}", patient.pseudonym)),
        patient: patient.id,
        pseudonym: patient.pseudonym,
        started: words::moment(session.started_at),
        protocol: session.protocol.as_deref().map_or_else(|| "No protocol named".to_owned(), words::spoken),
        notes: session.notes.unwrap_or_default(),
        noise_model: session.noise_model.unwrap_or_default(),
        recordings,
        are_more: found.next.is_some(),
    })?)
}

/// A recording's place on the page of its session.
pub(super) async fn show_recording(
    State(state): State<AppState>,
    Visitor(caller): Visitor,
    PageId(id): PageId<RecordingId>,
) -> Result<Redirect, PageError> {
    let recording = state.store.recording(&caller.access, id).await?;
    Ok(Redirect::to(&format!("/app/sessions/{}#recording-{id}", recording.session_id)))
}

impl RecordingView {
    fn of(recording: StoredRecording, jobs: &[Job], assessments: &[StoredAssessment]) -> Self {
        let StoredRecording { id, inspection, blob, created_at, content_removed_at, .. } = recording;
        let protocol = inspection.header.protocol.as_deref();
        let mut content = vec![words::seconds(inspection.duration_s)];
        if inspection.n_frames > 0 {
            content.push(format!("{} skeleton frames of {} joints", inspection.n_frames, inspection.joints.len()));
        }
        if !inspection.inertial_units.is_empty() {
            content.push(format!("{} inertial units", inspection.inertial_units.len()));
        }
        if inspection.depth.is_some() {
            content.push("depth images".to_owned());
        }
        content.push(format!("{:.1}\u{a0}MB", blob.size_bytes as f64 / 1e6));
        Self {
            id,
            protocol: protocol.map_or_else(|| "No protocol named".to_owned(), words::spoken),
            stored: words::moment(created_at),
            content: content.join(", "),
            removed: content_removed_at.map(words::moment).unwrap_or_default(),
            jobs: jobs.iter().map(JobView::of).collect(),
            assessments: assessments.iter().map(AssessmentView::of).collect(),
        }
    }
}

impl JobView {
    fn of(job: &Job) -> Self {
        let error = job.error.as_ref().map_or_else(String::new, |error| match &error.place {
            Some(place) => format!("{place}: {}", error.sentence),
            None => error.sentence.clone(),
        });
        Self {
            id: job.id,
            state: job.state.name(),
            is_over: job.state.is_over(),
            asked: words::moment(job.queued_at),
            error,
        }
    }
}

impl AssessmentView {
    fn of(assessment: &StoredAssessment) -> Self {
        Self {
            id: assessment.id,
            name: format!("{}, method {}", words::spoken(&assessment.pipeline), assessment.method),
            made: words::moment(assessment.created_at),
            coverage: words::percent(assessment.quality.coverage),
            warnings: assessment.quality.warnings.len(),
        }
    }
}
