//! World Falls Guidelines 2022: low, intermediate or high risk.

use super::known::{Answers, Known};
use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo, Status};

/// Falls in twelve months that are recurrent, one of the factors of severity.
const RECURRENT: u32 = 2;
/// Limits of impaired gait or balance.
const SLOW_MPS: Cutoff = Cutoff::at_most(0.8, Evidence::Unconfirmed);
const TUG_S: Cutoff = Cutoff::above(15.0, Evidence::Quoted);

/// `wfg2022`.
pub(super) static WFG2022: Rule = Rule {
    info: RuleInfo {
        id: "wfg2022",
        measures: &["usual_speed_mps", "timed_up_and_go_s"],
        version: 1,
        statement: "High: a fall in twelve months with an injury, a second fall, frailty, lying unable to rise or loss of \
                    consciousness. Intermediate: a fall, unsteadiness or worry, and slow walking (0.8 m/s or less) or a \
                    timed up and go of more than 15 s. Low: everybody else",
        unit: None,
        cutoffs: &[SLOW_MPS, TUG_S],
        population: "1509 people of 65 years and more",
        citation: "Montero-Odasso et al. 2022, Age Ageing 51:afac205, doi 10.1093/ageing/afac205",
        evidence: Evidence::Unconfirmed,
        accuracy: "for one fall or more in a year: sensitivity 30.9-48.0 %, specificity 77.0-88.2 % (Age Ageing 53:afae229)",
    },
    find: |info, known| {
        let answers = &known.answers;
        let Some(falls) = answers.falls_12_months else {
            let reason = "the questionnaire is needed: falls in the past twelve months are not known";
            return Finding::new(info, Some(Status::NotAssessable), reason);
        };
        let severity = (falls > 0).then(|| is_severe(answers, falls));
        if severity == Some(Some(true)) {
            return category(info, Status::Positive, "high", "a fall with a factor of severity");
        }
        if severity == Some(None) {
            return Finding::unknown(
                info,
                "the factors of severity: injury, frailty, lying unable to rise, consciousness",
            );
        }
        let asked = [Some(falls > 0), answers.feels_unsteady, answers.worries_about_falling];
        let is_impaired = is_impaired(known);
        match (any(&asked), is_impaired) {
            (Some(false), _) => category(info, Status::Negative, "low", "no fall, no unsteadiness, no worry"),
            (_, Some(false)) => category(info, Status::Negative, "low", "gait and balance are not impaired"),
            (Some(true), Some(true)) => category(
                info,
                Status::Positive,
                "intermediate",
                "a fall or a positive key question, and impaired gait or balance",
            ),
            (None, _) => Finding::unknown(info, "whether the person feels unsteady or worries about falling"),
            (_, None) => {
                Finding::unknown(info, "walking speed or timed up and go, or which side of its limit it is on")
            }
        }
    },
};

/// Whether a fall came with a factor of severity; none while no factor is known and not all are known to be absent.
fn is_severe(answers: &Answers, falls: u32) -> Option<bool> {
    any(&[
        Some(falls >= RECURRENT),
        answers.injury_needing_care,
        answers.is_frail,
        answers.lay_unable_to_rise,
        answers.loss_of_consciousness,
    ])
}

/// Whether gait or balance is impaired by what was measured; none where nothing was, or it is too near to the limit.
fn is_impaired(known: &Known) -> Option<bool> {
    let (speed, tug) = (known.measures.usual_speed_mps, known.measures.timed_up_and_go_s);
    let slow = speed.and_then(|speed| SLOW_MPS.is_surely_passed(&speed));
    let long = tug.and_then(|tug| TUG_S.is_surely_passed(&tug));
    match (slow, long) {
        (Some(true), _) | (_, Some(true)) => Some(true),
        // Either of the two tests is asked for, and one that was done and does not tell leaves it open.
        _ if speed.is_some() && slow.is_none() || tug.is_some() && long.is_none() => None,
        (None, None) => None,
        _ => Some(false),
    }
}

/// True when one holds, false when all are known not to, none otherwise.
fn any(known: &[Option<bool>]) -> Option<bool> {
    if known.contains(&Some(true)) {
        return Some(true);
    }
    known.iter().all(Option::is_some).then_some(false)
}

fn category(info: &RuleInfo, status: Status, name: &str, reason: &str) -> Finding {
    Finding::new(info, Some(status), reason).with_category(name)
}
