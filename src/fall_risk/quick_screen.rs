//! QuickScreen: eight items, and between which probabilities of two or more falls in a year they leave a person.

use super::known::{Known, Measured};
use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo, Status};

/// Probability of two or more falls in twelve months by the number of items that are present.
const PROBABILITY: [f64; 9] = [0.07, 0.07, 0.13, 0.13, 0.27, 0.27, 0.49, 0.49, 0.49];

/// Falls in the past year, and medicines, from which on those items are present.
const FALLS: u32 = 1;
const MEDICINES: u32 = 4;
/// Limits of the three tests, seconds.
const NEAR_TANDEM: Cutoff = Cutoff::below(10.0, Evidence::Quoted);
const ALTERNATE_STEP: Cutoff = Cutoff::at_least(10.0, Evidence::Unconfirmed);
const SIT_TO_STAND: Cutoff = Cutoff::at_least(12.0, Evidence::Unconfirmed);

/// `quickscreen`.
pub(super) static QUICKSCREEN: Rule = Rule {
    info: RuleInfo {
        id: "quickscreen",
        measures: &["near_tandem_hold_s", "alternate_step_s", "five_times_sit_to_stand_s"],
        version: 1,
        statement: "Eight items: a fall in the past year, four or more medicines, a psychotropic one, low-contrast vision, \
                    feeling at the ankle, near tandem stand of 10 s with eyes closed, eight alternate steps in 10 s, five \
                    rises in 12 s. Outcome: two or more falls in the next twelve months",
        unit: Some("{items}"),
        cutoffs: &[NEAR_TANDEM, ALTERNATE_STEP, SIT_TO_STAND],
        population: "764 community-dwelling people, mean age 75.3 years, and 362, mean age 80.25 years",
        citation: "Tiedemann, Lord, Sherrington 2010, J Gerontol A 65:896-903, doi 10.1093/gerona/glq067",
        evidence: Evidence::Unconfirmed,
        accuracy: "AUC 0.72 (95 % CI 0.66-0.79)",
    },
    find: |info, known| {
        let items = items(known);
        let of = |presence: Presence| -> Vec<&str> {
            items.iter().filter(|(_, found)| *found == presence).map(|(name, _)| *name).collect()
        };
        let (present, open) = (of(Presence::Present), of(Presence::Unknown));
        let n_unknown = open.len();
        let k = present.len();
        let probability = [PROBABILITY[k], PROBABILITY[(k + n_unknown).min(8)]];
        // One group of persons alone is a status; the tool names none of them at risk.
        let status = (n_unknown > 0).then_some(Status::Unknown);
        let mut reason = format!("{k} of 8 items present");
        if !present.is_empty() {
            reason.push_str(&format!(" ({})", present.join(", ")));
        }
        if !open.is_empty() {
            reason.push_str(&format!("; not known or not told apart by the measurement: {}", open.join(", ")));
        }
        let value = Measured { n_observations: Some(8 - n_unknown as u32), ..Measured::of(k as f64) };
        Finding { probability: Some(probability), ..Finding::new(info, status, reason).with_value(&value) }
    },
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Presence {
    Present,
    Absent,
    Unknown,
}

/// The items by name, and whether each is present.
fn items(known: &Known) -> [(&'static str, Presence); 8] {
    let answered = |answer: Option<bool>| match answer {
        Some(true) => Presence::Present,
        Some(false) => Presence::Absent,
        None => Presence::Unknown,
    };
    let tested = |measured: &Option<Measured>, cutoff: Cutoff| {
        answered(measured.as_ref().and_then(|measured| cutoff.is_surely_passed(measured)))
    };
    let (answers, measures) = (&known.answers, &known.measures);
    [
        ("falls_12m", answered(answers.falls_12_months.map(|falls| falls >= FALLS))),
        ("medicines_4", answered(answers.medicines.map(|medicines| medicines >= MEDICINES))),
        ("psychotropic", answered(answers.takes_psychotropic)),
        ("low_contrast_acuity", answered(answers.reads_low_contrast_line_10.map(|reads| !reads))),
        ("tactile", answered(answers.feels_ankle_filament.map(|feels| !feels))),
        ("near_tandem", tested(&measures.near_tandem_hold_s, NEAR_TANDEM)),
        ("alternate_step", tested(&measures.alternate_step_s, ALTERNATE_STEP)),
        ("sit_to_stand_5", tested(&measures.five_times_sit_to_stand_s, SIT_TO_STAND)),
    ]
}
