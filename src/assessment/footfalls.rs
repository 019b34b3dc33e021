//! Where and when feet came down in a walk, and what limits what is made of that.

use super::performance::PerformanceMeasure;
use crate::body::Side;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The contacts of a walk, and what limits what is made of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct Footfalls {
    /// Every contact, by time.
    pub contacts: Vec<GaitContact>,
    /// Measures over every step, also those that are left out: the first and last of a walk, and turns. A short walk has no
    /// other; the rules of fall risk do not take them.
    pub measures_of_all_steps: Vec<PerformanceMeasure>,
    /// Steps that were left out, by reason.
    pub exclusions: Vec<StepExclusionCount>,
    /// Measures outside their plausible limits; they are kept.
    pub flags: Vec<GaitFlag>,
    /// Why nothing, or not everything, was found; empty when everything was.
    pub reason: String,
}

/// A foot that came down: what every measure of gait is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GaitContact {
    /// The foot that came down.
    pub side: Side,
    /// Its initial contact, seconds from the recording's first frame.
    pub contact_s: f64,
    /// The terminal contact before it: when this foot had left the floor to come here; null when that was not seen.
    pub toe_off_s: Option<f64>,
    /// Where it stood on the floor: `x` and `z` of the recording's `world`, turned so that the floor is level, metres; null
    /// when that was not seen, or when the sensor moved.
    pub place_m: Option<[f64; 2]>,
    /// The walk that it belongs to, from 0: a walk ends where somebody stands, turns back or was not seen.
    pub walk: u64,
    /// Share of the frames since the contact before in which pelvis and both feet were seen, 0 to 1.
    pub coverage: f64,
    /// True when the direction of walking changes with this step.
    pub is_turning: bool,
    /// Why the means leave the step out that ends with this contact; empty when they do not.
    pub excluded_because: Vec<StepExclusion>,
}

impl GaitContact {
    /// A contact of the first walk that was fully seen, on a straight way.
    pub fn new(side: Side, contact_s: f64, place_m: [f64; 2]) -> Self {
        Self {
            side,
            contact_s,
            toe_off_s: None,
            place_m: Some(place_m),
            walk: 0,
            coverage: 1.0,
            is_turning: false,
            excluded_because: Vec::new(),
        }
    }
}

/// Why a step does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepExclusion {
    /// One of the first or last two steps of a walk.
    FirstOrLast,
    /// Part of a turn.
    Turning,
    /// Seen in less than 80 % of its frames.
    LowCoverage,
    /// The foot before it was the same, or the contact before it was not seen.
    MissedContact,
}

impl StepExclusion {
    /// Every reason.
    pub const ALL: [StepExclusion; 4] =
        [StepExclusion::FirstOrLast, StepExclusion::Turning, StepExclusion::LowCoverage, StepExclusion::MissedContact];

    /// The reason of a name, as [`Gait`](super::Gait) writes it.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "first_or_last" => Some(StepExclusion::FirstOrLast),
            "turning" => Some(StepExclusion::Turning),
            "low_coverage" => Some(StepExclusion::LowCoverage),
            "missed_contact" => Some(StepExclusion::MissedContact),
            _ => None,
        }
    }
}

/// Steps that were left out for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StepExclusionCount {
    /// The reason.
    pub reason: StepExclusion,
    /// Steps; one with two reasons counts under both.
    pub n_steps: u64,
}

/// A measure outside its plausible limits. People with a walking aid may be outside them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GaitFlag {
    /// Name of the measure.
    pub measure: String,
    /// The side that it is of; null when of both.
    pub side: Option<Side>,
    /// Its value.
    pub value: f64,
    /// Lowest plausible value, in the unit of the measure's name.
    pub low: f64,
    /// Highest plausible value.
    pub high: f64,
    /// Where the limits come from.
    pub citation: String,
}
