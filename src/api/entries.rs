//! What people enter about a patient: answers, results of tests, training plans.

use super::auth::Clinician;
use super::error::{ApiError, FieldError};
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::patients::PatientPath;
use super::request::{ApiJson, ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::fall_risk::{Answers, Measures};
use crate::report::TrainingPlan;
use crate::storage::{Entry, MeasurementId, Occasion, PageRequest, QuestionnaireId, TrainingPlanId};
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(add_questionnaire, list_questionnaires))
        .routes(routes!(add_measurement, list_measurements))
        .routes(routes!(add_training_plan, list_training_plans))
}

/// Answers of a patient.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct QuestionnaireResponse {
    /// Identity.
    pub id: QuestionnaireId,
    /// What was answered; what is absent is not known.
    pub answers: Answers,
    /// When they were added.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

impl From<Entry<QuestionnaireId, Answers>> for QuestionnaireResponse {
    fn from(Entry { id, content, created_at }: Entry<QuestionnaireId, Answers>) -> Self {
        Self { id, answers: content, created_at }
    }
}

/// Results of tests to be added.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasurementRequest {
    /// When the tests were done; without it now.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    pub measured_at: Option<OffsetDateTime>,
    /// What was measured.
    #[garde(skip)]
    pub measures: Measures,
}

/// Results of tests on one occasion.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct MeasurementResponse {
    /// Identity.
    pub id: MeasurementId,
    /// When the tests were done.
    #[serde(with = "time::serde::rfc3339")]
    pub measured_at: OffsetDateTime,
    /// What was measured.
    pub measures: Measures,
    /// When they were added.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

impl From<Entry<MeasurementId, Occasion>> for MeasurementResponse {
    fn from(Entry { id, content, created_at }: Entry<MeasurementId, Occasion>) -> Self {
        Self { id, measured_at: content.measured_at, measures: content.measures, created_at }
    }
}

/// A training plan of a patient.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct TrainingPlanResponse {
    /// Identity.
    pub id: TrainingPlanId,
    /// What is to be trained.
    pub plan: TrainingPlan,
    /// When it was added.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

impl From<Entry<TrainingPlanId, TrainingPlan>> for TrainingPlanResponse {
    fn from(Entry { id, content, created_at }: Entry<TrainingPlanId, TrainingPlan>) -> Self {
        Self { id, plan: content, created_at }
    }
}

/// Which page is wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct InputsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
}

/// Add answers of a patient
///
/// The newest set counts as a whole; earlier ones are kept. An answer that is left out is not known.
#[utoipa::path(post, path = "/v1/patients/{id}/questionnaires", tag = "entries", operation_id = "add_questionnaire",
    security(("api_key" = ["clinician"])),
    params(PatientPath), request_body = Answers,
    responses((status = 201, description = "Added", body = QuestionnaireResponse)))]
async fn add_questionnaire(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(Checked(answers)): ApiJson<Checked<Answers>>,
) -> Result<(StatusCode, Json<QuestionnaireResponse>), ApiError> {
    refuse(answers.contradictions(), "")?;
    let added = state.store.add_answers(&caller.access, path.id, &answers).await?;
    Ok((StatusCode::CREATED, Json(added.into())))
}

/// List the answers of a patient
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/patients/{id}/questionnaires", tag = "entries", operation_id = "list_questionnaires",
    security(("api_key" = ["clinician"])),
    params(PatientPath, InputsQuery),
    responses((status = 200, description = "One page", body = Page<QuestionnaireResponse>)))]
async fn list_questionnaires(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<InputsQuery>,
) -> Result<Json<Page<QuestionnaireResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(QuestionnaireId), limit };
    let link = PageLink::new(format!("/v1/patients/{}/questionnaires", path.id), limit, &[]);
    let found = state.store.answers_of_patient(&caller.access, path.id, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, QuestionnaireResponse::from)))
}

/// Add results of tests of a patient
///
/// Of each measure the value measured last counts.
#[utoipa::path(post, path = "/v1/patients/{id}/measurements", tag = "entries", operation_id = "add_measurement",
    security(("api_key" = ["clinician"])),
    params(PatientPath), request_body = MeasurementRequest,
    responses((status = 201, description = "Added", body = MeasurementResponse)))]
async fn add_measurement(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(request): ApiJson<MeasurementRequest>,
) -> Result<(StatusCode, Json<MeasurementResponse>), ApiError> {
    let MeasurementRequest { measured_at, measures } = request;
    if measures.names().is_empty() {
        refuse(vec![("measures", "must hold at least one measure".to_owned())], "")?;
    }
    refuse(measures.impossible(), "measures.")?;
    let measured_at = measured_at.unwrap_or_else(|| state.store.now());
    let added = state.store.add_occasion(&caller.access, path.id, &Occasion { measured_at, measures }).await?;
    Ok((StatusCode::CREATED, Json(added.into())))
}

/// List the results of tests of a patient
///
/// Those added last first, in pages.
#[utoipa::path(get, path = "/v1/patients/{id}/measurements", tag = "entries", operation_id = "list_measurements",
    security(("api_key" = ["clinician"])),
    params(PatientPath, InputsQuery),
    responses((status = 200, description = "One page", body = Page<MeasurementResponse>)))]
async fn list_measurements(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<InputsQuery>,
) -> Result<Json<Page<MeasurementResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(MeasurementId), limit };
    let link = PageLink::new(format!("/v1/patients/{}/measurements", path.id), limit, &[]);
    let found = state.store.occasions_of_patient(&caller.access, path.id, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, MeasurementResponse::from)))
}

/// Add a training plan of a patient
///
/// The newest plan counts; earlier ones are kept. What was done of it stands in the report.
#[utoipa::path(post, path = "/v1/patients/{id}/training-plans", tag = "entries", operation_id = "add_training_plan",
    security(("api_key" = ["clinician"])),
    params(PatientPath), request_body = TrainingPlan,
    responses((status = 201, description = "Added", body = TrainingPlanResponse)))]
async fn add_training_plan(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(Checked(plan)): ApiJson<Checked<TrainingPlan>>,
) -> Result<(StatusCode, Json<TrainingPlanResponse>), ApiError> {
    refuse(plan.impossible(), "")?;
    let added = state.store.add_plan(&caller.access, path.id, &plan).await?;
    Ok((StatusCode::CREATED, Json(added.into())))
}

/// List the training plans of a patient
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/patients/{id}/training-plans", tag = "entries", operation_id = "list_training_plans",
    security(("api_key" = ["clinician"])),
    params(PatientPath, InputsQuery),
    responses((status = 200, description = "One page", body = Page<TrainingPlanResponse>)))]
async fn list_training_plans(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<InputsQuery>,
) -> Result<Json<Page<TrainingPlanResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(TrainingPlanId), limit };
    let link = PageLink::new(format!("/v1/patients/{}/training-plans", path.id), limit, &[]);
    let found = state.store.plans_of_patient(&caller.access, path.id, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, TrainingPlanResponse::from)))
}

/// An entry as it comes in a body. What it may not be is a matter of the whole, told by the entry itself.
#[derive(Debug, Clone, Deserialize, Validate)]
#[serde(transparent)]
struct Checked<T>(#[garde(skip)] T);

/// Refuses a body with what was found in it.
fn refuse<N: std::fmt::Display>(found: Vec<(N, String)>, parent: &str) -> Result<(), ApiError> {
    if found.is_empty() {
        return Ok(());
    }
    let of_field = |(name, sentence): (N, String)| FieldError::new(format!("{parent}{name}"), sentence);
    Err(ApiError::InvalidBody(found.into_iter().map(of_field).collect()))
}
