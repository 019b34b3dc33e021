//! What is missing for a finding, and what to record or ask next.

use crate::fall_risk::{Finding, Status};
use serde::Serialize;
use utoipa::ToSchema;

/// What a rule still needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Needed {
    /// The rule.
    pub rule_id: &'static str,
    /// What is missing, as the finding says it.
    pub missing: String,
    /// Protocols whose recording would give a measure of the rule; empty when no recording can, and somebody must be asked or
    /// a test be entered.
    pub record_protocols: Vec<&'static str>,
}

/// What the findings without an answer need; `protocols_of` names the protocols that give a measure.
pub fn needed(findings: &[Finding], protocols_of: impl Fn(&str) -> Vec<&'static str>) -> Vec<Needed> {
    let open = findings.iter().filter(|finding| finding.status == Some(Status::Unknown));
    open.map(|finding| Needed {
        rule_id: finding.rule_id,
        missing: finding.reason.clone(),
        record_protocols: finding.measures.iter().flat_map(|measure| protocols_of(measure)).collect(),
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fall_risk::{Known, Measured, findings};

    #[test]
    fn what_is_known_is_not_asked_for_and_what_is_not_names_its_recording() {
        let mut known = Known::default();
        known.measures.timed_up_and_go_s = Some(Measured::of(9.0));
        let open = needed(&findings(&known), |measure| match measure {
            "five_times_sit_to_stand_s" => vec!["five_times_sit_to_stand"],
            _ => Vec::new(),
        });
        assert!(open.iter().all(|needed| needed.rule_id != "tug"));
        let sts5 = open.iter().find(|needed| needed.rule_id == "sts5").unwrap();
        assert_eq!(sts5.record_protocols, ["five_times_sit_to_stand"]);
        assert!(sts5.missing.contains("five rises"), "{}", sts5.missing);
    }
}
