//! What is known of the colour images beside depth images.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What the colour cameras at the sides sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SideCameraSummary {
    /// Images of the left camera, then of the right.
    #[schema(value_type = Vec<u64>, min_items = 2, max_items = 2)]
    pub n_images: [u64; 2],
    /// Depth images beside which there is one of each camera.
    pub n_paired: u64,
    /// Whether calibration, labels and a labelled first image of both are there, so that the cue `rgb` can be used.
    pub is_usable: bool,
}
