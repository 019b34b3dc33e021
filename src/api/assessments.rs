//! Assessments: what was found in a recording. Summary, quality and provenance here; the samples in `series`.

use super::auth::Caller;
use super::error::ApiError;
use super::etag::tagged_json;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::{ApiPath, ApiQuery};
use super::state::AppState;
use crate::assessment::{ChannelSummary, Gait, Performance, Provenance, Quality};
use crate::storage::{
    AssessmentFilter, AssessmentId, JobId, PageRequest, PatientId, RecordingId, SessionId, StoredAssessment,
};
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list_assessments)).routes(routes!(read_assessment))
}

/// What one pipeline found in one recording, in brief.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AssessmentItem {
    /// Identity.
    pub id: AssessmentId,
    /// The recording that was assessed.
    pub recording_id: RecordingId,
    /// The recording's session.
    pub session_id: SessionId,
    /// The session's patient.
    pub patient_id: PatientId,
    /// The job that made it.
    pub job_id: JobId,
    /// The pipeline.
    pub pipeline: String,
    /// The method within the pipeline.
    pub method: String,
    /// When it was stored.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

/// What one pipeline found in one recording. It never changes.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AssessmentResponse {
    /// Identity.
    pub id: AssessmentId,
    /// The recording that was assessed.
    pub recording_id: RecordingId,
    /// The recording's session.
    pub session_id: SessionId,
    /// The session's patient.
    pub patient_id: PatientId,
    /// The job that made it.
    pub job_id: JobId,
    /// The pipeline.
    pub pipeline: String,
    /// The method within the pipeline.
    pub method: String,
    /// When it was stored.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// Samples of each series.
    pub n_samples: u64,
    /// Time of the first sample on the recording's clock, seconds.
    pub start_s: Option<f64>,
    /// Time of the last sample.
    pub end_s: Option<f64>,
    /// Names of the series that can be read.
    pub channels: Vec<String>,
    /// One line per series.
    pub summary: Vec<ChannelSummary>,
    /// Steps of a walk; null when the pipeline finds none by its nature.
    pub gait: Option<Gait>,
    /// How the exercise or test was performed; null in assessments from before it was measured.
    pub performance: Option<Performance>,
    /// How far the result can be trusted.
    pub quality: Quality,
    /// What is needed to compute the same bytes again.
    pub provenance: Provenance,
}

impl From<StoredAssessment> for AssessmentItem {
    fn from(stored: StoredAssessment) -> Self {
        let StoredAssessment { id, recording_id, session_id, patient_id, job_id, pipeline, method, .. } = stored;
        Self { id, recording_id, session_id, patient_id, job_id, pipeline, method, created_at: stored.created_at }
    }
}

impl From<StoredAssessment> for AssessmentResponse {
    fn from(stored: StoredAssessment) -> Self {
        let s_from_ns = |ns: i64| ns as f64 * 1e-9;
        Self {
            id: stored.id,
            recording_id: stored.recording_id,
            session_id: stored.session_id,
            patient_id: stored.patient_id,
            job_id: stored.job_id,
            pipeline: stored.pipeline,
            method: stored.method,
            created_at: stored.created_at,
            n_samples: stored.n_samples,
            start_s: stored.start_time_ns.map(s_from_ns),
            end_s: stored.end_time_ns.map(s_from_ns),
            channels: stored.channels,
            summary: stored.summary,
            gait: stored.gait,
            performance: stored.performance,
            quality: stored.quality,
            provenance: stored.provenance,
        }
    }
}

/// Address of one assessment.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct AssessmentPath {
    /// The assessment.
    #[param(value_type = String, format = Uuid)]
    pub id: AssessmentId,
}

/// Which assessments are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct AssessmentsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
    /// Only of this recording.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub recording_id: Option<RecordingId>,
    /// Only of this session.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub session_id: Option<SessionId>,
    /// Only of this patient.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub patient_id: Option<PatientId>,
    /// Only by this pipeline.
    #[garde(custom(super::text::optional_word))]
    #[param(pattern = "^[a-z0-9_]{1,64}$", example = "skeleton_fusion")]
    pub pipeline: Option<String>,
    /// Only by this method.
    #[garde(custom(super::text::optional_word))]
    #[param(pattern = "^[a-z0-9_]{1,64}$", example = "iekf")]
    pub method: Option<String>,
}

/// List assessments
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/assessments", tag = "assessments", operation_id = "list_assessments",
    security(("api_key" = ["device"])),
    params(AssessmentsQuery),
    responses((status = 200, description = "One page", body = Page<AssessmentItem>)))]
async fn list_assessments(
    State(state): State<AppState>,
    caller: Caller,
    ApiQuery(query): ApiQuery<AssessmentsQuery>,
) -> Result<Json<Page<AssessmentItem>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(AssessmentId), limit };
    let filters = [
        ("recording_id", query.recording_id.map(|id| id.to_string())),
        ("session_id", query.session_id.map(|id| id.to_string())),
        ("patient_id", query.patient_id.map(|id| id.to_string())),
        ("pipeline", query.pipeline.clone()),
        ("method", query.method.clone()),
    ];
    let link = PageLink::new("/v1/assessments", limit, &filters);
    let AssessmentsQuery { recording_id, session_id, patient_id, pipeline, method, .. } = query;
    let filter = AssessmentFilter { recording_id, session_id, patient_id, pipeline, method };
    let found = state.store.assessments(&caller.access, &filter, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, AssessmentItem::from)))
}

/// Read an assessment
///
/// Summary, quality and provenance; the samples are at `/v1/assessments/{id}/series`.
#[utoipa::path(get, path = "/v1/assessments/{id}", tag = "assessments", operation_id = "read_assessment",
    security(("api_key" = ["device"])),
    params(AssessmentPath),
    responses((status = 200, description = "The assessment", body = AssessmentResponse),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_assessment(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<AssessmentPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let assessment = state.store.assessment(&caller.access, path.id).await?;
    Ok(tagged_json(&headers, &AssessmentResponse::from(assessment)))
}
