//! How camera and inertial units were brought together, and how far that can be trusted.

use crate::recording::Segment;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Quality of a fusion.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct FusionQuality {
    /// Each unit that was used.
    pub units: Vec<UnitQuality>,
    /// Second of the recording from which on the units were worn; the result begins there.
    pub worn_from_s: f64,
    /// First and last second in which the units lay together on the plank, when they did.
    pub plank_s: Option<[f64; 2]>,
    /// First and last second in which the person stood still, from which the zero of hinges was taken; null without one.
    pub standing_s: Option<[f64; 2]>,
    /// Second of the frame that the reference skeleton was taken from, with the method `hierarchy`.
    pub reference_frame_s: Option<f64>,
    /// Tilt of the camera against gravity, degrees, as the units see it; null without a camera.
    pub camera_tilt_deg: Option<f64>,
    /// Samples per second of the result.
    pub rate_hz: f64,
}

/// How one unit was brought together with the camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UnitQuality {
    /// The segment that it was worn on.
    pub segment: Segment,
    /// Its clock beside the camera's.
    pub clock: ClockQuality,
    /// What the mounting started from: `scheme`, or `movement` alone.
    pub mounting: String,
    /// Angle between the mounting that was found and the scheme's, degrees.
    pub off_scheme_deg: f64,
    /// Standard deviation of the mounting about the segment's axes X (forward), Y (along the limb) and Z, degrees.
    pub mounting_sd_deg: [f64; 3],
    /// Largest standard deviation of the heading, degrees.
    pub heading_sd_deg: f64,
    /// How far the heading drifted from its first to its last point, degrees.
    pub heading_drift_deg: f64,
    /// Share of the result's samples that the unit has data for, 0 to 1.
    pub coverage: f64,
    /// Root mean square angle between the camera's and the unit's direction of the segment, degrees; null where the camera
    /// never saw it.
    pub disagreement_deg: Option<f64>,
}

/// A unit's clock: `camera = unit + offset_s + drift_ppm · 10⁻⁶ · (unit − reference_s)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClockQuality {
    /// What showed it: `jumps`, `movement`, or `declared` when the clock was taken as the recording gives it.
    pub evidence: String,
    /// To be added to the unit's clock at `reference_s`, seconds.
    pub offset_s: f64,
    /// Standard deviation of the offset, seconds; null when it was not estimated.
    pub offset_sd_s: Option<f64>,
    /// By how much the unit's clock is slow, parts per million.
    pub drift_ppm: f64,
    /// Standard deviation of the drift; null when it was not estimated.
    pub drift_sd_ppm: Option<f64>,
    /// Root mean square by which single stretches of the recording differ from this map, seconds; null when it was not
    /// estimated.
    pub residual_s: Option<f64>,
    /// Time of the unit's clock at which the offset holds, seconds.
    pub reference_s: f64,
}
