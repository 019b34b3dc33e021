//! The report of a patient, and its parts: findings of rules, measures, trends.

use super::auth::{Caller, Clinician};
use super::error::ApiError;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::patients::PatientPath;
use super::request::{ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::fall_risk::{CHANGE_RULES, ChangeInfo, Finding, Known, Measures, Person, RULES, RuleInfo, Sex, findings};
use crate::protocol;
use crate::report::{
    Adherence, CAUTION, MeasureRecord, MeasureSource, PatientReport, PatientSummary, StatusCounts, Trend, needed,
};
use crate::storage::{
    self, MeasureFilter, MeasureId, PageRequest, Patient, PatientId, QuestionnaireId, SessionId, Store,
};
use axum::Json;
use axum::extract::State;
use garde::Validate;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

/// Latest values that a trend in the report goes back over, and most that can be asked for.
const REPORT_POINTS: u32 = 30;
const DEFAULT_POINTS: u32 = 100;
/// Protocol whose measures are of a walking aid's user.
const WALK_WITH_AID: &str = "walk_with_walker";
/// Latest sessions that the report shows.
const REPORT_SESSIONS: u32 = 10;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(list_fall_risk_rules))
        .routes(routes!(read_fall_risk))
        .routes(routes!(list_measures))
        .routes(routes!(list_trends))
        .routes(routes!(read_report))
}

/// Every rule.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct RulesResponse {
    /// Rules about falls, in the order of a report.
    pub items: Vec<RuleInfo>,
    /// Smallest differences that are changes.
    pub changes: Vec<ChangeInfo>,
    /// What must be read with them.
    pub caution: &'static str,
}

/// As of when a report is wanted.
#[derive(Debug, Clone, Copy, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ReportQuery {
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
    /// The newest value of each measure that rules take, and where it is from.
    pub measures: Vec<MeasureUsed>,
}

/// Where the value of a measure is from.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct MeasureUsed {
    /// The measure.
    pub name: String,
    /// Its value.
    pub measure_id: Uuid,
    /// Where it is from.
    pub source: MeasureSource,
    /// When it was measured.
    #[serde(with = "time::serde::rfc3339")]
    pub measured_at: OffsetDateTime,
}

/// Which measures are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct MeasuresQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
    /// Only of this name.
    #[garde(custom(text::optional_word))]
    #[param(pattern = "^[a-z0-9_]{1,64}$", example = "usual_speed_mps")]
    pub name: Option<String>,
    /// Only by assessments of this session.
    #[garde(skip)]
    #[param(value_type = Option<String>, format = Uuid)]
    pub session_id: Option<SessionId>,
}

/// Which trends are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct TrendsQuery {
    /// Only of this measure.
    #[garde(custom(text::optional_word))]
    #[param(pattern = "^[a-z0-9_]{1,64}$", example = "usual_speed_mps")]
    pub name: Option<String>,
    /// Most values of each trend; the latest are kept.
    #[garde(range(min = 1, max = 1000))]
    #[param(minimum = 1, maximum = 1000, default = 100)]
    pub points: Option<u32>,
    /// Only what had been added by this time counts; without it everything.
    #[serde(default, with = "time::serde::rfc3339::option")]
    #[garde(custom(text::calendar_time))]
    #[param(value_type = Option<String>, format = DateTime)]
    pub as_of: Option<OffsetDateTime>,
}

/// How measures of a patient changed.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct TrendsResponse {
    /// As of when.
    #[serde(with = "time::serde::rfc3339")]
    pub as_of: OffsetDateTime,
    /// One trend for each measure and side.
    pub items: Vec<Trend>,
    /// What must be read with them.
    pub caution: &'static str,
}

/// List the rules about the risk of falling
///
/// Each with what it says, its limits, its source, the population that it was developed on, how accurate it is and how well
/// its numbers are confirmed; and the differences between two occasions that count as changes.
#[utoipa::path(get, path = "/v1/fall-risk-rules", tag = "report", operation_id = "list_fall_risk_rules",
    security(("api_key" = ["device"])),
    responses((status = 200, description = "Every rule", body = RulesResponse)))]
async fn list_fall_risk_rules(_: Caller) -> Json<RulesResponse> {
    let items = RULES.iter().map(|rule| rule.info).collect();
    Json(RulesResponse { items, changes: CHANGE_RULES.to_vec(), caution: CAUTION })
}

