//! One foot that comes down, and why a step may not count.

use crate::body::Side;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A foot that came down: what every measure of gait is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GaitContact {
    /// The foot that came down.
    pub side: Side,
    /// Its initial contact, seconds from the recording's first frame.
    pub contact_s: f64,
    /// The terminal contact before it: when this foot had left the floor to come here; null when that was not seen.
    pub toe_off_s: Option<f64>,
    /// Where it stood on the floor: `x` and `z` of the recording's `world`, turned so that the floor is level, metres; null
    /// when that was not seen, or when the sensor moved.
    pub place_m: Option<[f64; 2]>,
    /// The walk that it belongs to, from 0: a walk ends where somebody stands, turns back or was not seen.
    pub walk: u64,
    /// Share of the frames since the contact before in which pelvis and both feet were seen, 0 to 1.
    pub coverage: f64,
    /// True when the direction of walking changes with this step.
    pub is_turning: bool,
    /// Why the means leave the step out that ends with this contact; empty when they do not.
    pub excluded_because: Vec<StepExclusion>,
}

impl GaitContact {
    /// A contact of the first walk that was fully seen, on a straight way.
    pub fn new(side: Side, contact_s: f64, place_m: [f64; 2]) -> Self {
        Self {
            side,
            contact_s,
            toe_off_s: None,
            place_m: Some(place_m),
            walk: 0,
            coverage: 1.0,
            is_turning: false,
            excluded_because: Vec::new(),
        }
    }
}

/// The place on the floor of a point in `world`, y being up.
pub fn on_floor(point_m: [f64; 3]) -> [f64; 2] {
    [point_m[0], point_m[2]]
}

/// Why a step does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepExclusion {
    /// One of the first or last two steps of a walk.
    FirstOrLast,
    /// Part of a turn.
    Turning,
    /// Seen in less than 80 % of its frames.
    LowCoverage,
    /// The foot before it was the same, or the contact before it was not seen.
    MissedContact,
}

impl StepExclusion {
    /// Every reason.
    pub const ALL: [StepExclusion; 4] =
        [StepExclusion::FirstOrLast, StepExclusion::Turning, StepExclusion::LowCoverage, StepExclusion::MissedContact];

    /// The reason of a name, as [`Gait`](crate::assessment::Gait) writes it.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "first_or_last" => Some(StepExclusion::FirstOrLast),
            "turning" => Some(StepExclusion::Turning),
            "low_coverage" => Some(StepExclusion::LowCoverage),
            "missed_contact" => Some(StepExclusion::MissedContact),
            _ => None,
        }
    }
}

/// Steps at either end of a walk that do not count.
const END_STEPS: usize = 2;
/// Share of a step's frames that must have been seen.
const LEAST_COVERAGE: f64 = 0.8;

/// Marks the steps that do not count (clinical evidence, section 6). The contacts are in order of time; a step ends with
/// each contact but the first of a walk.
pub fn mark_excluded(contacts: &mut [GaitContact]) {
    for walk in contacts.chunk_by_mut(|a, b| a.walk == b.walk) {
        let n = walk.len();
        for i in 1..n {
            // The steps of a walk of n contacts end with the contacts 1 to n − 1.
            let is_end = i <= END_STEPS || i + END_STEPS >= n;
            let reasons = [
                (StepExclusion::FirstOrLast, is_end),
                (StepExclusion::Turning, walk[i].is_turning),
                (StepExclusion::LowCoverage, walk[i].coverage < LEAST_COVERAGE),
                (StepExclusion::MissedContact, walk[i].side == walk[i - 1].side),
            ];
            walk[i].excluded_because = reasons.iter().filter(|(_, holds)| *holds).map(|(reason, _)| *reason).collect();
        }
    }
}

/// Steps that were left out for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StepExclusionCount {
    /// The reason.
    pub reason: StepExclusion,
    /// Steps; one with two reasons counts under both.
    pub n_steps: u64,
}

/// Steps left out, by reason.
pub fn count_excluded(contacts: &[GaitContact]) -> Vec<StepExclusionCount> {
    let count = |reason: StepExclusion| {
        let n_steps = contacts.iter().filter(|contact| contact.excluded_because.contains(&reason)).count() as u64;
        (n_steps > 0).then_some(StepExclusionCount { reason, n_steps })
    };
    StepExclusion::ALL.into_iter().filter_map(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk_of(n: usize) -> Vec<GaitContact> {
        let side = |i: usize| if i.is_multiple_of(2) { Side::Right } else { Side::Left };
        (0..n).map(|i| GaitContact::new(side(i), 0.5 * i as f64, [0.0, 0.6 * i as f64])).collect()
    }

    #[test]
    fn the_first_and_last_two_steps_of_a_walk_are_left_out() {
        let mut contacts = walk_of(8);
        mark_excluded(&mut contacts);
        let counted: Vec<usize> = (1..8).filter(|&i| contacts[i].excluded_because.is_empty()).collect();
        assert_eq!(counted, [3, 4, 5]);
        let expected = StepExclusionCount { reason: StepExclusion::FirstOrLast, n_steps: 4 };
        assert_eq!(count_excluded(&contacts), [expected]);
    }

    #[test]
    fn a_step_with_two_reasons_counts_under_both_and_eighty_percent_is_enough() {
        let mut contacts = walk_of(9);
        (contacts[4].coverage, contacts[5].coverage, contacts[5].is_turning) = (0.8, 0.79, true);
        mark_excluded(&mut contacts);
        assert!(contacts[4].excluded_because.is_empty());
        assert_eq!(contacts[5].excluded_because, [StepExclusion::Turning, StepExclusion::LowCoverage]);
    }

    #[test]
    fn two_contacts_of_one_foot_in_a_row_are_no_step() {
        let mut contacts = walk_of(9);
        contacts.remove(4);
        mark_excluded(&mut contacts);
        assert_eq!(contacts[4].excluded_because, [StepExclusion::MissedContact]);
    }
}
