//! Noise models: shipped ones, and those that an organisation trains from its own recordings.

use super::auth::Clinician;
use super::error::{ApiError, FieldError};
use super::etag::tagged_json;
use super::jobs::JobResponse;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::{ApiJson, ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::assessment::noise_model::{ADAPTIVE, NoiseModelDocument, find_shipped, is_model_name, shipped};
use crate::assessment::{JointAngleSettings, NoiseModel, NoiseModelName, NoiseModelSettings, Settings};
use crate::storage::{Access, JobId, NoiseModelId, PageRequest, RecordingId, StorageError, StoredNoiseModel};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use garde::Validate;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

/// Names that a refusal lists at most.
const NAMES_TOLD: u32 = 20;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create_noise_model, list_noise_models)).routes(routes!(read_noise_model))
}

/// A noise model to be trained.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseModelRequest {
    /// Name of the model; a name that exists gets a further version.
    #[garde(custom(model_name))]
    #[schema(pattern = "^[a-z][a-z0-9-]{0,63}$", example = "ward-3")]
    pub name: String,
    /// What the model describes, for a person.
    #[serde(default)]
    #[garde(length(chars, max = 500), custom(text::line))]
    #[schema(max_length = 500, pattern = "^[^\\u0000-\\u001f\\u007f]*$")]
    pub description: Option<String>,
    /// Recordings of a subject who stands still and faces the sensor: at least two, with 20 seconds without movement in
    /// all.
    #[garde(length(min = 2, max = 50))]
    #[schema(value_type = Vec<Uuid>, min_items = 2, max_items = 50)]
    pub static_recordings: Vec<RecordingId>,
    /// Recordings of the movements that the model is for, best with reference angles. Without any, joints turn as in
    /// `nite-table1`, and no slow offset is known.
    #[serde(default)]
    #[garde(length(max = 50))]
    #[schema(value_type = Vec<Uuid>, max_items = 50)]
    pub movement_recordings: Vec<RecordingId>,
}

fn model_name(name: &str, _: &()) -> garde::Result {
    if !is_model_name(name) {
        let rule = "must be 1 to 64 lower-case letters, digits and hyphens, beginning with a letter";
        return Err(garde::Error::new(rule));
    }
    let is_taken = name == ADAPTIVE || shipped().iter().any(|model| model.document().name == name);
    if is_taken { Err(garde::Error::new("is a name that comes with the software; choose another")) } else { Ok(()) }
}

/// A noise model, in brief.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct NoiseModelItem {
    /// Identity.
    pub id: NoiseModelId,
    /// Name.
    pub name: String,
    /// Version; settings refer to `name@version`.
    #[schema(minimum = 1)]
    pub version: u32,
    /// What it describes.
    pub description: String,
    /// True of models that come with the software.
    pub is_shipped: bool,
    /// SHA-256 of the model's document as compact JSON, lower-case hexadecimal.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub sha256: String,
    /// The job that trained it; null for shipped models.
    pub job_id: Option<JobId>,
    /// When it was stored; null for shipped models.
    #[serde(with = "time::serde::rfc3339::option")]
    pub created_at: Option<OffsetDateTime>,
}

/// A noise model with its numbers. It never changes.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct NoiseModelResponse {
    /// What lists show of it.
    #[serde(flatten)]
    pub item: NoiseModelItem,
    /// The model itself.
    pub model: NoiseModelDocument,
}

impl From<&StoredNoiseModel> for NoiseModelItem {
    fn from(stored: &StoredNoiseModel) -> Self {
        let document = stored.model.document();
        Self {
            id: stored.id,
            name: document.name.clone(),
            version: document.version,
            description: document.description.clone(),
            is_shipped: false,
            sha256: stored.sha256.clone(),
            job_id: Some(stored.job_id),
            created_at: Some(stored.created_at),
        }
    }
}

