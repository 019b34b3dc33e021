//! Timed up and go, by three authorities.

use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo};

/// `tug`: the limit of the World Falls Guidelines.
pub(super) static TUG: Rule = Rule {
    info: RuleInfo {
        id: "tug",
        measures: &["timed_up_and_go_s"],
        version: 1,
        statement: "A timed up and go of more than 15 s marks impaired gait and balance",
        unit: Some("s"),
        cutoffs: &[Cutoff::above(15.0, Evidence::Quoted)],
        population: "community-dwelling people of 65 years and more",
        citation: "Montero-Odasso et al. 2022, World Falls Guidelines, Age Ageing 51:afac205, doi 10.1093/ageing/afac205",
        evidence: Evidence::Quoted,
        accuracy: "not given for the test alone",
    },
    find: of_time,
};

/// `tug_modified`: the limit of a modified algorithm.
pub(super) static TUG_MODIFIED: Rule = Rule {
    info: RuleInfo {
        id: "tug_modified",
        measures: &["timed_up_and_go_s"],
        version: 1,
        statement: "A timed up and go of more than 10 s, in a modified algorithm of the World Falls Guidelines",
        unit: Some("s"),
        cutoffs: &[Cutoff::above(10.0, Evidence::Quoted)],
        population: "693 people of 70 to 90 years",
        citation: "modified algorithm of the World Falls Guidelines 2022, as quoted with its limit",
        evidence: Evidence::Quoted,
        accuracy: "low, intermediate and high: 349, 127 and 217 of 693",
    },
    find: of_time,
};

/// `tug_steadi`: the limit of STEADI.
pub(super) static TUG_STEADI: Rule = Rule {
    info: RuleInfo {
        id: "tug_steadi",
        measures: &["timed_up_and_go_s"],
        version: 1,
        statement: "A timed up and go of 12 s or more marks a risk of falling",
        unit: Some("s"),
        cutoffs: &[Cutoff::at_least(12.0, Evidence::Unconfirmed)],
        population: "older adults",
        citation: "CDC STEADI",
        evidence: Evidence::Unconfirmed,
        accuracy: "not given",
    },
    find: of_time,
};

fn of_time(info: &RuleInfo, known: &super::Known) -> Finding {
    match &known.measures.timed_up_and_go_s {
        Some(time) => Finding::against(info, time, info.cutoffs[0]),
        None => Finding::unknown(info, "the time of a timed up and go"),
    }
}
