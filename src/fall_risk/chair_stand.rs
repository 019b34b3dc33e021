//! The 30-second chair stand against the limits of age and sex.

use super::known::Sex;
use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo, Status};

/// First year of each age group, which spans five, and the limits below which men and women are below average.
const LIMITS: [(f64, f64, f64); 7] = [
    (60.0, 14.0, 12.0),
    (65.0, 12.0, 11.0),
    (70.0, 12.0, 10.0),
    (75.0, 11.0, 10.0),
    (80.0, 10.0, 9.0),
    (85.0, 8.0, 8.0),
    (90.0, 7.0, 4.0),
];
/// First year beyond the last group.
const END_AGE: f64 = 95.0;

/// `chair30`.
pub(super) static CHAIR30: Rule = Rule {
    info: RuleInfo {
        id: "chair30",
        measures: &["chair_stands_30_s"],
        version: 1,
        statement: "Fewer rises in 30 s than the average of age and sex mark a risk; using the arms counts 0, more than \
                    halfway up at 30 s counts as a rise",
        unit: Some("1"),
        cutoffs: &[],
        population: "people of 60 to 94 years",
        citation: "CDC STEADI, 30-second chair stand, 2017",
        evidence: Evidence::Stated,
        accuracy: "not given",
    },
    find: |info, known| {
        let Some(rises) = &known.measures.chair_stands_30_s else {
            return Finding::unknown(info, "the number of rises in 30 s");
        };
        let (Some(age), Some(sex)) = (known.person.age_years, known.person.sex) else {
            return Finding::unknown(info, "age and sex, which the limit depends on").with_value(rises);
        };
        let group = LIMITS.iter().rev().find(|(first, _, _)| age >= *first).filter(|_| age < END_AGE);
        let Some((_, men, women)) = group else {
            let reason = "there are limits for 60 to 94 years only";
            return Finding::new(info, Some(Status::NotAssessable), reason).with_value(rises);
        };
        let limit = if sex == Sex::Male { *men } else { *women };
        Finding::against(info, rises, Cutoff::below(limit, Evidence::Stated))
    },
};
