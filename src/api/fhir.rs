//! Read-only FHIR R4: measures, findings and reports as resources, by id and by search.

use super::assessments::AssessmentPath;
use super::auth::{Caller, Clinician};
use super::error::ApiError;
use super::page::id_from_cursor;
use super::patients::PatientPath;
use super::report::{ReportQuery, report_of};
use super::request::{ApiPath, ApiQuery};
use super::state::AppState;
use crate::report::export::Samples;
use crate::report::fhir::observation::observation;
use crate::report::fhir::risk_assessment::{risk_assessment, risk_assessment_id};
use crate::report::fhir::{self, Found, SeriesOrigin, diagnostic_report::diagnostic_report, series_bundle};
use crate::report::{MeasureSource, PatientReport};
use crate::storage::{AssessmentId, MeasureFilter, MeasureId, PageRequest, Parts, PatientId, SeriesQuery, Store};
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use garde::Validate;
use serde::Deserialize;
use serde_json::Value;
use time::format_description::well_known::Rfc3339;
use time::{Date, OffsetDateTime};
use tokio::task::spawn_blocking;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

/// Where the endpoints stand.
const BASE: &str = "/fhir/R4";
/// Media type of the answers.
const MEDIA_TYPE: &str = "application/fhir+json";
/// Resources of a page when nobody asked for a number.
const DEFAULT_COUNT: u32 = 50;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(read_fhir_bundle))
        .routes(routes!(read_fhir_series))
        .routes(routes!(fhir_metadata))
        .routes(routes!(search_observations))
        .routes(routes!(read_observation))
        .routes(routes!(search_risk_assessments))
        .routes(routes!(read_risk_assessment))
        .routes(routes!(search_diagnostic_reports))
        .routes(routes!(read_diagnostic_report))
}

/// A search by patient, date and code.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct FhirQuery {
    /// The patient, as an id or as `Patient/{id}`; needed.
    #[garde(length(max = 64))]
    #[param(max_length = 64, example = "Patient/0193b2a8-1111-7aaa-8bbb-000000000000")]
    pub patient: String,
    /// A date or time with an optional prefix `eq`, `ge`, `gt`, `le` or `lt`, for example `ge2026-01-01`.
    #[garde(length(max = 64))]
    #[param(max_length = 64, example = "ge2026-01-01")]
    pub date: Option<String>,
    /// A code, as `code` or `system|code`.
    #[garde(length(max = 200))]
    #[param(max_length = 200, example = "urn:surefoot:measure|usual_speed_mps")]
    pub code: Option<String>,
    /// Resources of a page.
    #[serde(rename = "_count")]
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub count: Option<u32>,
    /// Where the page begins; taken from the link `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
}

/// Address of one resource.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct ResourcePath {
    /// Logical id of the resource.
    #[param(pattern = "^[A-Za-z0-9.-]{1,64}$")]
    pub id: String,
}

/// Read the report of a patient as a FHIR bundle
///
/// A collection: the software as a device, an Observation for each measure, a RiskAssessment for each rule, the DiagnosticReport
/// that groups them (`preliminary` until a clinician signs), and a Provenance for each assessment they rest on. The patient is
/// referenced and never inlined.
#[utoipa::path(get, path = "/v1/patients/{id}/fhir-bundle", tag = "fhir", operation_id = "read_fhir_bundle",
    security(("api_key" = ["clinician"])),
    params(PatientPath, ReportQuery),
    responses((status = 200, description = "The bundle", content_type = "application/fhir+json", body = Value)))]
async fn read_fhir_bundle(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiQuery(query): ApiQuery<ReportQuery>,
) -> Result<Response, ApiError> {
    let report = report_of(&state.store, &caller, path.id, query.as_of).await?;
    Ok(answer(&bundle_of(&state.store, &caller, &report).await?))
}

/// A report as a FHIR bundle.
pub(super) async fn bundle_of(store: &Store, caller: &Caller, report: &PatientReport) -> Result<Value, ApiError> {
    let origins = store.origins_of_assessments(&caller.access, &assessments_of(report)).await?;
    Ok(fhir::report_bundle(report, &origins, BASE))
}

