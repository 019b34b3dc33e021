//! The report as FHIR R4 resources: one [`observation`] for each measure, one [`risk_assessment`] for each rule, a
//! [`diagnostic_report`] that groups them, and a [`provenance`] for each assessment that they rest on.
//!
//! Patients are referenced and never inlined. Measures carry a code of this service, and beside it one of LOINC or SNOMED CT
//! only where the standard means the same. A report is `preliminary`: a clinician signs, not the software.

pub mod bundle;
pub mod capability;
pub mod diagnostic_report;
pub mod observation;
pub mod provenance;
pub mod risk_assessment;
pub mod series;

pub use bundle::{Found, report_bundle, searchset};
pub use capability::capability_statement;
pub use provenance::AssessmentOrigin;
pub use series::{SeriesOrigin, series_bundle};

use serde_json::{Value, json};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use uuid::Uuid;

/// System of this service's codes of measures.
pub const MEASURE_SYSTEM: &str = "urn:surefoot:measure";
/// System of this service's codes of definitions that a measure can follow.
pub const DEFINITION_SYSTEM: &str = "urn:surefoot:definition";
/// System of this service's codes of rules.
pub const RULE_SYSTEM: &str = "urn:surefoot:rule";
/// System of this service's codes of reports.
pub const REPORT_SYSTEM: &str = "urn:surefoot:report";
/// Code of the report of a patient.
pub const REPORT_CODE: &str = "patient-report";
/// UCUM.
const UCUM: &str = "http://unitsofmeasure.org";
/// Logical id of the software as a device.
pub const DEVICE_ID: &str = "surefoot";

/// The software as a device.
pub fn device(software_version: &str) -> Value {
    json!({
        "resourceType": "Device",
        "id": DEVICE_ID,
        "status": "active",
        "deviceName": [{"name": "Surefoot", "type": "model-name"}],
        "type": {"text": "Software for the assessment of human movement"},
        "version": [{"value": software_version}],
    })
}

fn reference(kind: &str, id: impl std::fmt::Display) -> Value {
    json!({"reference": format!("{kind}/{id}")})
}

fn patient_reference(patient: Uuid) -> Value {
    json!({"reference": format!("Patient/{patient}"), "type": "Patient"})
}

fn quantity(value: f64, unit: &str) -> Value {
    json!({"value": value, "unit": unit, "system": UCUM, "code": unit})
}

/// A time in the form of FHIR; times that the calendar of the form has no year for do not occur in stored rows.
fn instant(at: OffsetDateTime) -> String {
    at.format(&Rfc3339).unwrap_or_default()
}

/// A logical id from parts that may hold underscores, which FHIR does not allow.
fn logical_id(parts: &[&str]) -> String {
    parts.join("-").replace('_', "-")
}

/// Id of a patient's report.
pub fn report_id(patient: Uuid) -> String {
    logical_id(&["report", &patient.to_string()])
}
