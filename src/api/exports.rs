//! An assessment in the forms that other programs read, and where joints were.

use super::assessments::AssessmentPath;
use super::auth::Caller;
use super::error::ApiError;
use super::request::{ApiPath, ApiQuery};
use super::state::AppState;
use crate::assessment::JointTrack;
use crate::body::Joint;
use crate::report::export::{NotExportable, Samples, bvh, csv, mot, trc};
use crate::storage::SeriesQuery;
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use futures::stream;
use garde::Validate;
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(export_assessment)).routes(routes!(read_joints))
}

/// A form of export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExportForm {
    /// Every channel with its interval and flags, as comma separated values.
    Csv,
    /// Joint angles as an OpenSim motion file.
    Mot,
    /// Joint places as an OpenSim marker file.
    Trc,
    /// Joint angles as a Biovision hierarchy, in place.
    Bvh,
}

/// Which form is wanted.
#[derive(Debug, Clone, Copy, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ExportQuery {
    /// The form.
    #[garde(skip)]
    #[param(inline)]
    pub form: ExportForm,
}

/// How many frames are wanted.
#[derive(Debug, Clone, Copy, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct JointsQuery {
    /// Most frames in the answer; more are thinned out evenly.
    #[garde(range(min = 2, max = 100000))]
    #[param(minimum = 2, maximum = 100000, default = 20000)]
    pub max_frames: Option<u32>,
}

/// Frames in an answer that nobody asked more of: eleven minutes of a camera.
const DEFAULT_FRAMES: u32 = 20_000;

/// Where joints were in a recording.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct JointsResponse {
    /// The joints, in the order of the positions.
    pub joints: Vec<Joint>,
    /// Time of each frame from the recording's first one, seconds.
    pub time_s: Vec<f64>,
    /// Positions, metres, in the sensor's frame (right-handed, y up): x, y and z of the first joint in the first frame, then of
    /// the second joint, and so on frame by frame; null where the joint was lost.
    pub positions_m: Vec<Option<f32>>,
}

impl JointsResponse {
    fn of(track: &JointTrack, max_frames: usize) -> Self {
        let step = track.len().div_ceil(max_frames.max(1)).max(1);
        let frames = || (0..track.len()).step_by(step);
        let first = track.time_ns.first().copied().unwrap_or_default();
        let positions = frames().flat_map(|t| track.frame(t).iter().flatten());
        Self {
            joints: track.joints.clone(),
            time_s: frames().map(|t| (track.time_ns[t] - first) as f64 * 1e-9).collect(),
            // A tenth of a millimetre: more digits only make the answer longer.
            positions_m: positions.map(|v| v.is_finite().then(|| (v * 1e4).round() / 1e4)).collect(),
        }
    }
}

/// Export an assessment
///
/// Every sample as text: `csv` (all channels with intervals and flags), `mot` (joint angles for OpenSim), `trc` (joint places for
/// OpenSim), `bvh` (joint angles on the linked skeleton, in place).
#[utoipa::path(get, path = "/v1/assessments/{id}/export", tag = "assessments", operation_id = "export_assessment",
    security(("api_key" = ["device"])),
    params(AssessmentPath, ExportQuery),
    responses((status = 200, description = "The file", content((String = "text/csv"), (String = "text/plain")))))]
async fn export_assessment(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<AssessmentPath>,
    ApiQuery(query): ApiQuery<ExportQuery>,
) -> Result<Response, ApiError> {
    let assessment = state.store.assessment(&caller.access, path.id).await?;
    let (extension, media) = match query.form {
        ExportForm::Csv => ("csv", "text/csv; charset=utf-8"),
        ExportForm::Mot => ("mot", "text/plain; charset=utf-8"),
        ExportForm::Trc => ("trc", "text/plain; charset=utf-8"),
        ExportForm::Bvh => ("bvh", "text/plain; charset=utf-8"),
    };
    let export = match query.form {
        ExportForm::Trc => {
            let track = state.store.joints_of_assessment(&caller.access, path.id).await?;
            trc(track.ok_or_else(|| not_exportable(&NO_SKELETON))?)
        }
        form => {
            let slice = state.store.series_of_assessment(&caller.access, path.id, &SeriesQuery::default()).await?;
            let samples = Samples { time_ns: slice.time_ns, series: slice.series };
            let made = match form {
                ExportForm::Mot => mot(samples),
                ExportForm::Bvh => bvh(samples, assessment.quality.calibration.as_ref()),
                ExportForm::Csv | ExportForm::Trc => Ok(csv(samples)),
            };
            made.map_err(|reason| not_exportable(&reason))?
        }
    };
    let name = format!("attachment; filename=\"{}.{extension}\"", path.id);
    let name = HeaderValue::from_str(&name).map_err(ApiError::internal)?;
    let headers = [(header::CONTENT_TYPE, HeaderValue::from_static(media)), (header::CONTENT_DISPOSITION, name)];
    let body = Body::from_stream(stream::iter(export.pieces().map(Ok::<_, Infallible>)));
    Ok((headers, body).into_response())
}

/// Read where joints were
///
/// For replay, at most sixty frames a second: positions that the assessment estimates (fusion, leg pose), or else those that the
/// camera gave.
#[utoipa::path(get, path = "/v1/assessments/{id}/joints", tag = "assessments", operation_id = "read_joints",
    security(("api_key" = ["device"])),
    params(AssessmentPath, JointsQuery),
    responses((status = 200, description = "The joints", body = JointsResponse)))]
async fn read_joints(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<AssessmentPath>,
    ApiQuery(query): ApiQuery<JointsQuery>,
) -> Result<Json<JointsResponse>, ApiError> {
    let track = state.store.joints_of_assessment(&caller.access, path.id).await?.unwrap_or_default();
    let max_frames = query.max_frames.unwrap_or(DEFAULT_FRAMES) as usize;
    Ok(Json(JointsResponse::of(&track, max_frames)))
}

const NO_SKELETON: NotExportable =
    NotExportable("this assessment holds no joint places: its recording has no skeleton");

fn not_exportable(reason: &NotExportable) -> ApiError {
    ApiError::field("form", format!("is not possible: {reason}"))
}
