//! Walking speed against limits of slow walking.

use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo};

const POPULATION: &str = "217 community-dwelling people of 65 to 93 years; falls in the past year";

/// `speed_slow_ss`.
pub(super) static SPEED_SLOW_SS: Rule = Rule {
    info: RuleInfo {
        id: "speed_slow_ss",
        version: 1,
        statement: "Walking slower than 0.76 m/s at one's own choice goes with falls",
        unit: Some("m/s"),
        cutoffs: &[Cutoff::below(0.76, Evidence::Stated)],
        population: POPULATION,
        citation: "PMC4912425",
        evidence: Evidence::Stated,
        accuracy: "AUC 0.69, sensitivity 65.4 %, specificity 70.9 %",
    },
    find: |info, known| match &known.measures.usual_speed_mps {
        Some(speed) => Finding::against(info, speed, info.cutoffs[0]),
        None => Finding::unknown(info, "the walking speed at the person's own choice"),
    },
};

/// `speed_slow_max`.
pub(super) static SPEED_SLOW_MAX: Rule = Rule {
    info: RuleInfo {
        id: "speed_slow_max",
        version: 1,
        statement: "Walking slower than 1.13 m/s at one's highest speed goes with falls",
        unit: Some("m/s"),
        cutoffs: &[Cutoff::below(1.13, Evidence::Stated)],
        population: POPULATION,
        citation: "PMC4912425",
        evidence: Evidence::Stated,
        accuracy: "AUC 0.71, sensitivity 76.6 %, specificity 60.0 %",
    },
    find: |info, known| match &known.measures.highest_speed_mps {
        Some(speed) => Finding::against(info, speed, info.cutoffs[0]),
        None => Finding::unknown(info, "the highest walking speed"),
    },
};
