//! What was found of somebody's gait: contacts and steps.

use crate::body::Side;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Definition id: distance of the ankle centres halfway through a double support.
pub const ANKLES_AT_MID_DOUBLE_SUPPORT: &str = "ankle_to_ankle_mid_double_support";
/// Definition id: distance of two footprints, each taken where the ankle stands over the flat foot, along the direction of
/// walking; the width is a footprint's distance from the line through the other foot's prints before and after it.
pub const FLAT_FOOTPRINTS: &str = "footprint_to_footprint_flat_foot";

/// What was found of somebody's gait.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct Gait {
    /// Every step that was found, by time, also those that the means leave out.
    pub steps: Vec<Step>,
    /// Steps that the means rest on.
    pub n_steps_used: u64,
    /// Steps that are left out, by reason; a step with two reasons counts under both.
    pub excluded: Vec<ExcludedSteps>,
    /// Mean and spread over the steps used, by definition; none without two steps.
    pub summary: Vec<StepSummary>,
    /// Share of the walking time with both feet on the floor, 0 to 1; null without walking.
    pub double_support_share: Option<f64>,
    /// Steps per minute over the steps used; null with fewer than two.
    pub cadence_per_min: Option<f64>,
    /// Time without steps before, between and after walks, seconds.
    pub standing_s: f64,
}

/// One step: a foot lands ahead of the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = GaitStep)]
pub struct Step {
    /// The foot that landed.
    pub side: Side,
    /// When it had left the floor, seconds from the first frame.
    pub toe_off_s: f64,
    /// When it landed, seconds from the first frame.
    pub heel_strike_s: f64,
    /// When the other foot left the floor, seconds from the first frame; null at the end of a walk.
    pub opposite_toe_off_s: Option<f64>,
    /// Time since the other foot landed, seconds; null for the first step of a walk.
    pub step_time_s: Option<f64>,
    /// Length and width, by definition.
    pub measures: Vec<StepMeasure>,
    /// Share of the step's frames in which both lower legs were seen, 0 to 1.
    pub coverage: f64,
    /// True when the walk goes backwards.
    pub backward: bool,
    /// Why the means leave the step out: `first_or_last`, `turning`, `low_coverage`, `missed_contact`; empty when they do
    /// not.
    pub excluded_because: Vec<String>,
}

/// Length and width of a step by one definition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StepMeasure {
    /// The definition: `ankle_to_ankle_mid_double_support` or `footprint_to_footprint_flat_foot`. Values of different
    /// definitions are not comparable.
    pub definition: String,
    /// How far the foot landed ahead of the other along the direction of walking, metres; negative when behind it.
    pub length_m: f64,
    /// 95 % interval of the length.
    pub length_interval_m: [f64; 2],
    /// How far the feet are apart across the direction of walking, metres; negative when they cross.
    pub width_m: f64,
    /// 95 % interval of the width.
    pub width_interval_m: [f64; 2],
}

/// Mean and spread of a definition over the steps used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StepSummary {
    /// The definition.
    pub definition: String,
    /// Steps.
    pub n_steps: u64,
    /// Mean length, metres.
    pub length_mean_m: f64,
    /// Standard deviation of the lengths (n − 1), metres, each side about its own mean.
    pub length_sd_m: f64,
    /// Mean width, metres.
    pub width_mean_m: f64,
    /// Standard deviation of the widths (n − 1), metres, each side about its own mean.
    pub width_sd_m: f64,
}

/// Steps that were left out for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ExcludedSteps {
    /// `first_or_last`, `turning`, `low_coverage` or `missed_contact`.
    pub reason: String,
    /// Steps.
    pub n_steps: u64,
}
