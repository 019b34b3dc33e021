//! The report of a patient as a DiagnosticReport.

use super::risk_assessment::risk_assessment_id;
use super::{REPORT_CODE, REPORT_SYSTEM, instant, patient_reference, reference, report_id};
use crate::report::PatientReport;
use serde_json::{Value, json};

/// Extension of FHIR R4 by which a report refers to risk assessments.
const RISK_EXTENSION: &str = "http://hl7.org/fhir/StructureDefinition/diagnosticReport-risk";

/// The DiagnosticReport of a patient's report. Who made it stands in the provenance: R4 has no device that performs one.
pub fn diagnostic_report(report: &PatientReport) -> Value {
    let patient = report.patient.id;
    let risks: Vec<Value> = report
        .findings
        .iter()
        .map(|finding| {
            let risk = reference("RiskAssessment", risk_assessment_id(patient, finding.rule_id));
            json!({"url": RISK_EXTENSION, "valueReference": risk})
        })
        .collect();
    let counts = report.counts;
    let conclusion = format!(
        "Rules: {} positive, {} negative, {} indeterminate, {} unknown, {} not assessable, {} for information. {}",
        counts.positive,
        counts.negative,
        counts.indeterminate,
        counts.unknown,
        counts.not_assessable,
        counts.information,
        report.caution,
    );
    let mut resource = json!({
        "resourceType": "DiagnosticReport",
        "id": report_id(patient),
        "extension": risks,
        // A clinician signs, not the software.
        "status": "preliminary",
        "code": {"coding": [{"system": REPORT_SYSTEM, "code": REPORT_CODE}], "text": "Movement and fall risk"},
        "subject": patient_reference(patient),
        "effectiveDateTime": instant(report.as_of),
        "issued": instant(report.as_of),
        "conclusion": conclusion,
    });
    let results: Vec<Value> = report.measures.iter().map(|measure| reference("Observation", measure.id)).collect();
    if !results.is_empty() {
        resource["result"] = Value::Array(results);
    }
    resource
}
