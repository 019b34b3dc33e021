//! Lengths, widths and times of single steps and strides (clinical evidence, section 6).
//!
//! ```text
//! H_i  place of the foot at contact i, t_i its time, feet alternating
//! u_i  along H_{i−1} → H_{i+1}, the stride of the other foot around contact i; at the end of a walk along H_{i−2} → H_i
//! step length    (H_i − H_{i−1}) · u_i, negative when the foot lands behind the other
//! step width     distance of H_i from the line through H_{i−1} and H_{i+1}
//! stride length  |H_i − H_{i−2}|
//! step time      t_i − t_{i−1}          stride time  t_i − t_{i−2}
//! ```

use super::contact::GaitContact;
use crate::body::Side;
use nalgebra::Vector2;

/// What is known of the step that ends with a contact, and of the stride that ends with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepValues {
    /// The foot that landed.
    pub side: Side,
    /// Number of the contact that ends the step.
    pub contact: usize,
    /// Whether the means take the step.
    pub counts: bool,
    /// Whether the means take the stride: its two steps count.
    pub stride_counts: bool,
    /// Step length, metres.
    pub length_m: Option<f64>,
    /// Step width, metres.
    pub width_m: Option<f64>,
    /// Step time, seconds.
    pub time_s: f64,
    /// Stride length, metres.
    pub stride_length_m: Option<f64>,
    /// Stride time, seconds.
    pub stride_time_s: Option<f64>,
    /// Phases of the stride, when every event of it was seen.
    pub phases: Option<StridePhases>,
}

/// Parts of a stride, from a contact of a foot to its next one, seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StridePhases {
    /// Initial to terminal contact of the foot.
    pub stance_s: f64,
    /// Terminal contact of the foot to its next initial contact.
    pub swing_s: f64,
    /// Both feet on the floor: after the foot's contact and before its release.
    pub double_support_s: f64,
    /// The foot alone on the floor: the swing of the other.
    pub single_support_s: f64,
}

/// The steps of contacts in order of time, each walk for itself.
pub fn steps(contacts: &[GaitContact]) -> Vec<StepValues> {
    let mut found = Vec::new();
    let mut first = 0;
    for walk in contacts.chunk_by(|a, b| a.walk == b.walk) {
        found.extend((1..walk.len()).map(|i| step(walk, i, first)));
        first += walk.len();
    }
    found
}

fn step(walk: &[GaitContact], i: usize, first: usize) -> StepValues {
    let alternates = |k: usize| walk[k].side != walk[k - 1].side;
    let counts = |k: usize| walk[k].excluded_because.is_empty();
    let place = |k: usize| walk.get(k).and_then(|contact| contact.place_m).map(Vector2::from);
    let is_step = alternates(i);
    let is_stride = i >= 2 && is_step && alternates(i - 1);
    let around = match (place(i - 1), place(i + 1)) {
        (Some(before), Some(after)) if is_step && alternates(i + 1) => direction(before, after),
        _ => None,
    };
    let stride = match (i.checked_sub(2).and_then(place), place(i)) {
        (Some(before), Some(here)) if is_stride => Some((before, here)),
        _ => None,
    };
    let step = place(i).zip(place(i - 1)).map(|(here, before)| here - before).filter(|_| is_step);
    let u = around.or_else(|| stride.and_then(|(before, here)| direction(before, here)));
    StepValues {
        side: walk[i].side,
        contact: first + i,
        counts: counts(i),
        stride_counts: is_stride && counts(i) && counts(i - 1),
        length_m: step.zip(u).map(|(step, u)| step.dot(&u)),
        width_m: step.zip(around).map(|(step, u)| step.perp(&u).abs()),
        time_s: walk[i].contact_s - walk[i - 1].contact_s,
        stride_length_m: stride.map(|(before, here)| (here - before).norm()),
        stride_time_s: is_stride.then(|| walk[i].contact_s - walk[i - 2].contact_s),
        phases: is_stride.then(|| phases(&walk[i - 2..=i])).flatten(),
    }
}

/// Shortest way that has a direction, metres: half of it is the error of a place.
const LEAST_WAY_M: f64 = 0.02;

fn direction(from: Vector2<f64>, to: Vector2<f64>) -> Option<Vector2<f64>> {
    (to - from).try_normalize(LEAST_WAY_M)
}

