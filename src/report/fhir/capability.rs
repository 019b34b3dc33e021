//! What the FHIR endpoints can do.

use super::instant;
use serde_json::{Value, json};
use time::OffsetDateTime;

/// Resources that can be read and searched, and the parameters of their search.
const RESOURCES: [(&str, &[(&str, &str)]); 3] = [
    ("Observation", &[("patient", "reference"), ("date", "date"), ("code", "token")]),
    ("RiskAssessment", &[("patient", "reference"), ("date", "date"), ("code", "token")]),
    ("DiagnosticReport", &[("patient", "reference"), ("date", "date"), ("code", "token")]),
];

/// The CapabilityStatement.
pub fn capability_statement(software_version: &str, at: OffsetDateTime, base: &str) -> Value {
    let resources = RESOURCES.map(|(kind, parameters)| {
        let parameters: Vec<Value> =
            parameters.iter().map(|(name, kind)| json!({"name": name, "type": kind})).collect();
        json!({
            "type": kind,
            "interaction": [{"code": "read"}, {"code": "search-type"}],
            "searchParam": parameters,
        })
    });
    json!({
        "resourceType": "CapabilityStatement",
        "status": "active",
        "date": instant(at),
        "kind": "instance",
        "software": {"name": "Surefoot", "version": software_version},
        "implementation": {"description": "Read-only access to measures, findings and reports", "url": base},
        "fhirVersion": "4.0.1",
        "format": ["application/fhir+json"],
        "rest": [{
            "mode": "server",
            "security": {"description": "An API key of a clinician as a bearer token"},
            "resource": resources,
        }],
    })
}