impl NoiseModelItem {
    /// Shipped models have ids before those of every stored one: they stand at the end of the list.
    fn of_shipped(number: usize, model: &NoiseModel) -> Self {
        let document = model.document();
        Self {
            id: NoiseModelId(Uuid::from_u128(number as u128 + 1)),
            name: document.name.clone(),
            version: document.version,
            description: document.description.clone(),
            is_shipped: true,
            sha256: model.sha256(),
            job_id: None,
            created_at: None,
        }
    }
}

/// Address of one noise model.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct NoiseModelPath {
    /// The model: its id, its `name` (the newest version), or `name@version`.
    pub id: String,
}

/// Which noise models are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct NoiseModelsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
}

/// Train a noise model
///
/// From stored recordings of the organisation, as a job: its progress, its end and its cancellation are those of any job,
/// and the finished job names the model.
#[utoipa::path(post, path = "/v1/noise-models", tag = "noise models", operation_id = "create_noise_model",
    security(("api_key" = ["clinician"])),
    request_body = NoiseModelRequest,
    responses((status = 202, description = "Queued; Location says where the job lives", body = JobResponse)))]
async fn create_noise_model(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiJson(request): ApiJson<NoiseModelRequest>,
) -> Result<Response, ApiError> {
    check_recordings(&state, &caller.access, &request).await?;
    let first = request.static_recordings[0];
    let ids = |recordings: Vec<RecordingId>| recordings.into_iter().map(|id| id.0).collect();
    let settings = Settings::NoiseModel(NoiseModelSettings {
        name: request.name,
        description: request.description.unwrap_or_default(),
        static_recordings: ids(request.static_recordings),
        movement_recordings: ids(request.movement_recordings),
    });
    let job = state.queue.enqueue(&caller.access, first, &settings).await?;
    let location = format!("/v1/jobs/{}", job.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(JobResponse::from(job))).into_response())
}

/// Each must be there, with a skeleton, and none twice: one recording given twice is not two.
async fn check_recordings(state: &AppState, access: &Access, request: &NoiseModelRequest) -> Result<(), ApiError> {
    let lists =
        [("static_recordings", &request.static_recordings), ("movement_recordings", &request.movement_recordings)];
    let mut errors = Vec::new();
    for (field, ids) in lists {
        let mut seen = HashSet::new();
        for (i, id) in ids.iter().enumerate() {
            let mut refuse = |message: &str| errors.push(FieldError::new(format!("{field}[{i}]"), message));
            if !seen.insert(id) {
                refuse("is given twice");
                continue;
            }
            match state.store.recording(&access.own(), *id).await {
                Ok(recording) if recording.inspection.n_frames > 0 => {}
                Ok(_) => refuse("has no skeleton frames"),
                Err(StorageError::NotFound { .. }) => refuse("is no recording that your key may see"),
                Err(error) => return Err(error.into()),
            }
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(ApiError::InvalidBody(errors)) }
}

/// List noise models
///
/// Trained ones newest first, then those that come with the software, in pages.
#[utoipa::path(get, path = "/v1/noise-models", tag = "noise models", operation_id = "list_noise_models",
    security(("api_key" = ["clinician"])),
    params(NoiseModelsQuery),
    responses((status = 200, description = "One page", body = Page<NoiseModelItem>)))]
async fn list_noise_models(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiQuery(query): ApiQuery<NoiseModelsQuery>,
) -> Result<Json<Page<NoiseModelItem>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let after = id_from_cursor(query.cursor.as_deref())?.map(NoiseModelId);
    let stored = state.store.noise_models(&caller.access, &PageRequest { after, limit }).await?;
    let mut page = crate::storage::Page {
        items: stored.items.iter().map(NoiseModelItem::from).collect::<Vec<_>>(),
        next: stored.next,
    };
    if page.next.is_none() {
        append_shipped(&mut page, after, limit as usize);
    }
    let link = PageLink::new("/v1/noise-models", limit, &[]);
    Ok(Json(Page::from_stored(page, &link, |id| id.0, |item| item)))
}

