//! Rules about the risk of falling, each from a published source, each with an answer of its own.
//!
//! There is no score that blends them. A rule says what it rests on (population, citation, how well its numbers are
//! confirmed, how accurate the tool is), and its finding says what was measured, how far that is from the limit, and what is
//! missing. What nobody knows is `unknown`, never `negative`.
//!
//! A new rule is one new file and one line in [`RULES`]. Nothing here has a threshold without a rule that cites it;
//! `every_threshold_belongs_to_a_rule_with_a_source` walks the list.

mod chair_stand;
mod falls_efficacy;
mod five_times_sit_to_stand;
mod gait_speed;
mod gait_variability;
mod known;
mod minimal_change;
mod physiological_profile;
mod quick_screen;
mod rule;
mod short_physical_performance;
mod tandem_stand;
#[cfg(test)]
mod tests;
mod timed_up_and_go;
mod world_falls_guidelines;

pub use known::{Answers, Known, Measured, Measures, Person, Sex};
pub use minimal_change::{CHANGE_RULES, ChangeInfo, change_rule_of};
pub use rule::{Cutoff, Evidence, Finding, RiskSide, Rule, RuleInfo, Status};

/// Every rule, in the order of a report: whole assessments first, then single tests, then gait.
pub const RULES: &[&Rule] = &[
    &world_falls_guidelines::WFG2022,
    &quick_screen::QUICKSCREEN,
    &five_times_sit_to_stand::STS5,
    &five_times_sit_to_stand::STS5_RECURRENT,
    &chair_stand::CHAIR30,
    &timed_up_and_go::TUG,
    &timed_up_and_go::TUG_MODIFIED,
    &timed_up_and_go::TUG_STEADI,
    &tandem_stand::TANDEM10,
    &short_physical_performance::SPPB_CHAIR,
    &short_physical_performance::SPPB_GAIT4M,
    &short_physical_performance::SPPB_BALANCE,
    &physiological_profile::PPA,
    &falls_efficacy::FES_I,
    &gait_speed::SPEED_SLOW_SS,
    &gait_speed::SPEED_SLOW_MAX,
    &gait_speed::SPEED_RR,
    &gait_speed::SPEED_NORM,
    &gait_variability::STEP_WIDTH_CV,
    &gait_variability::STEP_WIDTH_SD,
    &gait_variability::STRIDE_TIME_SD,
];

/// The rules that look at a measure.
pub fn rules_of_measure(name: &str) -> Vec<&'static str> {
    RULES.iter().filter(|rule| rule.info.measures.contains(&name)).map(|rule| rule.info.id).collect()
}

/// The finding of every rule.
pub fn findings(known: &Known) -> Vec<Finding> {
    RULES.iter().map(|rule| rule.apply(known)).collect()
}
