//! One foot that comes down, and why a step may not count.

pub use crate::assessment::footfalls::{GaitContact, StepExclusion, StepExclusionCount};

/// The place on the floor of a point in `world`, y being up.
pub fn on_floor(point_m: [f64; 3]) -> [f64; 2] {
    [point_m[0], point_m[2]]
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
    use crate::body::Side;

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
