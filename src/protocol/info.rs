//! What is known of a protocol before anything is recorded.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A measure of the catalogue: name with its unit, unit (UCUM), what it is.
pub type MeasureSpec = (&'static str, &'static str, &'static str);

/// Whether a protocol trains or tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProtocolKind {
    /// An exercise: angles and counts tell how it was done.
    Exercise,
    /// A test with a published way of scoring.
    Test,
}

/// What a recording must come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProtocolSensor {
    /// A depth camera's skeleton, with or without inertial units.
    Skeleton,
    /// Depth images of the legs behind a walker.
    DepthWalker,
}

/// One exercise or test of the catalogue.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ProtocolInfo {
    /// Name in recordings, for example `five_times_sit_to_stand`.
    pub id: String,
    /// Other names that mean the same.
    pub aliases: Vec<String>,
    /// Version of the rules of measurement; a new one may give other numbers.
    pub version: u32,
    /// Name for people.
    pub title: String,
    /// Whether it trains or tests.
    pub kind: ProtocolKind,
    /// What to do, step by step, at home.
    pub instructions: Vec<String>,
    /// What it must be recorded with.
    pub sensor: ProtocolSensor,
    /// True when it needs a chair.
    pub needs_chair: bool,
    /// Where the camera stands.
    pub view: String,
    /// What is measured.
    pub measures: Vec<ProtocolMeasure>,
    /// How repetitions or holds are found.
    pub method: String,
    /// Rules of fall risk that its measures feed.
    pub fall_risk_rules: Vec<String>,
    /// Where the test is published; empty for an exercise without a source.
    pub source: String,
}

/// One measure of a protocol.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ProtocolMeasure {
    /// Name, ends in the unit.
    pub name: String,
    /// Unit, UCUM.
    pub unit: String,
    /// What it is.
    pub what: String,
}