/// Read the series of an assessment as a FHIR bundle
///
/// A collection with an Observation for each channel, as sampled data with one period; at most ten thousand samples of each, longer
/// ones are read as CSV. Intervals and flags are not in it.
#[utoipa::path(get, path = "/v1/assessments/{id}/fhir-bundle", tag = "fhir", operation_id = "read_fhir_series",
    security(("api_key" = ["clinician"])),
    params(AssessmentPath),
    responses((status = 200, description = "The bundle", content_type = "application/fhir+json", body = Value)))]
async fn read_fhir_series(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<AssessmentPath>,
) -> Result<Response, ApiError> {
    let assessment = state.store.assessment(&caller.access, path.id).await?;
    let session = state.store.session(&caller.access, assessment.session_id).await?;
    let query = SeriesQuery { parts: Parts { interval: false, flags: false }, ..SeriesQuery::default() };
    let slice = state.store.series_of_assessment(&caller.access, path.id, &query).await?;
    let origin = SeriesOrigin {
        patient: assessment.patient_id.into(),
        assessment: assessment.id.into(),
        recorded_at: session.started_at,
        created_at: assessment.created_at,
    };
    let samples = Samples { time_ns: slice.time_ns, series: slice.series };
    let made = spawn_blocking(move || series_bundle(&samples, &origin, BASE).to_string()).await;
    Ok(sent(made.map_err(ApiError::internal)?))
}

/// Read what the FHIR endpoints can do
#[utoipa::path(get, path = "/fhir/R4/metadata", tag = "fhir", operation_id = "fhir_metadata", security(()),
    responses((status = 200, description = "A CapabilityStatement", content_type = "application/fhir+json", body = Value)))]
async fn fhir_metadata(State(state): State<AppState>) -> Response {
    answer(&fhir::capability_statement(env!("CARGO_PKG_VERSION"), state.store.now(), BASE))
}

/// Search Observations
///
/// The measures of a patient, those stored last first. `date` is when they were measured.
#[utoipa::path(get, path = "/fhir/R4/Observation", tag = "fhir", operation_id = "search_observations",
    security(("api_key" = ["clinician"])),
    params(FhirQuery),
    responses((status = 200, description = "A searchset", content_type = "application/fhir+json", body = Value)))]
async fn search_observations(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiQuery(query): ApiQuery<FhirQuery>,
) -> Result<Response, ApiError> {
    let wanted = Wanted::of(&query)?;
    let name = wanted.code_in(fhir::MEASURE_SYSTEM);
    let limit = query.count.unwrap_or(DEFAULT_COUNT);
    let page = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(MeasureId), limit };
    let filter = MeasureFilter { name: name.clone(), measured: wanted.dates, ..MeasureFilter::default() };
    // A code of another system matches nothing that this service gives.
    let found = match (&wanted.code, &name) {
        (Some(_), None) => None,
        _ => Some(state.store.measures_of_patient(&caller.access, wanted.patient, &filter, &page).await?),
    };
    let (items, next) = found.map_or((Vec::new(), None), |page| (page.items, page.next));
    let resources = items.iter().map(|measure| observation(measure, wanted.patient.into())).collect();
    let own_link = wanted.link("Observation", &query, query.cursor.as_deref());
    let next = next.map(|id| super::page::cursor_from_id(id.0));
    let next_link = next.map(|cursor| wanted.link("Observation", &query, Some(&cursor)));
    Ok(answer(&fhir::searchset(Found { resources, total: None, own_link, next_link }, BASE)))
}

/// Read an Observation
#[utoipa::path(get, path = "/fhir/R4/Observation/{id}", tag = "fhir", operation_id = "read_observation",
    security(("api_key" = ["clinician"])),
    params(ResourcePath),
    responses((status = 200, description = "The resource", content_type = "application/fhir+json", body = Value)))]
async fn read_observation(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<ResourcePath>,
) -> Result<Response, ApiError> {
    let id = path.id.parse().map_err(|_| ApiError::NotFound("measure"))?;
    let (measure, patient) = state.store.measure(&caller.access, id).await?;
    Ok(answer(&observation(&measure, patient.into())))
}

/// Search RiskAssessments
///
/// A finding for each rule, as of now. `code` is a rule's id.
#[utoipa::path(get, path = "/fhir/R4/RiskAssessment", tag = "fhir", operation_id = "search_risk_assessments",
    security(("api_key" = ["clinician"])),
    params(FhirQuery),
    responses((status = 200, description = "A searchset", content_type = "application/fhir+json", body = Value)))]