/// Phases of the stride between the first and the last of three contacts; none while an event is missing or the events
/// are not in the order of walking.
fn phases(stride: &[GaitContact]) -> Option<StridePhases> {
    let [start, other, end] = stride else { return None };
    let (release, other_release) = (end.toe_off_s?, other.toe_off_s?);
    let double = (other_release - start.contact_s) + (release - other.contact_s);
    let values = StridePhases {
        stance_s: release - start.contact_s,
        swing_s: end.contact_s - release,
        double_support_s: double,
        single_support_s: other.contact_s - other_release,
    };
    (values.stance_s > 0.0 && values.swing_s > 0.0 && values.single_support_s > 0.0 && double >= 0.0).then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contacts from places in centimetres, as the manual has them, and times in seconds; right first.
    fn contacts(places_cm: &[[f64; 2]], times_s: &[f64]) -> Vec<GaitContact> {
        let side = |i: usize| if i.is_multiple_of(2) { Side::Right } else { Side::Left };
        let place = |i: usize| places_cm[i].map(|cm| cm / 100.0);
        (0..places_cm.len()).map(|i| GaitContact::new(side(i), times_s[i], place(i))).collect()
    }

    fn near(found: Option<f64>, expected: f64) {
        assert!(found.is_some_and(|found| (found - expected).abs() < 1e-5), "{found:?} instead of {expected}");
    }

    #[test]
    fn footprint_to_footprint_test_of_section_6_regular_walk() {
        let walk = contacts(&[[0.0, 5.0], [60.0, -5.0], [120.0, 5.0], [180.0, -5.0]], &[0.0, 0.55, 1.10, 1.65]);
        for step in steps(&walk) {
            near(step.length_m, 0.60);
            near(Some(step.time_s), 0.55);
        }
        let found = steps(&walk);
        near(found[0].width_m, 0.10);
        near(found[1].width_m, 0.10);
        assert_eq!(found[2].width_m, None, "the line of the other foot ends before the last contact");
        near(found[1].stride_length_m, 1.20);
        near(found[2].stride_length_m, 1.20);
        near(found[2].stride_time_s, 1.10);
        assert_eq!(found[0].stride_length_m, None);
    }

    #[test]
    fn heel_to_opposite_line_test_of_section_6_oblique_walk() {
        let found = steps(&contacts(&[[0.0, 5.0], [60.0, -5.0], [122.0, 6.0]], &[0.0, 0.55, 1.10]));
        near(found[0].length_m, 0.599_16);
        near(found[1].length_m, 0.620_88);
        near(found[1].stride_length_m, 1.220_04);
        near(found[0].width_m, 0.104_91);
    }

    #[test]
    fn a_foot_that_lands_behind_the_other_makes_a_negative_step() {
        let found = steps(&contacts(&[[0.0, 5.0], [60.0, -5.0], [50.0, 5.0], [110.0, -5.0]], &[0.0, 0.5, 1.0, 1.5]));
        assert!(found[1].length_m.is_some_and(|length| length < -0.05), "{found:?}");
        near(found[1].stride_length_m, 0.5);
    }

    #[test]
    fn a_turned_walkway_changes_no_measure() {
        let places = [[0.0, 5.0], [60.0, -5.0], [122.0, 6.0], [180.0, -4.0]];
        let times = [0.0, 0.55, 1.10, 1.65];
        let (sin, cos) = 2.2f64.sin_cos();
        let turned = places.map(|[x, z]| [cos * x - sin * z + 40.0, sin * x + cos * z - 300.0]);
        for (a, b) in steps(&contacts(&places, &times)).iter().zip(steps(&contacts(&turned, &times))) {
            near(b.length_m, a.length_m.unwrap());
            assert_eq!(a.width_m.is_some(), b.width_m.is_some());
            if let Some(width) = a.width_m {
                near(b.width_m, width);
            }
        }
    }

    #[test]
    fn a_missing_place_takes_away_what_needs_it_and_no_time() {
        let mut walk = contacts(&[[0.0, 5.0], [60.0, -5.0], [120.0, 5.0], [180.0, -5.0]], &[0.0, 0.55, 1.10, 1.65]);
        walk[2].place_m = None;
        let found = steps(&walk);
        assert_eq!((found[0].length_m, found[0].width_m, found[1].stride_length_m), (None, None, None));
        assert!(found.iter().all(|step| step.time_s > 0.5));
        near(found[2].stride_time_s, 1.10);
    }

    #[test]
    fn phases_of_a_stride_add_up() {
        let mut walk = contacts(&[[0.0, 5.0], [60.0, -5.0], [120.0, 5.0], [180.0, -5.0]], &[0.0, 0.5, 1.0, 1.5]);
        // Right lands at 0, the left leaves at 0.1 and lands at 0.5, the right leaves at 0.62 and lands at 1.
        (walk[1].toe_off_s, walk[2].toe_off_s) = (Some(0.1), Some(0.62));
        let phases = steps(&walk)[1].phases.unwrap();
        near(Some(phases.stance_s), 0.62);
        near(Some(phases.swing_s), 0.38);
        near(Some(phases.double_support_s), 0.22);
        near(Some(phases.single_support_s), 0.40);
        assert!(steps(&walk)[2].phases.is_none());
    }
}
