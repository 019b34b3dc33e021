//! What is needed to compute the same bytes again.

use super::noise_model::NoiseModelReference;
use super::settings::Settings;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// Origin of an assessment. The same recording, version, settings and seed give the same bytes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct Provenance {
    /// Version of Surefoot.
    pub software_version: String,
    /// The pipeline.
    pub pipeline: String,
    /// The method within the pipeline.
    pub method: String,
    /// All settings, defaults filled in.
    pub settings: Settings,
    /// The noise model that the result rests on; null for a method that has none.
    #[serde(default)]
    pub noise_model: Option<NoiseModelReference>,
    /// The assessment whose calibration the result also rests on, when the settings ask for the patient's.
    #[serde(default)]
    pub patient_assessment_id: Option<Uuid>,
    /// Seed of the random streams.
    pub seed: u64,
    /// SHA-256 of the uploaded bytes, lower-case hexadecimal; empty when the recording did not come from bytes.
    pub recording_sha256: String,
}