/// Read the risk of falling of a patient
///
/// Applies every rule to the newest answers and the newest value of each measure, whether an assessment measured it or somebody
/// entered it. Inputs are only ever added, so an earlier state can be read again with `as_of`; the patient's own data are those
/// of today.
#[utoipa::path(get, path = "/v1/patients/{id}/fall-risk", tag = "report", operation_id = "read_fall_risk",
    security(("api_key" = ["clinician"])),
    params(PatientPath, ReportQuery),
    responses((status = 200, description = "A finding for every rule", body = FallRiskResponse)))]
async fn read_fall_risk(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<ReportQuery>,
) -> Result<Json<FallRiskResponse>, ApiError> {
    let as_of = query.as_of.unwrap_or_else(|| state.store.now());
    let facts = Facts::of(&state.store, &caller, path.id, as_of).await?;
    let inputs = InputsUsed {
        age_years: facts.age_years,
        questionnaire: facts.questionnaire,
        measures: facts.used.iter().map(|i| MeasureUsed::of(&facts.measures[*i])).collect(),
    };
    Ok(Json(FallRiskResponse { as_of, inputs, findings: findings(&facts.known), caution: CAUTION }))
}

/// List the measures of a patient
///
/// Every value that an assessment measured or somebody entered, those stored last first, in pages; also values that a later
/// assessment of the same recording has replaced.
#[utoipa::path(get, path = "/v1/patients/{id}/measures", tag = "report", operation_id = "list_measures",
    security(("api_key" = ["clinician"])),
    params(PatientPath, MeasuresQuery),
    responses((status = 200, description = "One page", body = Page<MeasureRecord>)))]
async fn list_measures(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<MeasuresQuery>,
) -> Result<Json<Page<MeasureRecord>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(MeasureId), limit };
    let filters = [("name", query.name.clone()), ("session_id", query.session_id.map(|id| id.to_string()))];
    let link = PageLink::new(format!("/v1/patients/{}/measures", path.id), limit, &filters);
    let filter = MeasureFilter { name: query.name, session_id: query.session_id, ..MeasureFilter::default() };
    let found = state.store.measures_of_patient(&caller.access, path.id, &filter, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, |measure| measure)))
}

/// List the trends of a patient
///
/// Of each measure and side the latest values of one definition, and whether the newest differs from the one before and from
/// the first one shown by more than the minimal detectable change. A smaller difference is not reported as a change.
#[utoipa::path(get, path = "/v1/patients/{id}/trends", tag = "report", operation_id = "list_trends",
    security(("api_key" = ["clinician"])),
    params(PatientPath, TrendsQuery),
    responses((status = 200, description = "The trends", body = TrendsResponse)))]
async fn list_trends(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<TrendsQuery>,
) -> Result<Json<TrendsResponse>, ApiError> {
    let as_of = query.as_of.unwrap_or_else(|| state.store.now());
    state.store.patient(&caller.access, path.id).await?;
    let mut newest = state.store.newest_measures(&caller.access, path.id, as_of).await?;
    if let Some(name) = &query.name {
        newest.retain(|measure| measure.name == *name);
    }
    let points = query.points.unwrap_or(DEFAULT_POINTS);
    let items = trends(&state.store, &caller, path.id, &newest, as_of, points).await?;
    Ok(Json(TrendsResponse { as_of, items, caution: CAUTION }))
}

/// Read the report of a patient
///
/// Findings of every rule, what is missing for those without an answer and what to record next, the newest value of each
/// measure, trends, adherence to the training plan, and what came of the latest sessions.
#[utoipa::path(get, path = "/v1/patients/{id}/report", tag = "report", operation_id = "read_report",
    security(("api_key" = ["clinician"])),
    params(PatientPath, ReportQuery),
    responses((status = 200, description = "The report", body = PatientReport)))]
async fn read_report(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<ReportQuery>,
) -> Result<Json<PatientReport>, ApiError> {
    Ok(Json(report_of(&state.store, &caller, path.id, query.as_of).await?))
}

/// The report of a patient, as of a time or of now.
///
/// # Errors
/// When the organisation has no such patient, or the database fails.
pub async fn report_of(
    store: &Store,
    caller: &Caller,
    patient: PatientId,
    as_of: Option<OffsetDateTime>,
) -> Result<PatientReport, ApiError> {
    let as_of = as_of.unwrap_or_else(|| store.now());
    let facts = Facts::of(store, caller, patient, as_of).await?;
    let found = findings(&facts.known);
    let of_report = |m: &&MeasureRecord| m.side.is_none() && crate::report::measure::kind_of(&m.name).is_some();
    let shown: Vec<MeasureRecord> = facts.measures.iter().filter(of_report).cloned().collect();
    let mut trends = trends(store, caller, patient, &shown, as_of, REPORT_POINTS).await?;
    // One value is no trend.
    trends.retain(|trend| trend.points.len() > 1);
    Ok(PatientReport {
        patient: facts.summary(),
        as_of,
        software_version: env!("CARGO_PKG_VERSION"),
        counts: StatusCounts::of(&found),
        needed: needed(&found, protocol::protocols_measuring),
        findings: found,
        measures: facts.measures,
        trends,
        adherence: adherence(store, caller, patient, as_of).await?,
        recent_sessions: store.recent_sessions(&caller.access, patient, as_of, REPORT_SESSIONS).await?,
        caution: CAUTION,
    })
}

