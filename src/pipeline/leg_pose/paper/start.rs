//! Where the legs are when nothing is known of them: a first state from one foreground, without a hand.
//!
//! The points between ankle and knee are split into two clusters, side by side or one before the other; their lower parts
//! are the ankles, and hips stand above the middle of both. Lengths are those of an average adult; the filter's search
//! finds the rest.

use crate::body::legs::bounds;
use crate::body::legs::kinematics::ANKLE_HEIGHT;
use crate::body::legs::{LegAngles, LegState};
use crate::geometry::floor::Floor;
use nalgebra::Vector3;

/// Stature of the first guess, metres: an average adult.
const STATURE: f64 = 1.68;
/// Heights above the floor between which legs are two clusters, metres.
const CALVES: [f64; 2] = [0.08, 0.40];
/// Heights of the lower part of the calves, whose centre is the ankle's place, metres.
const ANKLES_BELOW: f64 = 0.20;
/// From the seen front to the axis of a calf near the ankle, metres.
const CALF_DEPTH: f64 = 0.03;
/// Fewest points of each leg.
const LEAST_POINTS: usize = 12;
/// Rounds of the clustering; it settles in a few.
const ROUNDS: usize = 20;
/// Share of a straight leg's length between hip and ankle in the first guess.
const STRETCH: f64 = 0.985;

/// A first state for the points of a foreground (in `sensor`, metres). `None` when they are not two legs.
pub fn first_state(points: &[[f32; 3]], floor: &Floor) -> Option<LegState> {
    let floor_from_sensor = floor.sensor_from_floor().inverse();
    let calves: Vec<Vector3<f64>> = points
        .iter()
        .map(|point| floor_from_sensor * Vector3::from(point.map(f64::from)))
        .map(|point| Vector3::new(point.x, point.y + floor.camera_height, point.z))
        .filter(|point| (CALVES[0]..CALVES[1]).contains(&point.y))
        .collect();
    let is_right = two_clusters(&calves)?;
    let ankle = |right: bool| {
        let own = || calves.iter().zip(&is_right).filter(|(_, is_right)| **is_right == right).map(|(point, _)| *point);
        if own().count() < LEAST_POINTS {
            return None;
        }
        let low: Vec<_> = own().filter(|point| point.y < ANKLES_BELOW).collect();
        let used = if low.len() < LEAST_POINTS { own().collect() } else { low };
        Some(used.iter().sum::<Vector3<f64>>() / used.len() as f64)
    };
    let ankles = [ankle(false)?, ankle(true)?];
    Some(state_over(ankles, floor))
}

/// Which points belong to the right leg, by two means over the floor's plane; the right leg is the one to the right (Z).
fn two_clusters(points: &[Vector3<f64>]) -> Option<Vec<bool>> {
    if points.len() < 2 * LEAST_POINTS {
        return None;
    }
    let mut across: Vec<f64> = points.iter().map(|point| point.z).collect();
    across.sort_unstable_by(f64::total_cmp);
    let middle = points.iter().map(|point| point.x).sum::<f64>() / points.len() as f64;
    let quantile = |share: f64| across[((across.len() - 1) as f64 * share) as usize];
    let mut centres = [0.1, 0.9].map(|share| [middle, quantile(share)]);
    let mut is_right = vec![false; points.len()];
    for _ in 0..ROUNDS {
        let (mut sums, mut counts) = ([[0.0; 2]; 2], [0usize; 2]);
        for (point, is_right) in points.iter().zip(&mut is_right) {
            let squared = |centre: &[f64; 2]| (point.x - centre[0]).powi(2) + (point.z - centre[1]).powi(2);
            *is_right = squared(&centres[1]) < squared(&centres[0]);
            let own = usize::from(*is_right);
            sums[own] = [sums[own][0] + point.x, sums[own][1] + point.z];
            counts[own] += 1;
        }
        for leg in 0..2 {
            if counts[leg] < LEAST_POINTS {
                return None;
            }
            centres[leg] = sums[leg].map(|sum| sum / counts[leg] as f64);
        }
    }
    if centres[1][1] < centres[0][1] {
        for is_right in &mut is_right {
            *is_right = !*is_right;
        }
    }
    Some(is_right)
}

