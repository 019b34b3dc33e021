//! How a measure changed over time, and whether that is more than its error.
//!
//! ```text
//! MDC95 = 1.96 · √2 · SEM
//! ```
//!
//! A difference below the minimal detectable change is not a change. Where the two values bring their own standard errors,
//! `1.96 · √(se₁² + se₂²)` is at least asked for; a published limit counts where it is larger, since it also holds what a person
//! varies from day to day.

use super::measure::{MeasureRecord, title_of, unit_of};
use crate::body::Side;
use crate::fall_risk::{ChangeInfo, change_rule_of};
use serde::Serialize;
use time::OffsetDateTime;
use utoipa::ToSchema;
use uuid::Uuid;

/// Half the width of a 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_985;

/// A measure over time.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Trend {
    /// What was measured.
    pub name: String,
    /// The same for a person.
    pub title: String,
    /// The side that it is of; null for the whole body.
    pub side: Option<Side>,
    /// UCUM unit.
    pub unit: String,
    /// Definition that the values follow, where there are several.
    pub definition: Option<String>,
    /// The values, the earliest first.
    pub points: Vec<TrendPoint>,
    /// From the value before to the newest; null with a single value.
    pub since_previous: Option<Change>,
    /// From the first value shown to the newest; null with fewer than three, where it would be the same.
    pub since_first: Option<Change>,
}

/// One value of a trend.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TrendPoint {
    /// The measure.
    pub measure_id: Uuid,
    /// When it was measured.
    #[serde(with = "time::serde::rfc3339")]
    pub measured_at: OffsetDateTime,
    /// The value.
    pub value: f64,
    /// Its standard error; null when it is not known.
    pub standard_error: Option<f64>,
}

/// Whether a measure changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChangeVerdict {
    /// By more than the minimal detectable change.
    Changed,
    /// By less: the difference may be error.
    WithinError,
    /// Nothing is known of the error.
    Unknown,
}

/// A difference between two values of a measure.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Change {
    /// When the earlier value was measured.
    #[serde(with = "time::serde::rfc3339")]
    pub from: OffsetDateTime,
    /// The later value less the earlier one, in the measure's unit.
    pub difference: f64,
    /// Smallest difference that is a change (MDC95), in the measure's unit; null when nothing is known of the error.
    pub minimal_detectable_change: Option<f64>,
    /// Whether it is one.
    pub verdict: ChangeVerdict,
    /// The published limit that was applied; null when the values' own errors gave the larger one, or there is none.
    pub rule: Option<ChangeInfo>,
    /// Why, for a clinician.
    pub reason: String,
}

impl Trend {
    /// The trend of values of one measure, side and definition, the earliest first; none without any.
    pub fn of(course: &[MeasureRecord]) -> Option<Self> {
        let newest = course.last()?;
        let between = |earlier: &MeasureRecord| Change::between(earlier, newest);
        Some(Self {
            name: newest.name.clone(),
            title: title_of(&newest.name),
            side: newest.side,
            unit: unit_of(&newest.name).to_owned(),
            definition: newest.definition.clone(),
            points: course.iter().map(TrendPoint::of).collect(),
            since_previous: course.len().checked_sub(2).map(|before| between(&course[before])),
            since_first: (course.len() > 2).then(|| between(&course[0])),
        })
    }
}

impl TrendPoint {
    fn of(record: &MeasureRecord) -> Self {
        Self {
            measure_id: record.id,
            measured_at: record.measured_at,
            value: record.value,
            standard_error: record.standard_error,
        }
    }
}

impl Change {
    fn between(earlier: &MeasureRecord, later: &MeasureRecord) -> Self {
        let difference = later.value - earlier.value;
        let own = earlier.standard_error.zip(later.standard_error).map(|(a, b)| Z95 * a.hypot(b));
        let published = change_rule_of(&later.name);
        let rule = published.filter(|rule| own.is_none_or(|own| rule.value >= own));
        let limit = rule.map(|rule| rule.value).or(own);
        let verdict = match limit {
            Some(limit) if difference.abs() > limit => ChangeVerdict::Changed,
            Some(_) => ChangeVerdict::WithinError,
            None => ChangeVerdict::Unknown,
        };
        let reason = match (verdict, rule.is_some()) {
            (ChangeVerdict::Unknown, _) => "no error of this measure is known, so a difference says nothing".to_owned(),
            (ChangeVerdict::Changed, true) => "more than the published minimal detectable change".to_owned(),
            (ChangeVerdict::Changed, false) => {
                "more than the errors of both values; how much the person varies from day to day is not in them"
                    .to_owned()
            }
            (ChangeVerdict::WithinError, _) => "less than the minimal detectable change: it may be error".to_owned(),
        };
        Self { from: earlier.measured_at, difference, minimal_detectable_change: limit, verdict, rule, reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::measure::MeasureSource;

    fn record(name: &str, day: i64, value: f64, standard_error: Option<f64>) -> MeasureRecord {
        let at = OffsetDateTime::UNIX_EPOCH + time::Duration::days(day);
        MeasureRecord {
            id: Uuid::from_u128(day as u128),
            name: name.to_owned(),
            title: title_of(name),
            side: None,
            value,
            unit: unit_of(name).to_owned(),
            standard_error,
            n_observations: None,
            error_sd: None,
            definition: None,
            protocol: None,
            reason: String::new(),
            source: MeasureSource::Entered { measurement_id: Uuid::nil() },
            measured_at: at,
            created_at: at,
        }
    }

    fn change(name: &str, from: (f64, Option<f64>), to: (f64, Option<f64>)) -> Change {
        let course = [record(name, 1, from.0, from.1), record(name, 2, to.0, to.1)];
        Trend::of(&course).unwrap().since_previous.unwrap()
    }

    #[test]
    fn mdc_sts5_a_difference_of_less_than_two_and_a_half_seconds_is_no_change() {
        let within = change("five_times_sit_to_stand_s", (14.0, Some(0.1)), (11.6, Some(0.1)));
        assert_eq!(within.verdict, ChangeVerdict::WithinError);
        assert!((within.minimal_detectable_change.unwrap() - 2.4946).abs() < 1e-3);
        let changed = change("five_times_sit_to_stand_s", (14.0, None), (11.4, None));
        assert_eq!((changed.verdict, changed.rule.unwrap().id), (ChangeVerdict::Changed, "mdc_sts5"));
    }

    #[test]
    fn larger_errors_of_the_values_themselves_count_in_place_of_a_published_limit() {
        let found = change("usual_speed_mps", (1.0, Some(0.2)), (0.7, Some(0.2)));
        assert_eq!((found.verdict, found.rule), (ChangeVerdict::WithinError, None));
        assert!((found.minimal_detectable_change.unwrap() - 0.5544).abs() < 1e-3);
    }

    #[test]
    fn without_any_error_a_difference_says_nothing() {
        let found = change("trunk_sway_path_m", (1.0, None), (2.0, None));
        assert_eq!((found.verdict, found.minimal_detectable_change), (ChangeVerdict::Unknown, None));
    }

    #[test]
    fn a_course_of_three_is_also_compared_with_its_first() {
        let course: Vec<_> = (0..3).map(|day| record("step_length_m", day, 0.6, Some(0.01))).collect();
        let trend = Trend::of(&course).unwrap();
        assert_eq!((trend.points.len(), trend.since_first.unwrap().from), (3, course[0].measured_at));
        assert_eq!(Trend::of(&course[..2]).unwrap().since_first, None);
        assert_eq!(Trend::of(&[]), None);
    }
}
