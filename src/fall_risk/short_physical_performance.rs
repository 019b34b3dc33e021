//! Short Physical Performance Battery: points of its three parts.

use super::known::{Known, Measured};
use super::rule::{Evidence, Finding, Rule, RuleInfo};

const POPULATION: &str = "older adults";
const CITATION: &str = "Guralnik 1994, points as quoted";

/// Longest time of five stands for 4, 3 and 2 points, seconds, to a tenth of a second as it is read; slower ones have 1.
const CHAIR_S: [f64; 3] = [11.1, 13.6, 16.6];
/// Longest time of four metres for 3 and 2 points, seconds; under the first limit it is 4, beyond the last 1.
const GAIT_S: [f64; 3] = [4.82, 6.20, 8.70];
/// Holds that count, seconds.
const HELD_S: f64 = 10.0;
const TANDEM_PART_S: f64 = 3.0;

/// `sppb_chair`.
pub(super) static SPPB_CHAIR: Rule = Rule {
    info: RuleInfo {
        id: "sppb_chair",
        measures: &["five_times_sit_to_stand_s"],
        version: 1,
        statement: "Points of five chair stands: up to 11.1 s 4, 13.6 s 3, 16.6 s 2, longer 1, unable 0",
        unit: Some("s"),
        cutoffs: &[],
        population: POPULATION,
        citation: CITATION,
        evidence: Evidence::Quoted,
        accuracy: "not given",
    },
    find: |info, known| {
        let Some(time) = &known.measures.five_times_sit_to_stand_s else {
            return Finding::unknown(info, "the time of five rises from a chair");
        };
        let tenths = (time.value * 10.0).round() / 10.0;
        let points = 4 - CHAIR_S.iter().filter(|limit| tenths > **limit).count();
        of_points(info, time, points)
    },
};

/// `sppb_gait4m`.
pub(super) static SPPB_GAIT4M: Rule = Rule {
    info: RuleInfo {
        id: "sppb_gait4m",
        measures: &["walk_4_m_s"],
        version: 1,
        statement: "Points of a walk of four metres: under 4.82 s 4, up to 6.20 s 3, up to 8.70 s 2, longer 1, unable 0",
        unit: Some("s"),
        cutoffs: &[],
        population: POPULATION,
        citation: CITATION,
        evidence: Evidence::Quoted,
        accuracy: "not given",
    },
    find: |info, known| {
        let Some(time) = &known.measures.walk_4_m_s else {
            return Finding::unknown(info, "the time of a walk of four metres");
        };
        let [four, three, two] = GAIT_S;
        let points = match time.value {
            s if s < four => 4,
            s if s <= three => 3,
            s if s <= two => 2,
            _ => 1,
        };
        of_points(info, time, points)
    },
};

/// `sppb_balance`.
pub(super) static SPPB_BALANCE: Rule = Rule {
    info: RuleInfo {
        id: "sppb_balance",
        measures: &["side_by_side_hold_s", "semi_tandem_hold_s", "tandem_hold_s"],
        version: 1,
        statement: "Points of balance: side by side 10 s 1, also semi-tandem 10 s 2, also tandem 3 to 9 s 3, tandem 10 s 4",
        unit: None,
        cutoffs: &[],
        population: POPULATION,
        citation: CITATION,
        evidence: Evidence::Quoted,
        accuracy: "not given",
    },
    find: |info, known| match balance_points(known) {
        Some(points) => {
            Finding::new(info, None, "points without a limit of risk").with_category(format!("{points} of 4 points"))
        }
        None => Finding::unknown(info, "how long side-by-side, semi-tandem and tandem stands were held"),
    },
};

/// Points of the three stands; the later ones are not needed where an earlier one was not held.
fn balance_points(known: &Known) -> Option<u32> {
    let held = |hold: Option<Measured>| hold.map(|hold| hold.value);
    if held(known.measures.side_by_side_hold_s)? < HELD_S {
        return Some(0);
    }
    if held(known.measures.semi_tandem_hold_s)? < HELD_S {
        return Some(1);
    }
    Some(match held(known.measures.tandem_hold_s)? {
        s if s >= HELD_S => 4,
        s if s >= TANDEM_PART_S => 3,
        _ => 2,
    })
}

fn of_points(info: &RuleInfo, time: &Measured, points: usize) -> Finding {
    Finding::information(info, time, "points without a limit of risk").with_category(format!("{points} of 4 points"))
}
