//! Findings in the words of a page. Nothing is left out of a finding and nothing is added to it.

use crate::fall_risk::{Evidence, Finding, Status};
use crate::pages::words;
use crate::report::Needed;

/// A finding.
pub(super) struct FindingView {
    pub rule: String,
    pub statement: &'static str,
    pub status: &'static str,
    pub class: &'static str,
    /// What was measured, with category; empty when nothing was.
    pub value: String,
    pub interval: String,
    pub cutoff: String,
    pub n_observations: String,
    pub probability: String,
    pub population: &'static str,
    pub is_other_population: bool,
    pub citation: &'static str,
    pub evidence: &'static str,
    pub is_unconfirmed: bool,
    pub accuracy: &'static str,
    /// Why, with the distance from the limit in standard errors where there is one.
    pub reason: String,
}

/// Findings of one status.
pub(super) struct Group {
    pub id: &'static str,
    pub heading: &'static str,
    pub findings: Vec<FindingView>,
}

/// A rule without an answer.
pub(super) struct OpenView {
    pub rule: String,
    pub statement: &'static str,
    pub status: &'static str,
    pub missing: String,
    /// Protocols that would give the measure, if any can.
    pub record: String,
    pub population: &'static str,
    pub citation: &'static str,
    pub evidence: &'static str,
    pub is_unconfirmed: bool,
}

impl FindingView {
    pub(super) fn of(finding: &Finding) -> Self {
        let unit = finding.unit.unwrap_or("1");
        let value = finding.value.map(|value| words::quantity(value, unit));
        let value = match (value, &finding.category) {
            (Some(value), Some(category)) => format!("{value}: {category}"),
            (value, category) => value.or_else(|| category.clone()).unwrap_or_default(),
        };
        let interval = match (finding.ci95_low, finding.ci95_high) {
            (Some(low), Some(high)) => words::range(low, high, unit),
            _ if finding.value.is_some() => "not known".to_owned(),
            _ => String::new(),
        };
        let probability = finding.probability.map_or_else(String::new, |[low, high]| {
            if low == high {
                words::percent(low)
            } else {
                format!("{} to {}", words::percent(low), words::percent(high))
            }
        });
        let cutoff = finding.cutoff.as_ref();
        Self {
            rule: format!("{}/{}", finding.rule_id, finding.rule_version),
            statement: finding.statement,
            status: words::status(finding.status),
            class: class(finding.status),
            value,
            interval,
            cutoff: cutoff.map_or_else(String::new, |cutoff| words::cutoff(cutoff, unit)),
            n_observations: finding.n_observations.map_or_else(String::new, |n| n.to_string()),
            probability,
            population: finding.population,
            is_other_population: finding.population_match == Some(false),
            citation: finding.citation,
            evidence: words::evidence(weakest(finding)),
            is_unconfirmed: weakest(finding) == Evidence::Unconfirmed,
            accuracy: finding.accuracy,
            reason: words::sentence(&finding.reason),
        }
    }
}

/// The weaker of how well the rule and how well the limit that was applied are confirmed.
fn weakest(finding: &Finding) -> Evidence {
    match finding.cutoff.map(|cutoff| cutoff.evidence) {
        Some(Evidence::Unconfirmed) => Evidence::Unconfirmed,
        _ => finding.evidence,
    }
}

fn class(status: Option<Status>) -> &'static str {
    match status {
        Some(Status::Positive) => "positive",
        Some(Status::Negative) => "negative",
        Some(Status::Indeterminate) => "indeterminate",
        Some(Status::Unknown | Status::NotAssessable) => "unknown",
        None => "information",
    }
}

/// Findings that are not positive and have an answer, by their status.
pub(super) fn groups(findings: &[Finding]) -> Vec<Group> {
    let of = |id, heading, status: Option<Status>| Group {
        id,
        heading,
        findings: findings.iter().filter(|finding| finding.status == status).map(FindingView::of).collect(),
    };
    let groups = [
        of("indeterminate", "The measurement does not tell", Some(Status::Indeterminate)),
        of("negative", "Limit not passed", Some(Status::Negative)),
        of("information", "Information without a limit", None),
    ];
    // A rule that informs may have nothing to inform of.
    groups.into_iter().filter(|group| !group.findings.is_empty()).collect()
}

/// Findings without an answer, what is missing for each, and what to record next.
pub(super) fn open_questions(findings: &[Finding], needed: &[Needed]) -> Vec<OpenView> {
    let is_open = |finding: &&Finding| matches!(finding.status, Some(Status::Unknown | Status::NotAssessable));
    let view = |finding: &Finding| {
        let need = needed.iter().find(|need| need.rule_id == finding.rule_id);
        let protocols = need.map_or(&[][..], |need| &need.record_protocols);
        let protocols: Vec<String> = protocols.iter().map(|protocol| words::spoken(protocol)).collect();
        OpenView {
            rule: format!("{}/{}", finding.rule_id, finding.rule_version),
            statement: finding.statement,
            status: words::status(finding.status),
            missing: words::sentence(need.map_or(&finding.reason, |need| &need.missing)),
            record: protocols.join(" or "),
            population: finding.population,
            citation: finding.citation,
            evidence: words::evidence(finding.evidence),
            is_unconfirmed: finding.evidence == Evidence::Unconfirmed,
        }
    };
    findings.iter().filter(is_open).map(view).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fall_risk::{Known, Measured, findings};

    #[test]
    fn every_finding_is_shown_once_and_unknown_ones_never_among_the_answers() {
        let mut known = Known::default();
        known.measures.timed_up_and_go_s = Some(Measured { standard_error: Some(0.1), ..Measured::of(16.0) });
        let findings = findings(&known);
        let positive = findings.iter().filter(|finding| finding.status == Some(Status::Positive)).count();
        let answered: Vec<FindingView> = groups(&findings).into_iter().flat_map(|group| group.findings).collect();
        let open = open_questions(&findings, &[]);
        assert_eq!(positive + answered.len() + open.len(), findings.len());
        assert!(positive > 0 && !open.is_empty());
        assert!(answered.iter().all(|view| view.status != "Unknown"));
        assert!(open.iter().all(|view| !view.missing.is_empty() && !view.citation.is_empty()));
    }

    #[test]
    fn a_finding_shows_value_interval_limit_and_how_far_it_is() {
        let mut known = Known::default();
        known.measures.timed_up_and_go_s = Some(Measured { standard_error: Some(0.5), ..Measured::of(16.0) });
        let findings = findings(&known);
        let tug = findings.iter().find(|finding| finding.rule_id == "tug").map(FindingView::of).unwrap();
        assert_eq!((tug.value.as_str(), tug.cutoff.as_str()), ("16.0\u{a0}s", "more than 15.0\u{a0}s"));
        assert_eq!(tug.interval, "15.0 to 17.0\u{a0}s");
        assert_eq!(tug.reason, "2.0 standard errors beyond the limit");
    }
}