async fn trends(
    store: &Store,
    caller: &Caller,
    patient: PatientId,
    newest: &[MeasureRecord],
    as_of: OffsetDateTime,
    points: u32,
) -> Result<Vec<Trend>, ApiError> {
    let mut trends = Vec::with_capacity(newest.len());
    for measure in newest {
        let course = store.course_of_measure(&caller.access, patient, measure, as_of, points).await?;
        trends.extend(Trend::of(&course));
    }
    Ok(trends)
}

async fn adherence(
    store: &Store,
    caller: &Caller,
    patient: PatientId,
    by: OffsetDateTime,
) -> Result<Option<Adherence>, ApiError> {
    let Some(plan) = store.newest_plan(&caller.access, patient, by).await? else { return Ok(None) };
    let from = Adherence::window_start(plan.created_at, by);
    let sessions = store.trained_sessions(&caller.access, patient, [from, by]).await?;
    Ok(Some(Adherence::of(&plan.content, plan.created_at, by, &sessions)))
}

/// What is known of a patient at a time.
struct Facts {
    patient: Patient,
    age_years: Option<i32>,
    questionnaire: Option<QuestionnaireId>,
    /// The newest value of each measure and side.
    measures: Vec<MeasureRecord>,
    /// Places of those that rules took.
    used: Vec<usize>,
    known: Known,
}

impl Facts {
    async fn of(store: &Store, caller: &Caller, id: PatientId, by: OffsetDateTime) -> Result<Self, ApiError> {
        let patient = store.patient(&caller.access, id).await?;
        let answered = store.newest_answers(&caller.access, id, by).await?;
        let records = store.newest_measures(&caller.access, id, by).await?;
        let mut measures = Measures::default();
        // Where a measure has several definitions the last one counts for rules: footprints, as walkways measure them.
        let whole_body = records.iter().enumerate().filter(|(_, record)| record.side.is_none());
        let taken = whole_body.filter(|(_, record)| measures.take(&record.name, record.measured()));
        let used: Vec<usize> = taken.map(|(i, _)| i).collect();
        // Whoever walked behind a walker uses a walking aid, whatever stands in the patient's data.
        let walked_with_aid = used.iter().any(|i| records[*i].protocol.as_deref() == Some(WALK_WITH_AID));
        let answers = answered.as_ref().map(|entry| entry.content).unwrap_or_default();
        let age_years = patient.birth_year.map(|year| by.year() - i32::from(year));
        let person = Person {
            age_years: age_years.map(f64::from),
            sex: patient.sex.and_then(sex_of_norms),
            uses_walking_aid: if walked_with_aid { Some(true) } else { patient.uses_walking_aid },
            lives_in_community: answers.lives_in_community,
        };
        let known = Known { person, answers, measures };
        let questionnaire = answered.map(|entry| entry.id);
        Ok(Self { patient, age_years, questionnaire, measures: records, used, known })
    }

    fn summary(&self) -> PatientSummary {
        PatientSummary {
            id: self.patient.id.into(),
            pseudonym: self.patient.pseudonym.clone(),
            age_years: self.age_years,
            sex: self.known.person.sex,
            height_m: self.patient.height_m,
            uses_walking_aid: self.known.person.uses_walking_aid,
            matches_population: self.known.person.matches_population(),
        }
    }
}

impl MeasureUsed {
    fn of(record: &MeasureRecord) -> Self {
        let MeasureRecord { id, name, source, measured_at, .. } = record;
        Self { name: name.clone(), measure_id: *id, source: *source, measured_at: *measured_at }
    }
}

/// Norms are given for two sexes; for others the rules say that they do not know.
fn sex_of_norms(sex: storage::Sex) -> Option<Sex> {
    match sex {
        storage::Sex::Female => Some(Sex::Female),
        storage::Sex::Male => Some(Sex::Male),
        storage::Sex::Other => None,
    }
}