async fn search_risk_assessments(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiQuery(query): ApiQuery<FhirQuery>,
) -> Result<Response, ApiError> {
    let wanted = Wanted::of(&query)?;
    let report = report_of(&state.store, &caller, wanted.patient, None).await?;
    let rule = wanted.code_in(fhir::RULE_SYSTEM);
    let is_wanted = |id: &str| wanted.code.is_none() || rule.as_deref() == Some(id);
    let findings = report.findings.iter().filter(|f| wanted.holds(report.as_of) && is_wanted(f.rule_id));
    let resources: Vec<Value> = findings.map(|finding| risk_assessment(finding, &report)).collect();
    Ok(answer(&wanted.all_of("RiskAssessment", &query, resources)))
}

/// Read a RiskAssessment
#[utoipa::path(get, path = "/fhir/R4/RiskAssessment/{id}", tag = "fhir", operation_id = "read_risk_assessment",
    security(("api_key" = ["clinician"])),
    params(ResourcePath),
    responses((status = 200, description = "The resource", content_type = "application/fhir+json", body = Value)))]
async fn read_risk_assessment(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<ResourcePath>,
) -> Result<Response, ApiError> {
    const UUID_LENGTH: usize = 36;
    let none = || ApiError::NotFound("risk assessment");
    let patient: PatientId = path.id.get(..UUID_LENGTH).and_then(|id| id.parse().ok()).ok_or_else(none)?;
    let report = report_of(&state.store, &caller, patient, None).await?;
    let own = |rule_id: &str| risk_assessment_id(patient.into(), rule_id) == path.id;
    let finding = report.findings.iter().find(|finding| own(finding.rule_id)).ok_or_else(none)?;
    Ok(answer(&risk_assessment(finding, &report)))
}

/// Search DiagnosticReports
///
/// The report of a patient, as of now.
#[utoipa::path(get, path = "/fhir/R4/DiagnosticReport", tag = "fhir", operation_id = "search_diagnostic_reports",
    security(("api_key" = ["clinician"])),
    params(FhirQuery),
    responses((status = 200, description = "A searchset", content_type = "application/fhir+json", body = Value)))]
async fn search_diagnostic_reports(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiQuery(query): ApiQuery<FhirQuery>,
) -> Result<Response, ApiError> {
    let wanted = Wanted::of(&query)?;
    let report = report_of(&state.store, &caller, wanted.patient, None).await?;
    let code = wanted.code_in(fhir::REPORT_SYSTEM);
    let is_wanted = wanted.code.is_none() || code.as_deref() == Some(fhir::REPORT_CODE);
    let resources = if is_wanted && wanted.holds(report.as_of) { vec![diagnostic_report(&report)] } else { Vec::new() };
    Ok(answer(&wanted.all_of("DiagnosticReport", &query, resources)))
}

/// Read a DiagnosticReport
#[utoipa::path(get, path = "/fhir/R4/DiagnosticReport/{id}", tag = "fhir", operation_id = "read_diagnostic_report",
    security(("api_key" = ["clinician"])),
    params(ResourcePath),
    responses((status = 200, description = "The resource", content_type = "application/fhir+json", body = Value)))]
async fn read_diagnostic_report(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<ResourcePath>,
) -> Result<Response, ApiError> {
    let none = || ApiError::NotFound("report");
    let patient = path.id.strip_prefix("report-").and_then(|id| id.parse().ok()).ok_or_else(none)?;
    let report = report_of(&state.store, &caller, patient, None).await?;
    Ok(answer(&diagnostic_report(&report)))
}

fn answer(resource: &Value) -> Response {
    sent(resource.to_string())
}

fn sent(resource: String) -> Response {
    ([(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE))], resource).into_response()
}

