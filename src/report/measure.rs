//! A measured value of a patient, and what kind of measure it is: title, unit, codes.

use crate::body::Side;
use crate::fall_risk::Measured;
use serde::Serialize;
use time::OffsetDateTime;
use utoipa::ToSchema;
use uuid::Uuid;

/// One value that was measured of a patient.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct MeasureRecord {
    /// Identity.
    pub id: Uuid,
    /// What was measured; ends in its unit.
    pub name: String,
    /// The same for a person.
    pub title: String,
    /// The side that it is of; null for the whole body.
    pub side: Option<Side>,
    /// The value.
    pub value: f64,
    /// UCUM unit of the value.
    pub unit: String,
    /// Standard error of the value, in its unit; null when it is not known.
    pub standard_error: Option<f64>,
    /// Observations that it rests on.
    pub n_observations: Option<u32>,
    /// Standard deviation of the error of one observation, for measures of variability.
    pub error_sd: Option<f64>,
    /// Definition that the value follows, where there are several; values of different definitions are not comparable.
    pub definition: Option<String>,
    /// The exercise or test.
    pub protocol: Option<String>,
    /// What limits the value; empty when nothing does.
    pub reason: String,
    /// Where it is from.
    pub source: MeasureSource,
    /// When it was measured.
    #[serde(with = "time::serde::rfc3339")]
    pub measured_at: OffsetDateTime,
    /// When it was stored.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
}

/// Where a value is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MeasureSource {
    /// An assessment of a recording.
    Assessment {
        /// The assessment.
        assessment_id: Uuid,
        /// Its recording.
        recording_id: Uuid,
        /// The recording's session.
        session_id: Uuid,
    },
    /// Entered by a person.
    Entered {
        /// The measurement.
        measurement_id: Uuid,
    },
}

impl MeasureRecord {
    /// The value as rules take it.
    pub fn measured(&self) -> Measured {
        Measured {
            value: self.value,
            standard_error: self.standard_error,
            n_observations: self.n_observations,
            error_sd: self.error_sd,
        }
    }
}

/// A code of a coding system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// The system's URI.
    pub system: &'static str,
    /// The code.
    pub code: &'static str,
    /// What the system calls it.
    pub display: &'static str,
}

/// LOINC.
pub const LOINC: &str = "http://loinc.org";
/// SNOMED CT.
pub const SNOMED: &str = "http://snomed.info/sct";

/// What kind of measure a name stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasureKind {
    /// Name in assessments and at the API.
    pub name: &'static str,
    /// Name for a person.
    pub title: &'static str,
    /// UCUM unit.
    pub unit: &'static str,
    /// Codes beside the local one. None is claimed where the standard's meaning is narrower than the measure.
    pub codes: &'static [Code],
}

const GAIT_SPEED: Code = Code { system: SNOMED, code: "724237005", display: "Gait speed" };
const WALK_4_M: Code = Code { system: LOINC, code: "83144-6", display: "4 meter walk test" };

const fn kind(name: &'static str, title: &'static str, unit: &'static str) -> MeasureKind {
    MeasureKind { name, title, unit, codes: &[] }
}

/// Measures with a title of their own, in the order of a report. Others are titled by their names.
pub static MEASURE_KINDS: &[MeasureKind] = &[
    MeasureKind { codes: &[GAIT_SPEED], ..kind("usual_speed_mps", "Walking speed, usual", "m/s") },
    MeasureKind { codes: &[GAIT_SPEED], ..kind("highest_speed_mps", "Walking speed, highest", "m/s") },
    kind("five_times_sit_to_stand_s", "Five-times sit-to-stand", "s"),
    kind("chair_stands_30_s", "Chair stands in 30 s", "1"),
    kind("alternate_step_s", "Alternate step test", "s"),
    kind("near_tandem_hold_s", "Near tandem stand", "s"),
    kind("side_by_side_hold_s", "Side-by-side stand", "s"),
    kind("semi_tandem_hold_s", "Semi-tandem stand", "s"),
    kind("tandem_hold_s", "Tandem stand", "s"),
    kind("timed_up_and_go_s", "Timed up and go", "s"),
    MeasureKind { codes: &[WALK_4_M], ..kind("walk_4_m_s", "Walk of four metres", "s") },
    kind("step_length_m", "Step length", "m"),
    kind("step_width_m", "Step width", "m"),
    kind("stride_length_m", "Stride length", "m"),
    kind("step_time_s", "Step time", "s"),
    kind("stride_time_s", "Stride time", "s"),
    kind("cadence_spm", "Cadence", "{steps}/min"),
    kind("double_support_pct", "Double support", "%"),
    kind("stance_pct", "Stance", "%"),
    kind("swing_pct", "Swing", "%"),
    kind("step_length_sd_m", "Variability of step length", "m"),
    kind("step_width_sd_m", "Variability of step width", "m"),
    kind("step_time_sd_s", "Variability of step time", "s"),
    kind("stride_time_sd_s", "Variability of stride time", "s"),
    kind("swing_time_sd_s", "Variability of swing time", "s"),
];

/// The kind that a name has in [`MEASURE_KINDS`].
pub fn kind_of(name: &str) -> Option<&'static MeasureKind> {
    MEASURE_KINDS.iter().find(|kind| kind.name == name)
}

/// Title of a measure for a person.
pub fn title_of(name: &str) -> String {
    if let Some(kind) = kind_of(name) {
        return kind.title.to_owned();
    }
    let bare = UNITS.iter().find_map(|(suffix, _)| name.strip_suffix(suffix)).unwrap_or(name);
    let mut title = bare.replace('_', " ");
    if let Some(first) = title.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    title
}

/// UCUM unit of a measure, by the end of its name.
pub fn unit_of(name: &str) -> &'static str {
    let by_suffix = || UNITS.iter().find(|(suffix, _)| name.ends_with(suffix)).map_or("1", |(_, unit)| *unit);
    kind_of(name).map_or_else(by_suffix, |kind| kind.unit)
}

/// Ends of names and the UCUM units that they stand for; a longer one before a shorter one that it ends in.
const UNITS: &[(&str, &str)] = &[
    ("_deg_s", "deg/s"),
    ("_mps", "m/s"),
    ("_spm", "{steps}/min"),
    ("_per_min", "/min"),
    ("_pct", "%"),
    ("_deg", "deg"),
    ("_m2", "m2"),
    ("_ratio", "1"),
    ("_count", "1"),
    ("_m", "m"),
    ("_s", "s"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_tells_its_unit_and_a_title_is_readable() {
        assert_eq!((unit_of("usual_speed_mps"), unit_of("chair_stands_30_s")), ("m/s", "1"));
        assert_eq!((unit_of("peak_velocity_deg_s"), unit_of("trunk_sway_area_m2")), ("deg/s", "m2"));
        assert_eq!(title_of("trunk_sway_path_m"), "Trunk sway path");
        assert_eq!(title_of("step_width_m"), "Step width");
        assert_eq!(title_of(""), "");
    }

    #[test]
    fn every_kind_has_a_unit_that_its_name_ends_in_or_says_otherwise_on_purpose() {
        for kind in MEASURE_KINDS.iter().filter(|kind| kind.name != "chair_stands_30_s") {
            let by_name = UNITS.iter().find(|(suffix, _)| kind.name.ends_with(suffix)).map(|(_, unit)| *unit);
            assert_eq!(by_name, Some(kind.unit), "{}", kind.name);
        }
    }
}
