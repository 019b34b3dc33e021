//! Tandem stand.

use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo};

/// `tandem10`.
pub(super) static TANDEM10: Rule = Rule {
    info: RuleInfo {
        id: "tandem10",
        measures: &["tandem_hold_s"],
        version: 1,
        statement: "A tandem stand of less than 10 s marks a risk",
        unit: Some("s"),
        cutoffs: &[Cutoff::below(10.0, Evidence::Quoted)],
        population: "older adults",
        citation: "CDC STEADI, four-stage balance test, as quoted",
        evidence: Evidence::Quoted,
        accuracy: "weak evidence: 7 of 9 fallers passed in one small study",
    },
    find: |info, known| match &known.measures.tandem_hold_s {
        Some(hold) => Finding::against(info, hold, info.cutoffs[0]),
        None => Finding::unknown(info, "how long a tandem stand was held"),
    },
};
