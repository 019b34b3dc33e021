//! How an exercise or a test was performed: repetitions, and what was measured of them.

use super::footfalls::Footfalls;
use crate::body::Side;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How the exercise or test of a recording was performed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Performance {
    /// Id of the protocol, as the catalogue has it; what was declared when the catalogue has no such protocol; null when
    /// nothing was declared.
    pub protocol: Option<String>,
    /// Version of the protocol's rules of measurement; null without a protocol of the catalogue.
    pub protocol_version: Option<u32>,
    /// Whether it could be measured.
    pub status: PerformanceStatus,
    /// Why it was not measured, and what to record next; empty when it was.
    pub reason: String,
    /// Protocols of the catalogue that the movement looks like; empty when it looks like none.
    pub recognized: Vec<String>,
    /// Repetitions by time.
    pub repetitions: Vec<Repetition>,
    /// What was measured over the recording.
    pub measures: Vec<PerformanceMeasure>,
    /// Contacts of the feet, when a walk was measured.
    #[serde(default)]
    pub footfalls: Option<Footfalls>,
}

/// Whether a performance could be measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PerformanceStatus {
    /// It was measured.
    Measured,
    /// The movement is not the protocol's.
    OtherMovement,
    /// The recording does not show enough of it, or no protocol of the catalogue was named.
    NotMeasured,
}

/// One repetition of an exercise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Repetition {
    /// The side that moved; null when both do.
    pub side: Option<Side>,
    /// When the movement began, seconds from the recording's first frame.
    pub start_s: f64,
    /// Middle of the time in which it was nearly as far from where it began as it got (four fifths of the way).
    pub peak_s: f64,
    /// When it had come back.
    pub end_s: f64,
    /// The angle that tells repetitions, for example `left_knee_flexion_deg`.
    pub channel: String,
    /// Smallest and largest value of that angle in the repetition, degrees.
    pub extremes_deg: [f64; 2],
    /// Largest speed of that angle, degrees per second.
    pub peak_velocity_deg_s: f64,
    /// Farthest that the trunk leaned from where it was at the start of the repetition, degrees; null when it was not seen.
    pub trunk_lean_deg: Option<f64>,
    /// Share of the repetition's samples in which the angle was observed, 0 to 1.
    pub coverage: f64,
    /// False when the recording begins or ends within the repetition.
    pub is_complete: bool,
}

/// One measure of a performance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PerformanceMeasure {
    /// The measure; ends in its unit, for example `five_times_sit_to_stand_s`.
    pub name: String,
    /// The side that it is of; null when it is of the whole body.
    pub side: Option<Side>,
    /// The value; null when there is none.
    pub value: Option<f64>,
    /// Standard error of the value, in its unit; null when it is not known.
    pub standard_error: Option<f64>,
    /// Standard deviation of the error of one observation, in the same unit, for measures of variability; null for others, and
    /// when it is not known.
    pub error_sd: Option<f64>,
    /// What it was taken over, for example repetitions, steps or seconds of standing; null when that does not apply.
    pub n_observations: Option<u64>,
    /// Id of the definition that the value follows, where there are several that give different values; null where there is
    /// one.
    #[serde(default)]
    pub definition: Option<String>,
    /// Why there is no value, or what limits it; empty when nothing does.
    pub reason: String,
}
