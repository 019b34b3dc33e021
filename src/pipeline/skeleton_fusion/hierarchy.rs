//! The paper's fusion: a reference skeleton from the most stable frame of the camera, whose bones the units rotate from
//! the root outwards (\[fusion\] Eqs. 5 and 6).
//!
//! The paper writes the increment as `Δq = q_t* ⊗ q_{t+1}`, under its own convention of q. Here q takes the unit into
//! `earth`, and what rotates a bone in a common frame is the increment expressed there, `q_{t+1} ⊗ q_t*`. Increments
//! from the reference frame on multiply to the rotation between the two times, so nothing is accumulated.

use super::camera::CameraBody;
use super::motion::UnitMotion;
use crate::body::kinematics::Points;
use crate::body::skeleton::point_index;
use crate::body::{BONE_COUNT, Bone, Limb, Pose};
use crate::pipeline::joint_angles::inverse_kinematics::pose_from_points;
use crate::pipeline::joint_angles::observation::{ALL_SEEN, SeenMask, seen_mask};
use crate::signal::stillness::stillest_window;
use nalgebra::{UnitQuaternion, Vector3};

/// Time over which the most stable frame's neighbours are as still as it, seconds.
const STABLE_S: f64 = 0.5;

/// The rotation that takes a bone from its attitude at one time to that at another, in the frame that both attitudes
/// lead to (`common_from_imu`), whatever the unit's mounting.
#[doc(alias = "delta q")]
pub fn rotation_increment(before: &UnitQuaternion<f64>, after: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    after * before.inverse()
}

/// The skeleton that is rotated, and the attitudes that its units had then.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// Time of the frame, nanoseconds.
    pub time_ns: i64,
    points: Points,
    attitudes: [Option<UnitQuaternion<f64>>; BONE_COUNT],
}

/// The hierarchy over a recording.
#[derive(Debug)]
pub struct Hierarchy<'a> {
    motions: &'a [UnitMotion],
    /// Heading of each unit's common frame, radians, constant as in the paper.
    headings: Vec<f64>,
    reference: Reference,
    camera: &'a CameraBody,
}

impl<'a> Hierarchy<'a> {
    /// Finds the reference frame among those from `from_ns` on. `None` when no frame shows the whole body.
    pub fn new(camera: &'a CameraBody, motions: &'a [UnitMotion], headings: Vec<f64>, from_ns: i64) -> Option<Self> {
        let observations = &camera.observations;
        let first = observations.time_ns.partition_point(|t| *t < from_ns);
        let (times, points) = (&observations.time_ns[first..], &observations.points[first..]);
        let complete = |t: &usize| seen_mask(&points[*t]) == ALL_SEEN;
        let stable = stillest_window(times, points, STABLE_S, f64::INFINITY)
            .and_then(|w| ((w.frames.start + w.frames.end) / 2..w.frames.end).find(complete));
        let t = stable.or_else(|| (0..times.len()).find(complete))?;
        let mut attitudes = [None; BONE_COUNT];
        for (motion, heading) in motions.iter().zip(&headings) {
            attitudes[motion.bone.index()] = attitude(motion, *heading, times[t]);
        }
        let reference = Reference { time_ns: times[t], points: points[t], attitudes };
        Some(Self { motions, headings, reference, camera })
    }

    /// The frame that was found.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The twelve points relative to the torso joint at a time, in `subject`, metres, and those that rest on units of
    /// their own. A bone whose unit is silent turns with the bone that it hangs on.
    pub fn points(&self, time_ns: i64) -> (Points, SeenMask) {
        let mut turns = [None; BONE_COUNT];
        for (motion, heading) in self.motions.iter().zip(&self.headings) {
            let i = motion.bone.index();
            let now = attitude(motion, *heading, time_ns);
            turns[i] = self.reference.attitudes[i].zip(now).map(|(then, now)| rotation_increment(&then, &now));
        }
        let trunk = turns[Bone::Trunk.index()].unwrap_or_default();
        let mut points = [Vector3::zeros(); 12];
        let mut seen: SeenMask = 0;
        for limb in Limb::ALL {
            let at = |level| self.reference.points[point_index(limb, level)];
            let own = [Bone::Proximal(limb), Bone::Distal(limb)].map(|bone| turns[bone.index()]);
            let proximal = own[0].unwrap_or(trunk);
            let distal = own[1].unwrap_or(proximal);
            let first = point_index(limb, 0);
            points[first] = trunk * at(0);
            points[first + 1] = points[first] + proximal * (at(1) - at(0));
            points[first + 2] = points[first + 1] + distal * (at(2) - at(1));
            seen |= if turns[Bone::Trunk.index()].is_some() { 1 << first } else { 0 };
            seen |= if own[0].is_some() { 0b011 << first } else { 0 };
            seen |= if own[0].is_some() && own[1].is_some() { 0b111 << first } else { 0 };
        }
        (points, seen)
    }

    /// The posture of the rotated skeleton, and the points that rest on units.
    pub fn posture(&self, time_ns: i64, previous: &Pose) -> (Pose, SeenMask) {
        let (points, seen) = self.points(time_ns);
        (pose_from_points(self.camera.skeleton(), &points, previous), seen)
    }
}

/// `common_from_imu`: the unit's orientation turned to the heading of the frame that all units share.
fn attitude(motion: &UnitMotion, heading: f64, time_ns: i64) -> Option<UnitQuaternion<f64>> {
    let (_, earth_from_imu) = motion.at(time_ns)?;
    Some(UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading) * earth_from_imu)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    proptest! {
        #[test]
        fn a_unit_turned_about_the_vertical_turns_a_bone_about_it_whatever_the_mounting(
            mounting in prop::array::uniform3(-1.8..1.8f64),
        ) {
            let before = UnitQuaternion::new(Vector3::from(mounting));
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
            let bone = rotation_increment(&before, &(turn * before)) * Vector3::z();
            prop_assert!((bone - Vector3::x()).norm() < 1e-9, "{bone}");
            // The increment in the unit's own frame, as the formula reads under this convention, does something else.
            let other = (before.inverse() * turn * before) * Vector3::z();
            prop_assume!(before.angle() > 0.3 && before.axis().is_some_and(|a| a.y.abs() < 0.9));
            prop_assert!((other - Vector3::x()).norm() > 1e-3);
        }
    }
}
