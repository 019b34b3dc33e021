//! An assessment of a recording: how it was performed, angles over time, replay, footfalls, quality and origin. Plots and replay
//! need the script; everything that a report rests on stands in the page as text.

mod parts;

use super::access::{PageId, Visitor};
use super::error::PageError;
use super::footfall::FootfallMap;
use super::frame::{Frame, page};
use super::words;
use crate::api::AppState;
use crate::report::CAUTION;
use crate::storage::{AssessmentFilter, AssessmentId, PageRequest, PatientId, RecordingId, SessionId};
use askama::Template;
use axum::extract::State;
use axum::response::Html;
use parts::{
    ChannelRow, EventRow, GaitView, PerformanceView, SegmentRow, channel_rows, event_rows, performance, provenance,
    segment_rows,
};

/// Other assessments of the recording that are named.
const MOST_OTHERS: u32 = 20;

#[derive(Template)]
#[template(path = "assessment.html")]
struct AssessmentPage {
    frame: Frame,
    id: AssessmentId,
    patient: PatientId,
    pseudonym: String,
    session: SessionId,
    recording: RecordingId,
    started: String,
    protocol: String,
    name: String,
    facts: Vec<(&'static str, String)>,
    warnings: Vec<(String, String)>,
    performance: Option<PerformanceView>,
    gait: Option<GaitView>,
    footfalls: Option<FootfallMap>,
    channels: Vec<ChannelRow>,
    has_joints: bool,
    /// Whether there are joint angles, which some downloads need.
    has_angles: bool,
    event_counts: Vec<(String, u64, u64)>,
    events: Vec<EventRow>,
    n_events: usize,
    segments: Vec<SegmentRow>,
    provenance: Vec<(&'static str, String)>,
    settings: String,
    others: Vec<(AssessmentId, String)>,
    caution: &'static str,
}

/// The page.
pub(super) async fn show(
    State(state): State<AppState>,
    Visitor(caller): Visitor,
    PageId(id): PageId<AssessmentId>,
) -> Result<Html<String>, PageError> {
    let access = &caller.access;
    let assessment = state.store.assessment(access, id).await?;
    let session = state.store.session(access, assessment.session_id).await?;
    let patient = state.store.patient(access, assessment.patient_id).await?;
    let recording = state.store.recording(access, assessment.recording_id).await?;
    let joints = state.store.joints_of_assessment(access, id).await?;
    let filter = AssessmentFilter { recording_id: Some(recording.id), ..AssessmentFilter::default() };
    let others = state.store.assessments(access, &filter, &PageRequest::first(MOST_OTHERS)).await?;
    let others = others.items.into_iter().filter(|other| other.id != id);
    let others = others.map(|other| (other.id, format!("{}, method {}", words::spoken(&other.pipeline), other.method)));

    let quality = &assessment.quality;
    let protocol = recording.inspection.header.protocol.as_deref().or(session.protocol.as_deref());
    let facts = vec![
        ("Everything seen in", format!("{} of the frames", words::percent(quality.coverage))),
        ("Duration", words::seconds(quality.duration_s)),
        ("Frames", quality.n_frames.to_string()),
        ("Longest gap", words::seconds(quality.longest_gap_s)),
    ];
    let (events, n_events) = event_rows(quality);
    Ok(page(&AssessmentPage {
        frame: Frame::of(&caller, format!("Assessment of {}", patient.pseudonym)),
        id,
        patient: patient.id,
        pseudonym: patient.pseudonym,
        session: session.id,
        recording: recording.id,
        started: words::moment(session.started_at),
        protocol: protocol.map_or_else(|| "No protocol named".to_owned(), words::spoken),
        name: format!("{}, method {}", words::spoken(&assessment.pipeline), assessment.method),
        facts,
        warnings: quality
            .warnings
            .iter()
            .map(|warning| (warning.code.clone(), words::sentence(&warning.message)))
            .collect(),
        performance: assessment.performance.as_ref().map(performance),
        gait: assessment.gait.as_ref().map(GaitView::of),
        footfalls: assessment.gait.as_ref().and_then(FootfallMap::of),
        channels: channel_rows(&assessment.summary),
        has_angles: assessment.channels.iter().any(|channel| channel.ends_with("_flexion_deg")),
        has_joints: joints.is_some_and(|track| !track.is_empty()),
        event_counts: quality.event_counts.iter().map(|c| (words::spoken(&c.kind), c.n_events, c.n_frames)).collect(),
        events,
        n_events,
        segments: segment_rows(quality),
        provenance: provenance(&assessment),
        settings: serde_json::to_string_pretty(&assessment.provenance.settings).unwrap_or_default(),
        others: others.collect(),
        caution: CAUTION,
    })?)
}
