//! Values that hardly any walk has: flagged, never discarded.

use crate::assessment::PerformanceMeasure;
pub use crate::assessment::footfalls::GaitFlag;

/// Where the limits come from.
const CITATION: &str = "Mobilise-D limits over all cohorts (clinical evidence, section 5)";

/// Limits of a measure, in its unit; the limits themselves are plausible.
struct Limits {
    measure: &'static str,
    low: f64,
    high: f64,
    citation: &'static str,
}

const LIMITS: [Limits; 5] = [
    Limits { measure: "usual_speed_mps", low: 0.08, high: 2.22, citation: CITATION },
    Limits { measure: "stride_length_m", low: 0.15, high: 2.19, citation: CITATION },
    Limits { measure: "stride_time_s", low: 0.46, high: 3.0, citation: CITATION },
    Limits { measure: "step_time_s", low: 0.14, high: 2.124, citation: CITATION },
    Limits { measure: "cadence_spm", low: 40.0, high: 172.9, citation: CITATION },
];

/// Shortest plausible stride, metres.
pub(super) const SHORTEST_STRIDE_M: f64 = 0.15;
/// Longest plausible step, seconds.
pub(super) const LONGEST_STEP_S: f64 = 2.124;

/// The measures outside their limits.
pub fn flags(measures: &[PerformanceMeasure]) -> Vec<GaitFlag> {
    let flag = |measure: &PerformanceMeasure| {
        let limits = LIMITS.iter().find(|limits| limits.measure == measure.name)?;
        let value = measure.value.filter(|value| !(limits.low..=limits.high).contains(value))?;
        Some(GaitFlag {
            measure: measure.name.clone(),
            side: measure.side,
            value,
            low: limits.low,
            high: limits.high,
            citation: limits.citation.to_owned(),
        })
    };
    measures.iter().filter_map(flag).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(name: &str, value: f64) -> PerformanceMeasure {
        PerformanceMeasure {
            name: name.into(),
            side: None,
            value: Some(value),
            standard_error: None,
            error_sd: None,
            n_observations: None,
            definition: None,
            reason: String::new(),
        }
    }

    #[test]
    fn the_limits_themselves_are_plausible_and_what_is_beyond_them_is_flagged() {
        let expected = [
            ("usual_speed_mps", 0.08, 2.22),
            ("stride_length_m", 0.15, 2.19),
            ("stride_time_s", 0.46, 3.0),
            ("step_time_s", 0.14, 2.124),
            ("cadence_spm", 40.0, 172.9),
        ];
        for (name, low, high) in expected {
            assert_eq!(flags(&[measure(name, low), measure(name, high)]), [], "{name}");
            for value in [low - 1e-9, high + 1e-9] {
                let found = flags(&[measure(name, value)]);
                assert_eq!((found.len(), found[0].value, found[0].low, found[0].high), (1, value, low, high), "{name}");
                assert!(found[0].citation.contains("Mobilise-D"));
            }
        }
    }

    #[test]
    fn a_measure_without_limits_is_never_flagged() {
        assert_eq!(flags(&[measure("step_width_m", -3.0)]), []);
    }
}
