//! The moments at which camera and units are compared, and those at which the person stands still.

use super::alignment::{Moment, Standing};
use super::camera::{BoneVector, CameraBody};
use super::motion::UnitMotion;
use crate::body::{Bone, Limb};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Time between moments, seconds, and the most of them: errors of a camera last longer than the former, and more of them
/// than the latter only repeat each other.
const SPACING_S: f64 = 0.1;
const MOST_MOMENTS: f64 = 1200.0;

/// Angular rate of every unit, radians per second (12 °/s), and time for which it must stay below, seconds, for a person
/// to stand still. Sway turns the trunk by some degrees per second.
const STILL_RATE: f64 = 12.0 * PI / 180.0;
const STILL_FOR_S: f64 = 1.0;
/// Longest part of that time that is used, seconds: whoever stands longer begins to shift.
const STILL_AT_MOST_S: f64 = 4.0;

/// Bend of a limb as the camera sees it, radians (35°), beyond which it is not held straight. The camera's own error is
/// up to half of that.
const STRAIGHT_WITHIN: f64 = 35.0 * PI / 180.0;

/// Flexion of hinges in a person who stands still, mean and standard deviation, radians. Knees are not locked; an arm
/// that is held out is nearly straight, one that hangs is bent a little. Ours, without a source.
const STANDING_KNEE: (f64, f64) = (3.0 * PI / 180.0, 3.0 * PI / 180.0);
const SPREAD_ELBOW: (f64, f64) = (4.0 * PI / 180.0, 4.0 * PI / 180.0);
const HANGING_ELBOW: (f64, f64) = (12.0 * PI / 180.0, 6.0 * PI / 180.0);

/// Cosine of the angle to the vertical (45°) from which on an arm is held out rather than hanging.
const HANGING_FROM: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Moments of a recording from `from_ns` on: at the camera's frames, or at a regular beat without a camera.
pub fn moments(camera: Option<&CameraBody>, motions: &[UnitMotion], from_ns: i64) -> Vec<Moment> {
    let vectors = BoneVector::all();
    let times = match camera {
        Some(camera) => camera.observations.time_ns.clone(),
        None => beat(motions),
    };
    let (Some(first), Some(last)) = (times.iter().find(|t| **t >= from_ns), times.last()) else { return Vec::new() };
    let spacing_s = SPACING_S.max((last - first) as f64 * 1e-9 / MOST_MOMENTS);
    let spacing_ns = (spacing_s * 1e9) as i64;
    let mut moments: Vec<Moment> = Vec::new();
    for (frame, time_ns) in times.iter().enumerate().filter(|(_, time)| **time >= from_ns) {
        if moments.last().is_some_and(|last| time_ns - last.time_ns < spacing_ns * 9 / 10) {
            continue;
        }
        let seen = |vector: &BoneVector| match camera {
            Some(camera) => vector.of_points(&camera.observations.points[frame]),
            None => Vector3::repeat(f64::NAN),
        };
        let vectors = vectors.iter().map(seen).collect();
        let units = motions.iter().map(|motion| motion.at(*time_ns)).collect();
        moments.push(Moment { time_ns: *time_ns, interval_s: spacing_s, vectors, units, standing: None });
    }
    mark_standing(&mut moments, motions);
    moments
}

/// The first time after `from_ns` from which on all units rest for a while: handled units do not.
pub fn rest_of_all(motions: &[UnitMotion], from_ns: i64) -> Option<i64> {
    let is_still = |time_ns: i64| {
        motions.iter().all(|motion| {
            motion.at(time_ns).is_some_and(|(s, _)| mean_rate(&motion.stretches[s], time_ns) < STILL_RATE)
        })
    };
    let mut since = None;
    for time_ns in beat(motions).into_iter().filter(|time| *time > from_ns) {
        if !is_still(time_ns) {
            since = None;
            continue;
        }
        let start = *since.get_or_insert(time_ns);
        if (time_ns - start) as f64 * 1e-9 >= STILL_FOR_S {
            return Some(start);
        }
    }
    None
}

/// A regular beat over all units' time, nanoseconds.
fn beat(motions: &[UnitMotion]) -> Vec<i64> {
    let spans = || motions.iter().filter_map(UnitMotion::span_ns);
    let (Some(first), Some(last)) = (spans().map(|[first, _]| first).min(), spans().map(|[_, last]| last).max()) else {
        return Vec::new();
    };
    (first..=last).step_by((SPACING_S * 1e9) as usize).collect()
}

/// Marks the first time at which a person stands still and straight.
fn mark_standing(moments: &mut [Moment], motions: &[UnitMotion]) {
    let vectors = BoneVector::all();
    let is_still: Vec<bool> = moments.iter().map(|moment| stands_still(moment, &vectors, motions)).collect();
    let mut start = 0;
    while start < moments.len() {
        let mut end = start;
        while end < moments.len() && is_still[end] {
            end += 1;
        }
        let seconds = |range: std::ops::Range<usize>| {
            range.last().map_or(0.0, |last| (moments[last].time_ns - moments[start].time_ns) as f64 * 1e-9)
        };
        if seconds(start..end) >= STILL_FOR_S {
            let used = moments[start..end]
                .iter()
                .take_while(|moment| (moment.time_ns - moments[start].time_ns) as f64 * 1e-9 <= STILL_AT_MOST_S);
            let end = start + used.count();
            for moment in &mut moments[start..end] {
                moment.standing = Some(standing(moment, &vectors));
            }
            return;
        }
        start = end + 1;
    }
}

/// True when no unit turns and no leg that the camera sees is bent.
fn stands_still(moment: &Moment, vectors: &[BoneVector], motions: &[UnitMotion]) -> bool {
    let mut n_units = 0;
    for motion in motions {
        let Some((stretch, _)) = motion.at(moment.time_ns) else { continue };
        n_units += 1;
        if mean_rate(&motion.stretches[stretch], moment.time_ns) > STILL_RATE {
            return false;
        }
    }
    let legs_straight = [Limb::LeftLeg, Limb::RightLeg]
        .into_iter()
        .all(|leg| moment.bend(vectors, leg).is_none_or(|b| b < STRAIGHT_WITHIN));
    n_units > 0 && legs_straight
}

/// Mean magnitude of the angular rate around a time, radians per second.
fn mean_rate(stretch: &super::motion::Stretch, time_ns: i64) -> f64 {
    const HALF_NS: i64 = 100_000_000;
    let from = stretch.time_ns.partition_point(|t| *t < time_ns - HALF_NS);
    let to = stretch.time_ns.partition_point(|t| *t <= time_ns + HALF_NS);
    let rates = &stretch.angular_rate[from..to];
    rates.iter().map(|rate| rate.norm()).sum::<f64>() / rates.len().max(1) as f64
}

/// What is known of the hinges of a person who stands still.
fn standing(moment: &Moment, vectors: &[BoneVector]) -> Standing {
    let hinges = Limb::ALL.map(|limb| {
        if !limb.is_arm() {
            return Some(STANDING_KNEE);
        }
        if moment.bend(vectors, limb)? > STRAIGHT_WITHIN {
            return None;
        }
        let down = -moment.along(vectors, Bone::Proximal(limb))?.normalize().y;
        Some(if down < HANGING_FROM { SPREAD_ELBOW } else { HANGING_ELBOW })
    });
    Standing { hinges }
}
