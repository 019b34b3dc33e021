//! `hand_jump` and `foot_jump`: the end of a limb is somewhere else for some frames, with full confidence, and returns.
//!
//! A jump is a rectangular pulse on top of a movement. For every short stretch of frames a cubic and a pulse are fitted
//! to the stretch and its surroundings; with the recording's own white noise of standard deviation σ the pulse of height
//! `h` has
//!
//! ```text
//! q = w Σ h² / σ²        χ² with three degrees of freedom where nothing jumped
//! ```
//!
//! Quick movement is no cubic either, therefore both edges must be quicker than a limb can move.

use super::polynomial::fit_pulse;
use super::{Finding, Scene};
use crate::body::Limb;
use crate::body::skeleton::point_index;
use nalgebra::Vector3;
use std::ops::Range;

/// Longest jump, seconds: what stays away longer is another place, not a jump.
const LONGEST_S: f64 = 0.3;
/// What is looked at before and after, seconds.
const SURROUNDINGS_S: f64 = 0.25;
/// Fewest samples on either side.
const MIN_SURROUNDINGS: usize = 3;
/// Speed of hand or foot against the torso that no exercise reaches, m/s; the same bound as for imported data.
const MAX_SPEED: f64 = 7.5;
/// Shortest jump, metres: with fast cameras a shorter one is below the errors of a good sensor.
const SHORTEST_M: f64 = 0.15;
/// Least q: white noise reaches it once in 10⁷ stretches.
const MIN_Q: f64 = 30.0;
/// Share of the pulse's height that each edge must have, beside the white noise of an edge.
const EDGE_SHARE: f64 = 0.7;
/// Times that a joint is searched, each with the jumps found before taken out of the surroundings.
const ROUNDS: usize = 4;
/// How far from a jump others may have been judged wrongly because of it, seconds.
const REACH_S: f64 = SURROUNDINGS_S + LONGEST_S;

/// Jumping hands, which are taken out.
pub(super) fn find_hands(scene: &mut Scene) -> Vec<Finding> {
    find(scene, [Limb::LeftArm, Limb::RightArm])
}

/// Jumping feet, which are taken out.
pub(super) fn find_feet(scene: &mut Scene) -> Vec<Finding> {
    find(scene, [Limb::LeftLeg, Limb::RightLeg])
}

fn find(scene: &mut Scene, limbs: [Limb; 2]) -> Vec<Finding> {
    let mut found = Vec::new();
    for point in limbs.map(|limb| point_index(limb, 2)) {
        let mut unsettled: Vec<f64> = Vec::new();
        for round in 0..ROUNDS {
            let near = |time: f64| {
                let next = unsettled.partition_point(|t| *t < time - REACH_S);
                round == 0 || unsettled.get(next).is_some_and(|t| *t <= time + REACH_S)
            };
            let jumps = jumps_of(scene, point, near);
            if jumps.is_empty() {
                break;
            }
            unsettled = jumps.iter().flatten().map(|t| scene.seconds(*t)).collect();
            unsettled.sort_by(f64::total_cmp);
            for frames in jumps {
                for t in frames.clone() {
                    scene.reject(t, point);
                }
                let (first, last) = (frames[0], frames[frames.len() - 1]);
                let n_frames = frames.len() as u64;
                found.push(Finding { subject: scene.joint(point).name().to_owned(), first, last, n_frames });
            }
        }
    }
    found
}

/// Frames of each jump of a point that stands clear of the others; it begins at a time that is `near`.
fn jumps_of(scene: &Scene, point: usize, near: impl Fn(f64) -> bool) -> Vec<Vec<usize>> {
    let track = Track::of(scene, point);
    let mut candidates = Vec::new();
    for start in (0..track.times.len()).filter(|start| near(track.times[*start])) {
        for end in start + 1..track.times.len() {
            if track.times[end - 1] - track.times[start] > LONGEST_S {
                break;
            }
            if let Some(q) = track.jump(start..end) {
                candidates.push((q, start..end));
            }
        }
    }
    // The clearest first. What lies in the surroundings of a jump is judged again when the jump is out.
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut accepted: Vec<Range<usize>> = Vec::new();
    for (_, inside) in candidates {
        let around = track.around(&inside);
        if accepted.iter().all(|other| around.end <= other.start || other.end <= around.start) {
            accepted.push(inside);
        }
    }
    accepted.into_iter().map(|inside| track.frames[inside].to_vec()).collect()
}

/// The frames in which a point was seen.
struct Track {
    frames: Vec<usize>,
    times: Vec<f64>,
    places: Vec<Vector3<f64>>,
    /// Inverse variance of the white noise of each coordinate, m⁻².
    precision: Vector3<f64>,
    /// Height of a pulse under which it is no jump, metres.
    min_height: f64,
}

impl Track {
    fn of(scene: &Scene, point: usize) -> Self {
        /// Least white noise, metres: a noise-free recording must not make every bend of a path significant.
        const LEAST_WHITE: f64 = 0.001;
        let place = |t: usize| scene.observations.points[t][point];
        let frames: Vec<usize> = (0..scene.len()).filter(|t| place(*t).x.is_finite()).collect();
        Self {
            times: frames.iter().map(|t| scene.seconds(*t)).collect(),
            places: frames.iter().map(|t| place(*t)).collect(),
            frames,
            precision: scene.white[point].map(|sd| sd.max(LEAST_WHITE).powi(-2)),
            min_height: (MAX_SPEED * scene.median_interval_s()).max(SHORTEST_M),
        }
    }

    /// Samples of a stretch and its surroundings.
    fn around(&self, inside: &Range<usize>) -> Range<usize> {
        let (from, to) = (self.times[inside.start] - SURROUNDINGS_S, self.times[inside.end - 1] + SURROUNDINGS_S);
        self.times.partition_point(|t| *t < from)..self.times.partition_point(|t| *t <= to)
    }

    /// How clearly a stretch is a jump (q); `None` when it is none.
    fn jump(&self, inside: Range<usize>) -> Option<f64> {
        let after = self.places.get(inside.end)?;
        let before = &self.places[inside.start.checked_sub(1)?];
        let (into, out_of) = (self.places[inside.start] - before, self.places[inside.end - 1] - after);
        // Cheap and true of nearly every movement: it does not leave and return the same way within a frame each.
        let least_edge = (EDGE_SHARE * self.min_height).powi(2);
        if into.norm_squared() < least_edge || out_of.norm_squared() < least_edge || self.weighted(&into, &out_of) < 0.0
        {
            return None;
        }
        let around = self.around(&inside);
        if inside.start - around.start < MIN_SURROUNDINGS || around.end - inside.end < MIN_SURROUNDINGS {
            return None;
        }
        let local = inside.start - around.start..inside.end - around.start;
        let pulse = fit_pulse(&self.times[around.clone()], &self.places[around], local)?;
        let q_sample = self.weighted(&pulse.height, &pulse.height);
        let q = pulse.power * q_sample;
        if q < MIN_Q || pulse.height.norm() < self.min_height {
            return None;
        }
        // An edge is the difference of two samples; its share of the height has this standard deviation.
        let edge_sd = (2.0 / q_sample).sqrt();
        let is_edge = |edge: &Vector3<f64>| self.weighted(edge, &pulse.height) / q_sample > EDGE_SHARE - 3.0 * edge_sd;
        (is_edge(&into) && is_edge(&out_of)).then_some(q)
    }

    /// Product of two vectors in units of the white noise.
    fn weighted(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        a.component_mul(b).dot(&self.precision)
    }
}
