//! A measure as an Observation.

use super::{DEFINITION_SYSTEM, DEVICE_ID, MEASURE_SYSTEM, instant, patient_reference, quantity, reference};
use crate::body::Side;
use crate::report::measure::{MeasureRecord, MeasureSource, SNOMED, kind_of};
use serde_json::{Value, json};
use uuid::Uuid;

/// Half the width of a 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_985;

/// The Observation of a measure.
pub fn observation(measure: &MeasureRecord, patient: Uuid) -> Value {
    let local = json!({"system": MEASURE_SYSTEM, "code": measure.name, "display": measure.title});
    let standard = kind_of(&measure.name).map_or(&[][..], |kind| kind.codes);
    let standard = standard.iter().map(|c| json!({"system": c.system, "code": c.code, "display": c.display}));
    let coding: Vec<Value> = std::iter::once(local).chain(standard).collect();
    let mut resource = json!({
        "resourceType": "Observation",
        "id": measure.id.to_string(),
        "status": "final",
        "category": [{"coding": [{
            "system": "http://terminology.hl7.org/CodeSystem/observation-category", "code": "exam", "display": "Exam",
        }]}],
        "code": {"coding": coding, "text": measure.title},
        "subject": patient_reference(patient),
        "effectiveDateTime": instant(measure.measured_at),
        "issued": instant(measure.created_at),
        "valueQuantity": quantity(measure.value, &measure.unit),
    });
    if matches!(measure.source, MeasureSource::Assessment { .. }) {
        resource["device"] = reference("Device", DEVICE_ID);
    }
    if let Some(side) = measure.side {
        let (code, display) = match side {
            Side::Left => ("7771000", "Left"),
            Side::Right => ("24028007", "Right"),
        };
        let coding = json!([{"system": SNOMED, "code": code, "display": display}]);
        resource["bodySite"] = json!({"coding": coding, "text": format!("{display} side")});
    }
    if let Some(definition) = &measure.definition {
        resource["method"] = json!({"coding": [{"system": DEFINITION_SYSTEM, "code": definition}], "text": definition});
    }
    if !measure.reason.is_empty() {
        resource["note"] = json!([{"text": measure.reason}]);
    }
    let components = components(measure);
    if !components.is_empty() {
        resource["component"] = Value::Array(components);
    }
    resource
}

/// What is known of the value's error, and what it rests on.
fn components(measure: &MeasureRecord) -> Vec<Value> {
    let mut components = Vec::new();
    if let Some(se) = measure.standard_error.filter(|se| *se > 0.0) {
        let ends = [measure.value - Z95 * se, measure.value + Z95 * se].map(|end| quantity(end, &measure.unit));
        components.push(json!({
            "code": {"coding": [{"system": MEASURE_SYSTEM, "code": "interval-95"}], "text": "95 % interval"},
            "valueRange": {"low": ends[0], "high": ends[1]},
        }));
    }
    if let Some(n) = measure.n_observations {
        components.push(json!({
            "code": {"coding": [{"system": MEASURE_SYSTEM, "code": "n-observations"}], "text": "Observations"},
            "valueInteger": n.min(i32::MAX as u32),
        }));
    }
    components
}
