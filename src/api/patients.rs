//! Patients: known by a pseudonym only.

use super::auth::Clinician;
use super::error::ApiError;
use super::etag::tagged_json;
use super::page::{DEFAULT_LIMIT, Page, PageLink, id_from_cursor};
use super::request::{ApiJson, ApiPath, ApiQuery};
use super::state::AppState;
use super::text;
use crate::storage::{NewPatient, PageRequest, Patient, PatientFilter, PatientId, Sex};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use garde::Validate;
use serde::{Deserialize, Deserializer, Serialize};
use time::OffsetDateTime;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create_patient, list_patients)).routes(routes!(read_patient, update_patient))
}

/// A patient to be made. Nothing here may identify a person.
#[derive(Debug, Clone, Deserialize, Validate, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PatientRequest {
    /// Code of the patient, unique in the organisation; not a name.
    #[garde(custom(text::pseudonym))]
    #[schema(pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", example = "P-017")]
    pub pseudonym: String,
    /// Year of birth.
    #[garde(range(min = 1900, max = 2100))]
    #[schema(minimum = 1900, maximum = 2100, example = 1948)]
    pub birth_year: Option<u16>,
    /// Sex, as reference values distinguish it.
    #[garde(skip)]
    pub sex: Option<Sex>,
    /// Stature, metres.
    #[garde(range(min = 0.5, max = 2.5))]
    #[schema(minimum = 0.5, maximum = 2.5, example = 1.68)]
    pub height_m: Option<f64>,
    /// Whether the patient walks with an aid.
    #[garde(skip)]
    pub uses_walking_aid: Option<bool>,
}

/// Changes to a patient. A field that is absent stays; null clears it.
#[derive(Debug, Clone, Default, Deserialize, Validate, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PatientPatch {
    /// Code of the patient, unique in the organisation; not a name.
    #[serde(deserialize_with = "present")]
    #[garde(custom(text::optional_pseudonym))]
    #[schema(value_type = String, pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", required = false)]
    pub pseudonym: Option<String>,
    /// Year of birth.
    #[serde(deserialize_with = "present")]
    #[garde(inner(range(min = 1900, max = 2100)))]
    #[schema(value_type = Option<u16>, minimum = 1900, maximum = 2100)]
    pub birth_year: Option<Option<u16>>,
    /// Sex, as reference values distinguish it.
    #[serde(deserialize_with = "present")]
    #[garde(skip)]
    #[schema(value_type = Option<Sex>)]
    pub sex: Option<Option<Sex>>,
    /// Stature, metres.
    #[serde(deserialize_with = "present")]
    #[garde(inner(range(min = 0.5, max = 2.5)))]
    #[schema(value_type = Option<f64>, minimum = 0.5, maximum = 2.5)]
    pub height_m: Option<Option<f64>>,
    /// Whether the patient walks with an aid.
    #[serde(deserialize_with = "present")]
    #[garde(skip)]
    #[schema(value_type = Option<bool>)]
    pub uses_walking_aid: Option<Option<bool>>,
}

/// Tells a field that is there (even as null) from one that is not.
fn present<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// A patient.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct PatientResponse {
    /// Identity.
    pub id: PatientId,
    /// Code of the patient, unique in the organisation.
    pub pseudonym: String,
    /// Year of birth.
    pub birth_year: Option<u16>,
    /// Sex.
    pub sex: Option<Sex>,
    /// Stature, metres.
    pub height_m: Option<f64>,
    /// Whether the patient walks with an aid.
    pub uses_walking_aid: Option<bool>,
    /// When the patient was made known.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

impl From<Patient> for PatientResponse {
    fn from(patient: Patient) -> Self {
        let Patient { id, pseudonym, birth_year, sex, height_m, uses_walking_aid, created_at } = patient;
        Self { id, pseudonym, birth_year, sex, height_m, uses_walking_aid, created_at }
    }
}

/// Address of one patient.
#[derive(Debug, Clone, Copy, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct PatientPath {
    /// The patient.
    #[param(value_type = String, format = Uuid)]
    pub id: PatientId,
}

