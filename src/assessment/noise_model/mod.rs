//! Noise of a sensor and of the movements before it: a named, versioned value that settings refer to and provenance
//! names.
//!
//! A sensor's error has two parts. White noise, new in every frame, is the covariance Σy of the twelve observed points
//! relative to the torso joint (\[angles\], likelihood). A slow offset stays as long as the posture does; averaging over
//! time does not take it away. Beside them stands how far joints turn from frame to frame, the diagonal Σθ (\[angles\],
//! prior).
//!
//! Models stand here and not in the pipeline because whoever asks for an assessment, and whoever stores one, must know
//! them by name. They are trained in the pipeline.

mod document;
mod name;
mod shipped;
mod table1;

pub use document::{
    InvalidNoiseModel, NoiseModelDocument, PointNoise, TrainingRecord, TrainingSource, TransitionNoise,
};
pub use name::{InvalidNoiseModelName, NoiseModelName, is_model_name};
pub use shipped::{find_shipped, nite_table1, shipped};

use crate::body::pose::PoseVector;
use crate::body::{OBSERVATION_DIMENSION, POINT_COUNT};
use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

/// Name of the noise that is estimated from the recording itself.
pub const ADAPTIVE: &str = "adaptive";
/// Name of the model of \[angles\] Table 1.
pub const NITE_TABLE1: &str = "nite-table1";

/// Covariance of the observation vector y, m².
pub type ObservationCovariance = SMatrix<f64, OBSERVATION_DIMENSION, OBSERVATION_DIMENSION>;

/// A sound noise model: its document, and the matrices that computations take.
///
/// It can only be made of a document that describes one: finite, plausible, Σy positive definite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "NoiseModelDocument", into = "NoiseModelDocument")]
pub struct NoiseModel {
    document: NoiseModelDocument,
    /// Standard deviation of each element of θ from one frame to the next at 30 Hz, radians (Σθ is diagonal).
    pub transition_sd: PoseVector,
    /// Covariance Σy of y in the sensor's axes (x and y in the image, z in depth), m².
    pub observation: ObservationCovariance,
    /// Standard deviation of the slow offset of each point's coordinates, metres.
    pub slow_offset: [f64; POINT_COUNT],
}

impl NoiseModel {
    /// The model as it is written down.
    pub fn document(&self) -> &NoiseModelDocument {
        &self.document
    }

    /// Name and version.
    pub fn name(&self) -> NoiseModelName {
        NoiseModelName { name: self.document.name.clone(), version: Some(self.document.version) }
    }

    /// The same model under another version number.
    #[must_use]
    pub fn with_version(mut self, version: u32) -> Self {
        self.document.version = version;
        self
    }

    /// SHA-256 of the document as compact JSON, lower-case hexadecimal: the same digest, the same numbers.
    ///
    /// # Panics
    /// Never: a document of finite numbers and texts is always JSON.
    pub fn sha256(&self) -> String {
        let bytes = serde_json::to_vec(&self.document).expect("a document of numbers and texts is always JSON");
        hex::encode(Sha256::digest(bytes))
    }

    /// What an assessment says of the model it used.
    pub fn reference(&self) -> NoiseModelReference {
        NoiseModelReference {
            name: self.document.name.clone(),
            version: Some(self.document.version),
            sha256: Some(self.sha256()),
        }
    }
}

/// The noise that an assessment rests on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct NoiseModelReference {
    /// Name of the model; `adaptive` when noise was estimated from the recording itself.
    pub name: String,
    /// Version of the model; null for `adaptive`, which follows the software's version.
    #[schema(minimum = 1)]
    pub version: Option<u32>,
    /// SHA-256 of the model's document as compact JSON, lower-case hexadecimal; null for `adaptive`.
    pub sha256: Option<String>,
}

impl NoiseModelReference {
    /// Noise estimated from the recording itself.
    pub fn adaptive() -> Self {
        Self { name: ADAPTIVE.to_owned(), version: None, sha256: None }
    }
}

#[cfg(test)]
mod tests;