/// The assessments that the measures of a report are from.
fn assessments_of(report: &PatientReport) -> Vec<AssessmentId> {
    let of_measure = |source: MeasureSource| match source {
        MeasureSource::Assessment { assessment_id, .. } => Some(AssessmentId(assessment_id)),
        MeasureSource::Entered { .. } => None,
    };
    let mut ids: Vec<AssessmentId> = report.measures.iter().filter_map(|m| of_measure(m.source)).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// What a search asks for, understood.
struct Wanted {
    patient: PatientId,
    /// From, and up to but without; none is open.
    dates: [Option<OffsetDateTime>; 2],
    /// System and code; an empty system is any.
    code: Option<(String, String)>,
}

impl Wanted {
    fn of(query: &FhirQuery) -> Result<Self, ApiError> {
        let wrong = |field: &str, sentence: &str| ApiError::field(field, sentence);
        let id = query.patient.strip_prefix("Patient/").unwrap_or(&query.patient);
        let patient: Uuid =
            id.parse().map_err(|_| wrong("patient", "must be a patient's id, or `Patient/` and the id"))?;
        let dates = query.date.as_deref().map_or(Some([None, None]), dates_of);
        let dates = dates.ok_or_else(|| {
            wrong("date", "must be a date (2026-01-31) or time, after `eq`, `ge`, `gt`, `le`, `lt` or nothing")
        })?;
        let code = query.code.as_deref().map(|code| match code.split_once('|') {
            Some((system, code)) => (system.to_owned(), code.to_owned()),
            None => (String::new(), code.to_owned()),
        });
        Ok(Self { patient: PatientId(patient), dates, code })
    }

    /// The code that is asked for, if it can be one of the system.
    fn code_in(&self, own: &str) -> Option<String> {
        self.code.as_ref().filter(|(system, _)| system.is_empty() || system == own).map(|(_, code)| code.clone())
    }

    fn holds(&self, at: OffsetDateTime) -> bool {
        self.dates[0].is_none_or(|from| at >= from) && self.dates[1].is_none_or(|to| at < to)
    }

    fn link(&self, kind: &str, query: &FhirQuery, cursor: Option<&str>) -> String {
        let escaped = |text: &str| {
            let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~".contains(&b);
            text.bytes()
                .map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") })
                .collect::<String>()
        };
        let mut link = format!("{BASE}/{kind}?patient={}", self.patient);
        let parameters = [("date", query.date.as_deref()), ("code", query.code.as_deref()), ("cursor", cursor)];
        for (name, value) in parameters {
            if let Some(value) = value {
                link.push_str(&format!("&{name}={}", escaped(value)));
            }
        }
        if let Some(count) = query.count {
            link.push_str(&format!("&_count={count}"));
        }
        link
    }

    /// The answer to a search that has one page.
    fn all_of(&self, kind: &str, query: &FhirQuery, mut resources: Vec<Value>) -> Value {
        let total = Some(resources.len() as u64);
        resources.truncate(query.count.unwrap_or(DEFAULT_COUNT) as usize);
        let own_link = self.link(kind, query, None);
        fhir::searchset(Found { resources, total, own_link, next_link: None }, BASE)
    }
}

/// From, and up to but without, by a parameter of FHIR: a prefix and a day or a time.
fn dates_of(text: &str) -> Option<[Option<OffsetDateTime>; 2]> {
    let (prefix, rest) = match text.get(..2) {
        Some(prefix @ ("eq" | "ge" | "gt" | "le" | "lt")) => (prefix, &text[2..]),
        _ => ("eq", text),
    };
    let day = time::macros::format_description!("[year]-[month]-[day]");
    let [first, after] = match OffsetDateTime::parse(rest, &Rfc3339) {
        Ok(at) => [at, at.checked_add(time::Duration::milliseconds(1))?],
        Err(_) => {
            let date = Date::parse(rest, &day).ok()?;
            [date.midnight().assume_utc(), date.next_day()?.midnight().assume_utc()]
        }
    };
    let in_calendar = |at: &OffsetDateTime| (1..=9998).contains(&at.year());
    if ![first, after].iter().all(in_calendar) {
        return None;
    }
    Some(match prefix {
        "ge" => [Some(first), None],
        "gt" => [Some(after), None],
        "le" => [None, Some(after)],
        "lt" => [None, Some(first)],
        _ => [Some(first), Some(after)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use time::macros::datetime;

    #[test]
    fn a_day_is_a_stretch_of_time_and_a_prefix_opens_it() {
        let (first, after) = (datetime!(2026-01-31 0:00 UTC), datetime!(2026-02-01 0:00 UTC));
        assert_eq!(dates_of("2026-01-31"), Some([Some(first), Some(after)]));
        assert_eq!(dates_of("gt2026-01-31"), Some([Some(after), None]));
        assert_eq!(dates_of("le2026-01-31"), Some([None, Some(after)]));
        assert_eq!(dates_of("lt2026-01-31T00:00:00Z"), Some([None, Some(first)]));
        for wrong in ["", "ge", "2026-13-01", "é2026", "+999999-01-01", "9999-12-31"] {
            assert_eq!(dates_of(wrong), None, "{wrong}");
        }
    }
}
