//! Series of an assessment: chosen channels and times, thinned out when asked, as JSON or CSV.

mod number;
mod recent;
mod write;

pub use recent::RecentSeries;

use super::auth::Caller;
use super::error::{ApiError, FieldError};
use super::etag::ETag;
use super::request::{ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::assessment::series::FLAG_NAMES;
use crate::storage::{AssessmentId, Parts, SeriesQuery, StoredAssessment};
use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use garde::Validate;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Nanoseconds of one second.
const NS_PER_S: f64 = 1e9;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(read_series))
}

/// Address of the series of one assessment.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct SeriesPath {
    /// The assessment.
    #[param(value_type = String, format = Uuid)]
    pub id: AssessmentId,
}

/// Form of the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// One JSON document.
    Json,
    /// One row per sample, one header line.
    Csv,
}

/// Which samples are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct SeriesParameters {
    /// Names of channels, separated by commas; all when absent.
    #[garde(skip)]
    #[param(pattern = "^[a-z0-9_]{1,64}(,[a-z0-9_]{1,64}){0,127}$", example = "right_knee_flexion_deg")]
    pub channels: Option<String>,
    /// Every channel of one joint, for example `right_knee` or `trunk`: its angles, and its place where the pipeline gives
    /// one.
    #[garde(skip)]
    #[param(pattern = "^[a-z0-9_]{1,64}$", example = "right_knee")]
    pub joint: Option<String>,
    /// Earliest time on the recording's clock, seconds.
    #[garde(custom(text::finite))]
    pub from_s: Option<f64>,
    /// Latest time on the recording's clock, seconds.
    #[garde(custom(text::finite))]
    pub to_s: Option<f64>,
    /// Most samples of the answer. More are thinned out to real samples on one time axis; extremes are kept.
    #[garde(range(min = 2, max = 1_000_000))]
    #[param(minimum = 2, maximum = 1_000_000)]
    pub max_points: Option<u32>,
    /// Whether the ends of the 95 % credible interval are wanted.
    #[garde(skip)]
    #[param(default = true)]
    pub interval: Option<bool>,
    /// Whether the flags are wanted.
    #[garde(skip)]
    #[param(default = true)]
    pub flags: Option<bool>,
    /// Form of the answer; goes before the Accept header.
    #[garde(skip)]
    #[param(inline)]
    pub format: Option<Form>,
}

/// Samples of some channels on one time axis. Every array is as long as `time_s`.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct SeriesResponse {
    /// The assessment; its provenance says how to compute the same numbers again.
    pub assessment_id: AssessmentId,
    /// SHA-256 of the recording.
    pub recording_sha256: String,
    /// Samples in the time range, before any were thinned out.
    pub n_in_range: u64,
    /// Names of the bits of `flags`, lowest first.
    pub flag_names: Vec<String>,
    /// Time of each sample on the recording's clock, seconds, to the microsecond.
    pub time_s: Vec<f64>,
    /// The channels.
    pub channels: Vec<ChannelResponse>,
}

/// One channel. Degrees come to the thousandth, everything else to the millionth of its unit.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ChannelResponse {
    /// Name; its end is the unit.
    pub channel: String,
    /// The estimates; null where there is none.
    pub value: Vec<Option<f64>>,
    /// Lower ends of the 95 % credible interval; null where there is none. Absent when not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Vec<Option<f64>>, required = false)]
    pub low: Option<Vec<Option<f64>>>,
    /// Upper ends of the 95 % credible interval; null where there is none. Absent when not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Vec<Option<f64>>, required = false)]
    pub high: Option<Vec<Option<f64>>>,
    /// What is known of each sample, as bits named in `flag_names`; 0 is a plain, observed estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Vec<u32>, required = false)]
    pub flags: Option<Vec<u8>>,
}

/// Read series
///
/// Value and credible interval of the chosen channels over the chosen time. CSV has one row per sample and, per
/// channel, the columns `name`, `name_low`, `name_high`, `name_flags`; an empty cell is no number.
#[utoipa::path(get, path = "/v1/assessments/{id}/series", tag = "assessments", operation_id = "read_series",
    security(("api_key" = ["device"])),
    params(SeriesPath, SeriesParameters),
    responses((status = 200, description = "The samples", content(
                (SeriesResponse = "application/json"), (String = "text/csv"))),
              (status = 304, description = "Not changed since the ETag in If-None-Match"),
              (status = 406, description = "The Accept header names neither JSON nor CSV",
               body = super::error::Problem, content_type = "application/problem+json")))]
