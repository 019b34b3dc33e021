//! A rule's finding as a RiskAssessment.

use super::{DEVICE_ID, RULE_SYSTEM, instant, logical_id, patient_reference, quantity, reference};
use crate::fall_risk::{Finding, Status};
use crate::report::{MeasureRecord, PatientReport};
use serde_json::{Value, json};
use uuid::Uuid;

/// Id of a rule's finding in a patient.
pub fn risk_assessment_id(patient: Uuid, rule_id: &str) -> String {
    logical_id(&[&patient.to_string(), rule_id])
}

/// The RiskAssessment of a finding.
pub fn risk_assessment(finding: &Finding, report: &PatientReport) -> Value {
    let rule = format!("{}/{}", finding.rule_id, finding.rule_version);
    let status = finding.status.map_or("information", Status::name);
    let mut prediction = json!({
        "outcome": {"text": "Falls"},
        "qualitativeRisk": {"coding": [{"system": "urn:surefoot:status", "code": status}], "text": status},
        "rationale": finding.reason,
    });
    if let Some([low, high]) = finding.probability {
        let percent = |share: f64| (share * 1000.0).round() / 10.0;
        if low == high {
            prediction["probabilityDecimal"] = json!(percent(low));
        } else {
            let ends = [low, high].map(|share| quantity(percent(share), "%"));
            prediction["probabilityRange"] = json!({"low": ends[0], "high": ends[1]});
        }
    }
    let mut notes = vec![
        format!("Source: {}. Evidence: {}.", finding.citation, finding.evidence.name()),
        format!("Accuracy of the tool: {}.", finding.accuracy),
    ];
    if let Some(category) = &finding.category {
        notes.push(format!("Category: {category}."));
    }
    if finding.population_match != Some(true) {
        notes.push("The person is not known to be of the population that the rule was developed on.".to_owned());
    }
    let notes: Vec<Value> = notes.into_iter().map(|text| json!({"text": text})).collect();
    let mut resource = json!({
        "resourceType": "RiskAssessment",
        "id": risk_assessment_id(report.patient.id, finding.rule_id),
        "status": "preliminary",
        "method": {"coding": [{"system": RULE_SYSTEM, "code": finding.rule_id, "version": finding.rule_version.to_string()}],
                   "text": rule},
        "code": {"coding": [{"system": RULE_SYSTEM, "code": finding.rule_id}]},
        "subject": patient_reference(report.patient.id),
        "occurrenceDateTime": instant(report.as_of),
        "performer": reference("Device", DEVICE_ID),
        "prediction": [prediction],
        "note": notes,
    });
    let basis: Vec<Value> = basis(finding, report).map(|id| reference("Observation", id)).collect();
    if !basis.is_empty() {
        resource["basis"] = Value::Array(basis);
    }
    resource
}

/// The measures that a rule looks at, of those that there are.
fn basis<'a>(finding: &'a Finding, report: &'a PatientReport) -> impl Iterator<Item = Uuid> + 'a {
    let looked_at = |m: &&MeasureRecord| m.side.is_none() && finding.measures.contains(&m.name.as_str());
    report.measures.iter().filter(looked_at).map(|m| m.id)
}
