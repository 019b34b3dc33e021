//! Walking speed against limits of slow walking.

use super::known::Sex;
use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo};

const POPULATION: &str = "217 community-dwelling people of 65 to 93 years; falls in the past year";

/// `speed_slow_ss`.
pub(super) static SPEED_SLOW_SS: Rule = Rule {
    info: RuleInfo {
        id: "speed_slow_ss",
        measures: &["usual_speed_mps"],
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
        measures: &["highest_speed_mps"],
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

/// `speed_rr`.
pub(super) static SPEED_RR: Rule = Rule {
    info: RuleInfo {
        id: "speed_rr",
        measures: &["usual_speed_mps"],
        version: 1,
        statement: "People fell 1.069 times as often (95 % interval 1.001 to 1.142) for each 0.1 m/s that they walked slower; \
                    there is no limit",
        unit: Some("m/s"),
        cutoffs: &[],
        population: "597 people of 70 years and more, followed for 20 months",
        citation: "Verghese 2009, doi 10.1093/gerona/glp033",
        evidence: Evidence::Stated,
        accuracy: "no limit, so none",
    },
    find: |info, known| match &known.measures.usual_speed_mps {
        Some(speed) => Finding::information(info, speed, "a ratio between groups, not a probability of this person"),
        None => Finding::unknown(info, "the walking speed at the person's own choice"),
    },
};

/// First year of each age group, and the mean speed of healthy men and women of it, m/s.
const HEALTHY_MEANS: [(f64, f64, f64); 3] = [(60.0, 1.339, 1.241), (70.0, 1.262, 1.132), (80.0, 0.968, 0.943)];
/// First year beyond the last group.
const NORMS_END: f64 = 100.0;

/// `speed_norm`.
pub(super) static SPEED_NORM: Rule = Rule {
    info: RuleInfo {
        id: "speed_norm",
        measures: &["usual_speed_mps"],
        version: 1,
        statement: "Mean walking speed of healthy people of the same age and sex, for comparison; there is no limit",
        unit: Some("m/s"),
        cutoffs: &[],
        population: "23 111 healthy people; means are given here for 60 to 99 years",
        citation: "Bohannon 2011, doi 10.1016/j.physio.2010.12.004",
        evidence: Evidence::Unconfirmed,
        accuracy: "no limit, so none",
    },
    find: |info, known| {
        let Some(speed) = &known.measures.usual_speed_mps else {
            return Finding::unknown(info, "the walking speed at the person's own choice");
        };
        let (Some(age), Some(sex)) = (known.person.age_years, known.person.sex) else {
            return Finding::unknown(info, "age and sex, which the mean depends on").with_value(speed);
        };
        let group = HEALTHY_MEANS.iter().rev().find(|(first, ..)| age >= *first).filter(|_| age < NORMS_END);
        let Some((_, men, women)) = group else {
            return Finding::information(info, speed, "means are given for 60 to 99 years only");
        };
        let mean = if sex == Sex::Male { men } else { women };
        let difference = speed.value - mean;
        Finding::information(info, speed, format!("{difference:+.2} m/s against a mean of {mean:.2} m/s"))
    },
};
