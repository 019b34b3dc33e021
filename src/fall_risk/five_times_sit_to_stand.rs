//! Five-times sit-to-stand, and the change between two of them that is a change.

use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo};

/// `sts5`: twelve seconds or more.
pub(super) static STS5: Rule = Rule {
    info: RuleInfo {
        id: "sts5",
        measures: &["five_times_sit_to_stand_s"],
        version: 1,
        statement: "Five rises from a chair, arms folded, that take 12 s or more go with recurrent falls",
        unit: Some("s"),
        cutoffs: &[Cutoff::at_least(12.0, Evidence::Unconfirmed)],
        population: "362 community-dwelling people of 74 to 98 years, 80 of them with two or more falls",
        citation: "Tiedemann 2008, Age Ageing 37:430-435, doi 10.1093/ageing/afn100",
        evidence: Evidence::Unconfirmed,
        accuracy: "not given",
    },
    find: of_time,
};

/// `sts5_recurrent`: fifteen seconds or more.
pub(super) static STS5_RECURRENT: Rule = Rule {
    info: RuleInfo {
        id: "sts5_recurrent",
        measures: &["five_times_sit_to_stand_s"],
        version: 1,
        statement: "Five rises from a chair that take 15 s or more go with recurrent falls",
        unit: Some("s"),
        cutoffs: &[Cutoff::at_least(15.0, Evidence::Unconfirmed)],
        population: "community-dwelling older people",
        citation: "Buatois 2008",
        evidence: Evidence::Unconfirmed,
        accuracy: "not given",
    },
    find: of_time,
};

fn of_time(info: &RuleInfo, known: &super::Known) -> Finding {
    match &known.measures.five_times_sit_to_stand_s {
        Some(time) => Finding::against(info, time, info.cutoffs[0]),
        None => Finding::unknown(info, "the time of five rises from a chair"),
    }
}