async fn read_series(
    State(state): State<AppState>,
    caller: Caller,
    ApiPath(path): ApiPath<SeriesPath>,
    ApiQuery(parameters): ApiQuery<SeriesParameters>,
    RawQuery(raw_query): RawQuery,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let form = form(&parameters, &headers)?;
    let assessment = state.store.assessment(&caller.access, path.id).await?;
    let query = query(&parameters, &assessment)?;
    // An assessment never changes: its id and the question decide about every byte of the answer.
    let question = raw_query.unwrap_or_default();
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    let tag = ETag::of(&[version, path.id.0.as_bytes(), question.as_bytes(), &[form as u8]]);
    if tag.is_known(&headers) {
        return Ok(tag.not_modified());
    }
    let body = match state.recent_series.find(&tag) {
        Some(body) => body,
        None => {
            let slice = state.store.series_of_assessment(&caller.access, path.id, &query).await?;
            let writing = tokio::task::spawn_blocking(move || match form {
                Form::Json => write::json(&assessment, &slice),
                Form::Csv => write::csv(&slice),
            });
            let body = Bytes::from(writing.await.map_err(ApiError::internal)?);
            state.recent_series.keep(&tag, &body);
            body
        }
    };
    let content_type = match form {
        Form::Json => "application/json",
        Form::Csv => "text/csv; charset=utf-8",
    };
    let mut response = tag.on(([(header::CONTENT_TYPE, content_type)], body).into_response());
    response.headers_mut().append(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

/// The form that the parameter or else the Accept header asks for.
fn form(parameters: &SeriesParameters, headers: &HeaderMap) -> Result<Form, ApiError> {
    if let Some(form) = parameters.format {
        return Ok(form);
    }
    let Some(accept) = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok()) else {
        return Ok(Form::Json);
    };
    for range in accept.split(',') {
        match range.split(';').next().unwrap_or_default().trim() {
            "application/json" | "application/*" | "*/*" | "" => return Ok(Form::Json),
            "text/csv" | "text/*" => return Ok(Form::Csv),
            _ => {}
        }
    }
    Err(ApiError::NotAcceptable("application/json or text/csv"))
}

fn query(parameters: &SeriesParameters, assessment: &StoredAssessment) -> Result<SeriesQuery, ApiError> {
    // Seconds far outside of any recording saturate to the first or last nanosecond there is.
    let ns = |seconds: f64| (seconds * NS_PER_S).round() as i64;
    Ok(SeriesQuery {
        channels: channels(parameters, &assessment.channels)?,
        from_ns: parameters.from_s.map(ns),
        to_ns: parameters.to_s.map(ns),
        parts: Parts { interval: parameters.interval.unwrap_or(true), flags: parameters.flags.unwrap_or(true) },
        max_points: parameters.max_points.map(|points| points as usize),
    })
}

fn channels(parameters: &SeriesParameters, known: &[String]) -> Result<Option<Vec<String>>, ApiError> {
    if parameters.channels.is_none() && parameters.joint.is_none() {
        return Ok(None);
    }
    let mut wanted: Vec<String> = Vec::new();
    let mut errors = Vec::new();
    for name in parameters.channels.iter().flat_map(|names| names.split(',')) {
        if !known.iter().any(|channel| channel == name) {
            let message = format!("there is no channel `{name}`; there are {}", known.join(", "));
            errors.push(FieldError::new("channels", message));
        } else if !wanted.iter().any(|channel| channel == name) {
            wanted.push(name.to_owned());
        }
    }
    if let Some(joint) = &parameters.joint {
        let of_joint = known
            .iter()
            .filter(|channel| channel.strip_prefix(joint.as_str()).is_some_and(|rest| rest.starts_with('_')));
        let before = wanted.len();
        let new: Vec<String> = of_joint.filter(|channel| !wanted.contains(channel)).cloned().collect();
        wanted.extend(new);
        if wanted.len() == before && parameters.channels.is_none() {
            errors.push(FieldError::new(
                "joint",
                format!("no channel belongs to `{joint}`; see the channels: {}", known.join(", ")),
            ));
        }
    }
    if errors.is_empty() { Ok(Some(wanted)) } else { Err(ApiError::InvalidRequest(errors)) }
}

/// Names of the flag bits at the API.
fn flag_names() -> Vec<String> {
    FLAG_NAMES.iter().map(|name| (*name).to_owned()).collect()
}
