//! Physiological Profile Assessment, where its instruments were used; nothing here estimates it.

use super::known::Measured;
use super::rule::{Evidence, Finding, Rule, RuleInfo};

/// Lowest z-score of each band.
const BANDS: [(f64, &str); 4] = [(3.0, "marked"), (2.0, "high"), (1.0, "moderate"), (0.0, "mild")];

/// `ppa`.
pub(super) static PPA: Rule = Rule {
    info: RuleInfo {
        id: "ppa",
        measures: &[],
        version: 1,
        statement: "z-score of the Physiological Profile Assessment: 0 to 1 mild, 1 to 2 moderate, 2 to 3 high, 3 and more \
                    marked",
        unit: Some("1"),
        cutoffs: &[],
        population: "older adults",
        citation: "Physiological Profile Assessment, bands as quoted",
        evidence: Evidence::Quoted,
        accuracy: "not given",
    },
    find: |info, known| {
        let Some(z) = known.answers.physiological_profile_z else {
            return Finding::unknown(
                info,
                "the z-score, which needs vision, proprioception, strength, reaction time and sway to be tested with \
                 their instruments",
            );
        };
        let band = BANDS.iter().find(|(least, _)| z >= *least).map_or("below the mean of the young", |(_, name)| name);
        Finding::information(info, &Measured::of(z), "bands without a limit of risk").with_category(band)
    },
};
