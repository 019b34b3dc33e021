//! `occlusion`: a point that the sensor goes on to report although it does not see it, as when thighs hide the hips of a
//! seated person.
//!
//! Three signs: the sensor says that it infers the point (Kinect's confidence of 0.5) while the leg is bent; the
//! point's place stands still to the last bit while its neighbours' do not; or a bone of a bent leg has another length
//! than when the leg is straight, by more than a sensor's ordinary error. The first is told only; points of the other
//! two are taken out and bridged.

use super::{Finding, Scene, stretches};
use crate::body::skeleton::point_index;
use crate::body::{Limb, POINT_COUNT};
use crate::geometry::three_point::flexion_of_three_points;
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Shortest occlusion, seconds.
const SHORTEST_S: f64 = 0.5;
/// Knee flexion over which a leg is bent, and under which it is straight, radians (60° and 30°).
const BENT_RAD: f64 = std::f64::consts::FRAC_PI_3;
const STRAIGHT_RAD: f64 = std::f64::consts::FRAC_PI_6;
/// Confidence under which a sensor infers a point: between Kinect's 0.5 (inferred) and 1 (tracked).
const INFERRED_BELOW: f32 = 0.75;
/// Relative change of a bone that is implausible.
const IMPLAUSIBLE_CHANGE: f64 = 0.25;
/// Time over which points are averaged before bones are measured, to either side, seconds.
const AVERAGED_S: f64 = 0.25;
/// Largest share of exact repetitions in the places of a sensor that jitters. Fitted models and noise-free recordings
/// repeat a resting point's place without having lost it.
const REPEATED_SHARE: f64 = 0.2;
/// Straight-legged time that a bone's length is taken from, at the least, seconds.
const MIN_STRAIGHT_S: f64 = 0.5;

/// Hidden points; those that stand still or stretch a bone are taken out.
pub(super) fn find(scene: &mut Scene) -> Vec<Finding> {
    let mut told = vec![BTreeSet::new(); POINT_COUNT];
    let mut removed = vec![BTreeSet::new(); POINT_COUNT];
    for limb in [Limb::LeftLeg, Limb::RightLeg] {
        let bones = Bones::of(scene, limb);
        for level in 0..3 {
            let p = point_index(limb, level);
            told[p].extend(lasting(scene, |t| bones.is_bent(t) && is_inferred(scene, t, p)));
            removed[p].extend(lasting(scene, |t| bones.blamed(t) == Some(level)));
        }
    }
    if jitters(scene) {
        for (p, frames) in removed.iter_mut().enumerate() {
            frames.extend(lasting(scene, |t| stands_still(scene, t, p)));
        }
    }
    let mut found = Vec::new();
    for p in 0..POINT_COUNT {
        let concerned = |t: usize| told[p].contains(&t) || removed[p].contains(&t);
        for frames in stretches(scene.len(), concerned) {
            found.push(Finding::of_frames(scene.joint(p).name(), frames));
        }
        for t in &removed[p] {
            scene.reject(*t, p);
        }
    }
    found
}

/// Frames of the stretches that last long enough.
fn lasting(scene: &Scene, holds: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut found = stretches(scene.len(), holds);
    found.retain(|frames| scene.seconds(frames.end - 1) - scene.seconds(frames.start) >= SHORTEST_S);
    found.into_iter().flatten().collect()
}

/// True when the sensor gives a point but says that it infers it.
fn is_inferred(scene: &Scene, t: usize, point: usize) -> bool {
    let column = scene.columns[point];
    scene.gives(t, column) && scene.skeleton.frame_confidence(t)[column] < INFERRED_BELOW
}

/// True when the sensor's places are rarely those of the frame before, to the last bit.
fn jitters(scene: &Scene) -> bool {
    let repeated = |t: usize| {
        let (before, after) = (scene.skeleton.frame(t - 1), scene.skeleton.frame(t));
        scene.columns.iter().filter(|c| before[**c] == after[**c]).count()
    };
    let all = POINT_COUNT * scene.len();
    (1..scene.len()).map(repeated).sum::<usize>() as f64 <= REPEATED_SHARE * all as f64
}

/// True when a point has exactly its last place while at least half of the other points moved.
fn stands_still(scene: &Scene, t: usize, point: usize) -> bool {
    if t == 0 {
        return false;
    }
    let (before, after) = (scene.skeleton.frame(t - 1), scene.skeleton.frame(t));
    let is_still = |column: usize| before[column] == after[column];
    let moving = scene.columns.iter().filter(|c| before[**c] != after[**c] && after[**c].x.is_finite()).count();
    is_still(scene.columns[point]) && 2 * moving >= POINT_COUNT
}

/// A leg's bones over time, from averaged points.
struct Bones {
    flexion: Vec<f64>,
    /// Relative change of thigh and shank from their lengths in a straight leg; NaN where unknown.
    change: [Vec<f64>; 2],
}

impl Bones {
    fn of(scene: &Scene, limb: Limb) -> Self {
        let averaged: [Vec<Vector3<f64>>; 3] = std::array::from_fn(|level| averaged(scene, point_index(limb, level)));
        let flexion: Vec<f64> = (0..scene.len())
            .map(|t| flexion_of_three_points(&averaged[0][t], &averaged[1][t], &averaged[2][t]))
            .collect();
        let change = [0, 1].map(|bone| {
            let length = |t: usize| (averaged[bone + 1][t] - averaged[bone][t]).norm();
            let straight: Vec<usize> = (0..scene.len()).filter(|t| flexion[*t] < STRAIGHT_RAD).collect();
            let mut lengths: Vec<f64> = straight.iter().map(|t| length(*t)).filter(|l| l.is_finite()).collect();
            let is_known = lengths.len() as f64 * scene.median_interval_s() >= MIN_STRAIGHT_S;
            lengths.sort_by(f64::total_cmp);
            let usual = if is_known { lengths[lengths.len() / 2] } else { f64::NAN };
            (0..scene.len()).map(|t| length(t) / usual - 1.0).collect()
        });
        Self { flexion, change }
    }

    fn is_bent(&self, t: usize) -> bool {
        self.flexion[t] > BENT_RAD
    }

    /// The point of a bent leg to which implausible bones point: the hip of a wrong thigh, the foot of a wrong shank,
    /// the knee of both.
    fn blamed(&self, t: usize) -> Option<usize> {
        if !self.is_bent(t) {
            return None;
        }
        match [0, 1].map(|bone| self.change[bone][t].abs() > IMPLAUSIBLE_CHANGE) {
            [true, false] => Some(0),
            [true, true] => Some(1),
            [false, true] => Some(2),
            [false, false] => None,
        }
    }
}

/// A point's mean place around each frame in which it was seen; NaN elsewhere.
fn averaged(scene: &Scene, point: usize) -> Vec<Vector3<f64>> {
    let (mut from, mut to) = (0, 0);
    let mut sum = Vector3::zeros();
    let mut count = 0_u32;
    let place = |t: usize| scene.observations.points[t][point];
    let mut means = Vec::with_capacity(scene.len());
    for t in 0..scene.len() {
        while to < scene.len() && scene.seconds(to) <= scene.seconds(t) + AVERAGED_S {
            if place(to).x.is_finite() {
                sum += place(to);
                count += 1;
            }
            to += 1;
        }
        while scene.seconds(from) < scene.seconds(t) - AVERAGED_S {
            if place(from).x.is_finite() {
                sum -= place(from);
                count -= 1;
            }
            from += 1;
        }
        let is_seen = place(t).x.is_finite();
        means.push(if is_seen { sum / f64::from(count) } else { Vector3::repeat(f64::NAN) });
    }
    means
}
