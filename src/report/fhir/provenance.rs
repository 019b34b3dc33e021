//! What an assessment rests on, as a Provenance: software, method, seed, settings, digest of the recording.

use super::{DEVICE_ID, instant, reference};
use crate::assessment::Provenance;
use serde_json::{Value, json};
use time::OffsetDateTime;
use uuid::Uuid;

/// Where measures come from.
#[derive(Debug, Clone, PartialEq)]
pub struct AssessmentOrigin {
    /// The assessment.
    pub assessment_id: Uuid,
    /// Its recording.
    pub recording_id: Uuid,
    /// When it was stored.
    pub created_at: OffsetDateTime,
    /// What is needed to compute the same bytes again.
    pub provenance: Provenance,
}

/// The Provenance of the Observations of an assessment.
pub fn provenance(origin: &AssessmentOrigin, observations: &[Uuid]) -> Value {
    let AssessmentOrigin { assessment_id, recording_id, created_at, provenance } = origin;
    let targets: Vec<Value> = observations.iter().map(|id| reference("Observation", id)).collect();
    let settings = serde_json::to_string(&provenance.settings).unwrap_or_default();
    let identified = |system: &str, value: &str| json!({"identifier": {"system": system, "value": value}});
    json!({
        "resourceType": "Provenance",
        "id": assessment_id.to_string(),
        "target": targets,
        "recorded": instant(*created_at),
        "activity": {"text": format!("{} by {}", provenance.pipeline, provenance.method)},
        "agent": [{
            "type": {"coding": [{
                "system": "http://terminology.hl7.org/CodeSystem/provenance-participant-type", "code": "assembler",
                "display": "Assembler",
            }]},
            "who": reference("Device", DEVICE_ID),
        }],
        "entity": [
            {"role": "source", "what": identified("urn:surefoot:recording", &recording_id.to_string())},
            {"role": "source", "what": identified("urn:surefoot:recording-sha256", &provenance.recording_sha256)},
            {"role": "source", "what": identified("urn:surefoot:software-version", &provenance.software_version)},
            {"role": "source", "what": identified("urn:surefoot:seed", &provenance.seed.to_string())},
            {"role": "source", "what": identified("urn:surefoot:settings", &settings)},
        ],
    })
}
