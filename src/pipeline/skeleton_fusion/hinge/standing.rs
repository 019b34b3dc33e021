//! Quiet standing, and the zero of the angle in it.
//!
//! Somebody stands quietly where both units rest and both segments are upright: the proximal unit above the joint, the
//! distal one below it, as the place of the joint tells ([`super::joint_centre`]). Sitting is not upright.

use super::StandingZero;
use super::joint_centre::JointCentre;
use super::pair::Pair;
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::ops::Range;

/// Standard deviation of the knee's flexion in quiet standing about straight, rad. An assumption: by their laboratories'
/// own zero, the two persons of the data sets stood at −4° and 10°.
const STANDING_KNEE_SD: f64 = 7.0 * PI / 180.0;
/// Largest rate of a unit in quiet standing, rad/s (14 °/s): a gyroscope's bias, and sway.
const MAX_RATE: f64 = 0.25;
/// Shortest quiet standing, s.
const MIN_SECONDS: f64 = 1.0;
/// Largest angle between a segment and the vertical, rad. The unit lies on the skin, up to 30° from the segment's line.
const MAX_TILT: f64 = 37.0 * PI / 180.0;
/// Nearest to the joint that a unit may be for its direction to be the segment's, m.
const MIN_DISTANCE: f64 = 0.05;
/// Time after the first quiet standing in which more of it counts, s: later, units have slipped and legs are tired.
const SEARCH_SECONDS: f64 = 60.0;

/// The angle in quiet standing, and where that was. Neither needs to know which way is flexion.
pub(super) fn find(pair: &Pair, centre: &JointCentre, flexion: &[f64]) -> Option<(f64, StandingZero)> {
    let up_along = [centre.proximal, -centre.distal];
    if up_along.iter().any(|place| place.norm() < MIN_DISTANCE) {
        return None;
    }
    let up_along: [Vector3<f64>; 2] = up_along.map(|place| place.normalize());
    let stands = |i: usize| {
        (0..2).all(|unit| {
            let instant = &pair.units[unit][i];
            instant.rate.norm() < MAX_RATE && instant.up().dot(&up_along[unit]) > MAX_TILT.cos()
        })
    };
    let mut stretches: Vec<Range<usize>> = Vec::new();
    let mut start = None;
    for i in 0..=pair.len() {
        if i < pair.len() && stands(i) {
            start.get_or_insert(i);
        } else if let Some(first) = start.take() {
            let seconds = pair.seconds[i - 1] - pair.seconds[first];
            let is_near =
                stretches.first().is_none_or(|known| pair.seconds[first] - pair.seconds[known.start] < SEARCH_SECONDS);
            if seconds >= MIN_SECONDS && is_near {
                stretches.push(first..i);
            }
        }
    }
    let mut angles: Vec<f64> = stretches.iter().flat_map(|stretch| flexion[stretch.clone()].iter().copied()).collect();
    if angles.is_empty() {
        return None;
    }
    angles.sort_unstable_by(f64::total_cmp);
    let zero = angles[angles.len() / 2];
    let spread = (angles.iter().map(|angle| (angle - zero).powi(2)).sum::<f64>() / angles.len() as f64).sqrt();
    Some((zero, StandingZero { stretches, sd: STANDING_KNEE_SD.hypot(spread) }))
}
