//! The smallest difference between two occasions that is a change: `MDC95 = 1.96 · √2 · SEM`.

use super::rule::Evidence;
use serde::Serialize;
use utoipa::ToSchema;

/// A published limit of change for one measure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct ChangeInfo {
    /// Identifier; never given to another rule.
    pub id: &'static str,
    /// Version of its text and numbers.
    pub version: u32,
    /// The measure.
    pub measure: &'static str,
    /// A larger difference is a change, in the measure's unit.
    pub value: f64,
    /// UCUM unit.
    pub unit: &'static str,
    /// Whom it was measured in.
    pub population: &'static str,
    /// Where it comes from.
    pub citation: &'static str,
    /// How well the number is confirmed.
    pub evidence: Evidence,
}

/// Half the width of a 95 % interval in standard deviations.
const Z95: f64 = 1.96;

/// The minimal detectable change that a standard error of measurement makes.
const fn mdc95(standard_error_of_measurement: f64) -> f64 {
    Z95 * std::f64::consts::SQRT_2 * standard_error_of_measurement
}

/// Standard error of measurement of the five-times sit-to-stand, seconds.
const STS5_SEM_S: f64 = 0.9;

const SLOW_WALKERS: &str = "slow walkers (mean speed 0.60 m/s), test and retest with an inertial unit";
const SLOW_WALKERS_SOURCE: &str = "Sensors 2020, 20:4866, table 3";

const fn of_slow_walkers(measure: &'static str, value: f64, unit: &'static str) -> ChangeInfo {
    ChangeInfo {
        id: "mdc_slow_walkers",
        version: 1,
        measure,
        value,
        unit,
        population: SLOW_WALKERS,
        citation: SLOW_WALKERS_SOURCE,
        evidence: Evidence::Stated,
    }
}

/// Every published limit of change.
pub static CHANGE_RULES: [ChangeInfo; 6] = [
    ChangeInfo {
        id: "mdc_sts5",
        version: 1,
        measure: "five_times_sit_to_stand_s",
        value: mdc95(STS5_SEM_S),
        unit: "s",
        population: "29 women, mean age 73.6 years; standard error of measurement 0.9 s, ICC 0.95",
        citation: "Goldberg 2012, Aging Clin Exp Res 24:339-344",
        evidence: Evidence::Stated,
    },
    of_slow_walkers("usual_speed_mps", 0.18, "m/s"),
    of_slow_walkers("step_length_m", 0.106, "m"),
    of_slow_walkers("cadence_spm", 12.2, "{steps}/min"),
    of_slow_walkers("step_time_s", 0.12, "s"),
    of_slow_walkers("step_time_sd_s", 0.09, "s"),
];

/// The published limit of change of a measure.
pub fn change_rule_of(measure: &str) -> Option<ChangeInfo> {
    CHANGE_RULES.iter().find(|rule| rule.measure == measure).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mdc_sts5_is_two_and_a_half_seconds_by_its_standard_error() {
        assert!((mdc95(0.9) - 2.49).abs() < 0.005);
        assert_eq!(change_rule_of("five_times_sit_to_stand_s").map(|rule| rule.value), Some(mdc95(0.9)));
    }

    #[test]
    fn every_limit_of_change_has_a_source_and_a_measure_of_its_own() {
        for (i, rule) in CHANGE_RULES.iter().enumerate() {
            assert!(!rule.citation.is_empty() && !rule.population.is_empty() && rule.value > 0.0, "{}", rule.id);
            assert!(CHANGE_RULES[..i].iter().all(|earlier| earlier.measure != rule.measure), "{}", rule.measure);
        }
    }
}
