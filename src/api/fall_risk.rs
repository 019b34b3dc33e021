//! Fall risk: answers, results of tests, and what published rules make of them.

use super::auth::Clinician;
use super::error::{ApiError, FieldError};
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::patients::PatientPath;
use super::request::{ApiJson, ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::fall_risk::{Answers, Finding, Known, Measures, Person, RULES, RuleInfo, Sex, findings};
use crate::storage::{self, MeasurementId, PageRequest, Patient, QuestionnaireId, StoredAnswers, StoredMeasures};
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Occasions that are looked through for the newest value of each measure: three years of one a day.
const MOST_OCCASIONS: u32 = 1000;

/// What must be read with every finding.
const CAUTION: &str = "Decision support for trained clinicians: not a diagnosis, not for emergency use, and valid only for the \
                       stated population and way of testing. Limits marked unconfirmed must not guide care.";

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(list_fall_risk_rules))
        .routes(routes!(add_questionnaire, list_questionnaires))
        .routes(routes!(add_measurement, list_measurements))
        .routes(routes!(read_fall_risk))
}

/// Every rule.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct RulesResponse {
    /// In the order of a report.
    pub items: Vec<RuleInfo>,
    /// What must be read with them.
    pub caution: &'static str,
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

impl From<StoredAnswers> for QuestionnaireResponse {
    fn from(StoredAnswers { id, answers, created_at }: StoredAnswers) -> Self {
        Self { id, answers, created_at }
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

impl From<StoredMeasures> for MeasurementResponse {
    fn from(StoredMeasures { id, measured_at, measures, created_at }: StoredMeasures) -> Self {
        Self { id, measured_at, measures, created_at }
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

/// As of when the risk is wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct FallRiskQuery {
    /// Only what had been added by this time counts; without it everything.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    #[param(value_type = Option<String>, format = DateTime)]
    pub as_of: Option<OffsetDateTime>,
}

/// What published rules make of what is known of a patient.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct FallRiskResponse {
    /// As of when.
    #[serde(with = "time::serde::rfc3339")]
    pub as_of: OffsetDateTime,
    /// What the findings rest on.
    pub inputs: InputsUsed,
    /// One finding for each rule, in the order of a report; no score blends them.
    pub findings: Vec<Finding>,
    /// What must be read with them.
    pub caution: &'static str,
}

/// What findings rest on.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct InputsUsed {
    /// Age, by the calendar years, years.
    pub age_years: Option<i32>,
    /// The answers that counted: the newest; null when nobody has answered.
    pub questionnaire: Option<QuestionnaireId>,
    /// The newest value of each measure, and where it is from.
    pub measures: Vec<MeasureUsed>,
}

/// Where the value of a measure is from.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct MeasureUsed {
    /// The measure.
    pub name: &'static str,
    /// The measurement that it is from.
    pub measurement: MeasurementId,
    /// When it was measured.
    #[serde(with = "time::serde::rfc3339")]
    pub measured_at: OffsetDateTime,
}

/// List the rules about the risk of falling
///
/// Each with what it says, its limits, its source, the population that it was developed on, how accurate it is and how well
/// its numbers are confirmed.
#[utoipa::path(get, path = "/v1/fall-risk-rules", tag = "fall risk", operation_id = "list_fall_risk_rules",
    responses((status = 200, description = "Every rule", body = RulesResponse)))]
async fn list_fall_risk_rules(_: Clinician) -> Json<RulesResponse> {
    Json(RulesResponse { items: RULES.iter().map(|rule| rule.info).collect(), caution: CAUTION })
}

/// Add answers of a patient
///
/// The newest set counts as a whole; earlier ones are kept. An answer that is left out is not known.
#[utoipa::path(post, path = "/v1/patients/{id}/questionnaires", tag = "fall risk", operation_id = "add_questionnaire",
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
#[utoipa::path(get, path = "/v1/patients/{id}/questionnaires", tag = "fall risk", operation_id = "list_questionnaires",
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
#[utoipa::path(post, path = "/v1/patients/{id}/measurements", tag = "fall risk", operation_id = "add_measurement",
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
    let added = state.store.add_measures(&caller.access, path.id, measured_at, &measures).await?;
    Ok((StatusCode::CREATED, Json(added.into())))
}

/// List the results of tests of a patient
///
/// Those added last first, in pages.
#[utoipa::path(get, path = "/v1/patients/{id}/measurements", tag = "fall risk", operation_id = "list_measurements",
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
    let found = state.store.measures_of_patient(&caller.access, path.id, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, MeasurementResponse::from)))
}

/// Read the risk of falling of a patient
///
/// Applies every rule to the newest answers and the newest value of each measure. Inputs are only ever added, so an earlier
/// state can be read again with `as_of`; the patient's own data are those of today.
#[utoipa::path(get, path = "/v1/patients/{id}/fall-risk", tag = "fall risk", operation_id = "read_fall_risk",
    params(PatientPath, FallRiskQuery),
    responses((status = 200, description = "A finding for every rule", body = FallRiskResponse)))]
async fn read_fall_risk(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<FallRiskQuery>,
) -> Result<Json<FallRiskResponse>, ApiError> {
    let as_of = query.as_of.unwrap_or_else(|| state.store.now());
    let patient = state.store.patient(&caller.access, path.id).await?;
    let answered = state.store.newest_answers(&caller.access, path.id, as_of).await?;
    let occasions = state.store.latest_measures(&caller.access, path.id, as_of, MOST_OCCASIONS).await?;
    let mut measures = Measures::default();
    let mut used = Vec::new();
    for StoredMeasures { id, measured_at, measures: earlier, .. } in occasions {
        let names = measures.complete_from(earlier);
        used.extend(names.into_iter().map(|name| MeasureUsed { name, measurement: id, measured_at }));
    }
    let answers = answered.as_ref().map(|answered| answered.answers).unwrap_or_default();
    let age_years = patient.birth_year.map(|year| as_of.year() - i32::from(year));
    let known = Known { person: person_of(&patient, &answers, age_years), answers, measures };
    let questionnaire = answered.map(|answered| answered.id);
    let inputs = InputsUsed { age_years, questionnaire, measures: used };
    Ok(Json(FallRiskResponse { as_of, inputs, findings: findings(&known), caution: CAUTION }))
}

fn person_of(patient: &Patient, answers: &Answers, age_years: Option<i32>) -> Person {
    let sex = patient.sex.and_then(|sex| match sex {
        storage::Sex::Female => Some(Sex::Female),
        storage::Sex::Male => Some(Sex::Male),
        // Norms are given for two sexes; for others the rules say that they do not know.
        storage::Sex::Other => None,
    });
    Person {
        age_years: age_years.map(f64::from),
        sex,
        uses_walking_aid: patient.uses_walking_aid,
        lives_in_community: answers.lives_in_community,
    }
}

/// Answers as they come in a body. What they may not be is a matter of the whole, told by [`Answers::contradictions`].
#[derive(Debug, Clone, Copy, Deserialize, Validate)]
#[serde(transparent)]
struct Checked<T>(#[garde(skip)] T);

/// Refuses a body with what was found in it.
fn refuse(found: Vec<(&'static str, String)>, parent: &str) -> Result<(), ApiError> {
    if found.is_empty() {
        return Ok(());
    }
    let of_field = |(name, sentence)| FieldError::new(format!("{parent}{name}"), sentence);
    Err(ApiError::InvalidBody(found.into_iter().map(of_field).collect()))
}
