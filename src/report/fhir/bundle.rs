//! Bundles: a whole report, and the answer to a search.

use super::diagnostic_report::diagnostic_report;
use super::observation::observation;
use super::provenance::{AssessmentOrigin, provenance};
use super::risk_assessment::risk_assessment;
use super::{device, instant};
use crate::report::measure::MeasureSource;
use crate::report::{MeasureRecord, PatientReport};
use serde_json::{Value, json};
use uuid::Uuid;

/// The report of a patient as a collection: device, observations, risk assessments, the report itself, provenance.
pub fn report_bundle(report: &PatientReport, origins: &[AssessmentOrigin], base: &str) -> Value {
    let patient = report.patient.id;
    let of_assessment = |origin: &AssessmentOrigin| {
        let is_of = |m: &&MeasureRecord| matches!(m.source, MeasureSource::Assessment { assessment_id, .. } if assessment_id == origin.assessment_id);
        report.measures.iter().filter(is_of).map(|m| m.id).collect::<Vec<Uuid>>()
    };
    let resources = std::iter::once(device(report.software_version))
        .chain(report.measures.iter().map(|measure| observation(measure, patient)))
        .chain(report.findings.iter().map(|finding| risk_assessment(finding, report)))
        .chain(std::iter::once(diagnostic_report(report)))
        .chain(origins.iter().map(|origin| (origin, of_assessment(origin))).filter_map(|(origin, observations)| {
            (!observations.is_empty()).then(|| provenance(origin, &observations))
        }));
    let entries: Vec<Value> = resources.map(|resource| entry(resource, base)).collect();
    json!({
        "resourceType": "Bundle",
        "type": "collection",
        "timestamp": instant(report.as_of),
        "entry": entries,
    })
}

fn entry(resource: Value, base: &str) -> Value {
    let field = |name: &str| resource[name].as_str().unwrap_or_default().to_owned();
    let url = format!("{base}/{}/{}", field("resourceType"), field("id"));
    json!({"fullUrl": url, "resource": resource})
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Resources of this page.
    pub resources: Vec<Value>,
    /// All that match; none when they were not counted.
    pub total: Option<u64>,
    /// Address of this page.
    pub own_link: String,
    /// Address of the next page; none on the last one.
    pub next_link: Option<String>,
}

/// The answer to a search.
pub fn searchset(found: Found, base: &str) -> Value {
    let entries = found.resources.into_iter().map(|resource| {
        let mut entry = entry(resource, base);
        entry["search"] = json!({"mode": "match"});
        entry
    });
    let entries: Vec<Value> = entries.collect();
    let mut links = vec![json!({"relation": "self", "url": found.own_link})];
    links.extend(found.next_link.map(|url| json!({"relation": "next", "url": url})));
    let mut bundle = json!({"resourceType": "Bundle", "type": "searchset", "link": links});
    if let Some(total) = found.total {
        bundle["total"] = json!(total);
    }
    if !entries.is_empty() {
        bundle["entry"] = Value::Array(entries);
    }
    bundle
}
