//! Falls Efficacy Scale International.

use super::known::Measured;
use super::rule::{Evidence, Finding, Rule, RuleInfo};

/// Lowest sum of each band.
const BANDS: [(u32, &str); 3] = [(28, "high"), (20, "moderate"), (16, "low")];

/// `fes_i`.
pub(super) static FES_I: Rule = Rule {
    info: RuleInfo {
        id: "fes_i",
        measures: &[],
        version: 1,
        statement: "Concern about falling by the Falls Efficacy Scale International: 16 to 19 low, 20 to 27 moderate, 28 to 64 \
                    high",
        unit: Some("{score}"),
        cutoffs: &[],
        population: "older adults",
        citation: "Delbaere 2010, Age Ageing 39:210-216",
        evidence: Evidence::Quoted,
        accuracy: "not given",
    },
    find: |info, known| {
        let Some(sum) = known.answers.falls_efficacy else {
            return Finding::unknown(info, "the sum of the Falls Efficacy Scale International");
        };
        let band = BANDS.iter().find(|(least, _)| sum >= *least).map_or("not a sum of the scale", |(_, name)| name);
        Finding::information(info, &Measured::of(f64::from(sum)), "bands of concern, not of risk").with_category(band)
    },
};