/// Fills the last page of stored models with shipped ones.
fn append_shipped(
    page: &mut crate::storage::Page<NoiseModelItem, NoiseModelId>,
    after: Option<NoiseModelId>,
    limit: usize,
) {
    let items = shipped().iter().enumerate().rev().map(|(number, model)| NoiseModelItem::of_shipped(number, model));
    for item in items.filter(|item| after.is_none_or(|after| item.id < after)) {
        if page.items.len() == limit {
            page.next = page.items.last().map(|last| last.id);
            return;
        }
        page.items.push(item);
    }
}

/// Read a noise model
///
/// By its id, its name (the newest version) or `name@version`.
#[utoipa::path(get, path = "/v1/noise-models/{id}", tag = "noise models", operation_id = "read_noise_model",
    security(("api_key" = ["clinician"])),
    params(NoiseModelPath),
    responses((status = 200, description = "The model", body = NoiseModelResponse),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_noise_model(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<NoiseModelPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let response = noise_model(&state, &caller.access, &path.id).await?;
    Ok(tagged_json(&headers, &response))
}

async fn noise_model(state: &AppState, access: &Access, text: &str) -> Result<NoiseModelResponse, ApiError> {
    let id = text.parse::<NoiseModelId>().ok();
    let name = text.parse::<NoiseModelName>().ok();
    for (number, model) in shipped().iter().enumerate() {
        let item = NoiseModelItem::of_shipped(number, model);
        let is_meant = name.as_ref().and_then(find_shipped).is_some_and(|found| found.name() == model.name());
        if id == Some(item.id) || is_meant {
            return Ok(NoiseModelResponse { item, model: model.document().clone() });
        }
    }
    let stored = match (id, name) {
        (Some(id), _) => state.store.noise_model(access, id).await?,
        (None, Some(name)) => state.store.noise_model_named(access, &name).await?,
        (None, None) => return Err(ApiError::NotFound("noise model")),
    };
    Ok(NoiseModelResponse { item: NoiseModelItem::from(&stored), model: stored.model.document().clone() })
}

/// Settings whose noise model is there, with its version pinned: what is computed later is what was meant now.
///
/// # Errors
/// [`ApiError::InvalidBody`] with the names that exist.
pub(super) async fn pinned(
    state: &AppState,
    access: &Access,
    settings: JointAngleSettings,
) -> Result<JointAngleSettings, ApiError> {
    let Some(text) = &settings.noise_model else { return Ok(settings) };
    let noise_model = Some(pinned_name(state, access, text).await?);
    Ok(JointAngleSettings { noise_model, ..settings })
}

/// The name of a noise model that is there, with its version.
///
/// # Errors
/// [`ApiError::InvalidBody`] for the field `noise_model`, with the names that exist.
pub(super) async fn pinned_name(state: &AppState, access: &Access, text: &str) -> Result<String, ApiError> {
    let refuse = |message: String| ApiError::InvalidBody(vec![FieldError::new("noise_model", message)]);
    let name: NoiseModelName = text.parse().map_err(|error| refuse(format!("{error}")))?;
    if name.is_adaptive() {
        return Ok(name.to_string());
    }
    if let Some(model) = find_shipped(&name) {
        return Ok(model.name().to_string());
    }
    match state.store.noise_model_named(access, &name).await {
        Ok(stored) => Ok(stored.model.name().to_string()),
        Err(StorageError::NotFound { .. }) => {
            let mut names = vec![ADAPTIVE.to_owned()];
            names.extend(shipped().iter().map(|model| model.document().name.clone()));
            names.extend(state.store.names_of_noise_models(access, NAMES_TOLD).await?);
            Err(refuse(format!("there is no noise model `{name}`; there are {}", names.join(", "))))
        }
        Err(error) => Err(error.into()),
    }
}