/// Which patients are wanted.
#[derive(Debug, Clone, Deserialize, Validate, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct PatientsQuery {
    /// Items of a page.
    #[garde(range(min = 1, max = 200))]
    #[param(minimum = 1, maximum = 200, default = 50)]
    pub limit: Option<u32>,
    /// Where the page begins; taken from `next` of the page before.
    #[garde(skip)]
    #[param(pattern = "^[A-Za-z0-9_-]{22}$")]
    pub cursor: Option<String>,
    /// How the pseudonym begins; upper and lower case differ.
    #[garde(custom(text::optional_pseudonym))]
    #[param(pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    pub pseudonym_prefix: Option<String>,
}

/// Make a patient known
#[utoipa::path(post, path = "/v1/patients", tag = "patients", operation_id = "create_patient",
    security(("api_key" = ["clinician"])),
    request_body = PatientRequest,
    responses((status = 201, description = "Made; Location says where it lives", body = PatientResponse),
              (status = 409, description = "The pseudonym is taken", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn create_patient(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiJson(request): ApiJson<PatientRequest>,
) -> Result<Response, ApiError> {
    let PatientRequest { pseudonym, birth_year, sex, height_m, uses_walking_aid } = request;
    let new = NewPatient { pseudonym, birth_year, sex, height_m, uses_walking_aid };
    let patient = state.store.create_patient(&caller.access, &new).await?;
    let location = format!("/v1/patients/{}", patient.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(PatientResponse::from(patient))).into_response())
}

/// List patients
///
/// Newest first, in pages.
#[utoipa::path(get, path = "/v1/patients", tag = "patients", operation_id = "list_patients",
    security(("api_key" = ["clinician"])), params(PatientsQuery),
    responses((status = 200, description = "One page", body = Page<PatientResponse>)))]
async fn list_patients(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiQuery(query): ApiQuery<PatientsQuery>,
) -> Result<Json<Page<PatientResponse>>, ApiError> {
    let limit = query.limit.unwrap_or(DEFAULT_LIMIT);
    let wanted = PageRequest { after: id_from_cursor(query.cursor.as_deref())?.map(PatientId), limit };
    let link = PageLink::new("/v1/patients", limit, &[("pseudonym_prefix", query.pseudonym_prefix.clone())]);
    let filter = PatientFilter { pseudonym_prefix: query.pseudonym_prefix, ..PatientFilter::default() };
    let found = state.store.patients(&caller.access, &filter, &wanted).await?;
    Ok(Json(Page::from_stored(found, &link, |id| id.0, PatientResponse::from)))
}

/// Read a patient
#[utoipa::path(get, path = "/v1/patients/{id}", tag = "patients", operation_id = "read_patient",
    security(("api_key" = ["clinician"])), params(PatientPath),
    responses((status = 200, description = "The patient", body = PatientResponse),
              (status = 304, description = "Not changed since the ETag in If-None-Match")))]
async fn read_patient(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let patient = state.store.patient(&caller.access, path.id).await?;
    Ok(tagged_json(&headers, &PatientResponse::from(patient)))
}

/// Change a patient
///
/// Fields that are absent stay; null clears a field.
#[utoipa::path(patch, path = "/v1/patients/{id}", tag = "patients", operation_id = "update_patient",
    security(("api_key" = ["clinician"])),
    params(PatientPath), request_body = PatientPatch,
    responses((status = 200, description = "The patient as it is after the change", body = PatientResponse),
              (status = 409, description = "The pseudonym is taken", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn update_patient(
    State(state): State<AppState>,
    Clinician(caller): Clinician,
    ApiPath(path): ApiPath<PatientPath>,
    ApiJson(patch): ApiJson<PatientPatch>,
) -> Result<Json<PatientResponse>, ApiError> {
    let changed = state.store.update_patient(&caller.access, path.id, |patient| {
        if let Some(pseudonym) = &patch.pseudonym {
            patient.pseudonym.clone_from(pseudonym);
        }
        patient.birth_year = patch.birth_year.unwrap_or(patient.birth_year);
        patient.sex = patch.sex.unwrap_or(patient.sex);
        patient.height_m = patch.height_m.unwrap_or(patient.height_m);
        patient.uses_walking_aid = patch.uses_walking_aid.unwrap_or(patient.uses_walking_aid);
    });
    Ok(Json(changed.await?.into()))
}