/// Legs that reach from hips above the middle to two ankles (floor axes, metres; left, right).
fn state_over(ankles: [Vector3<f64>; 2], floor: &Floor) -> LegState {
    let mut state = LegState::upright(STATURE, Vector3::zeros());
    let ankles = ankles.map(|ankle| Vector3::new(ankle.x - CALF_DEPTH, ANKLE_HEIGHT * state.foot, ankle.z));
    let middle = (ankles[0] + ankles[1]) * 0.5;
    let [low, high] = bounds::bounds(0);
    state.hip_distance = (ankles[1].z - ankles[0].z).clamp(state.hip_distance.max(low), high);
    let reach = STRETCH * (state.thigh + state.calf);
    let mut hips = [-0.5, 0.5].map(|side| Vector3::new(middle.x, 0.0, middle.z + side * state.hip_distance));
    let height = |leg: usize| {
        let (dx, dz) = (hips[leg].x - ankles[leg].x, hips[leg].z - ankles[leg].z);
        ankles[leg].y + (reach * reach - dx * dx - dz * dz).max(0.25 * reach * reach).sqrt()
    };
    let height = height(0).min(height(1));
    for leg in 0..2 {
        hips[leg].y = height;
        let outward = if leg == 0 { -1.0 } else { 1.0 };
        state.angles[leg] = reach_for(&(ankles[leg] - hips[leg]), &state, outward);
    }
    let hip_in_floor = Vector3::new(hips[1].x, hips[1].y - floor.camera_height, hips[1].z);
    state.right_hip = floor.sensor_from_floor() * hip_in_floor;
    LegState::from_vector(&bounds::clamp(&state.to_vector()))
}

/// Angles that take the ankle to a place relative to the hip (pelvis axes), the foot level.
fn reach_for(ankle: &Vector3<f64>, state: &LegState, outward: f64) -> LegAngles {
    let (thigh, calf) = (state.thigh, state.calf);
    let distance = ankle.norm().min(thigh + calf);
    let cosine = (thigh * thigh + calf * calf - distance * distance) / (2.0 * thigh * calf);
    let knee = std::f64::consts::PI - cosine.clamp(-1.0, 1.0).acos();
    // The ankle in the plane of the bent leg, thigh upright; then turned sideways, then forward.
    let (behind, below) = (-calf * knee.sin(), -(thigh + calf * knee.cos()));
    let sideways = (ankle.z / below).clamp(-1.0, 1.0).asin();
    let lowered = below * sideways.cos();
    let flexion = ankle.y.atan2(ankle.x) - lowered.atan2(behind);
    LegAngles { hip: [flexion, -outward * sideways, 0.0], knee, ankle: [knee - flexion, 0.0] }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{floor, foreground, image, walking};
    use super::*;
    use crate::body::legs::constraints::stand;
    use crate::body::legs::forward_kinematics;

    #[test]
    fn ankles_of_a_walker_are_found_within_some_centimetres_at_every_phase() {
        for k in 0..12 {
            let (_, pose, solids) = walking(f64::from(k) * std::f64::consts::FRAC_PI_6);
            let state = first_state(&foreground(&image(&solids)).points, &floor()).expect("two legs");
            let found = stand(&state, &floor()).1;
            for side in 0..2 {
                let error = (found.sides[side].ankle - pose.sides[side].ankle).norm();
                // A swinging foot is up to 14 cm higher than the guess puts it.
                assert!(error < 0.16, "phase {k}, side {side}: {error}");
            }
        }
    }

    #[test]
    fn angles_of_a_reach_bring_the_ankle_there() {
        let mut state = LegState::upright(1.7, Vector3::new(0.0, 0.0, 1.0));
        let target = Vector3::new(0.2, -0.72, 0.06);
        state.angles[1] = reach_for(&target, &state, 1.0);
        let level = Floor::under_camera(0.7, 0.0);
        let pose = forward_kinematics(&state, &level);
        let found = level.sensor_from_floor().inverse() * (pose.sides[1].ankle - pose.sides[1].hip);
        assert!((found - target).norm() < 1e-9, "{found}");
        assert!((pose.sides[1].dorsal - level.sensor_from_floor() * Vector3::y()).norm() < 0.1, "the foot is level");
    }

    #[test]
    fn no_legs_give_no_state() {
        assert!(first_state(&[], &floor()).is_none());
        assert!(first_state(&[[0.0, 0.6, 0.9]; 500], &floor()).is_none());
        assert!(first_state(&[[f32::NAN; 3]; 500], &floor()).is_none());
    }
}
