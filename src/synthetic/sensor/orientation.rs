//! Joint orientations as body-tracking software gives them: noisy, worst about the axis of a straight limb, and
//! sometimes turned by 180° about it.
//!
//! A joint's own axes are those of `subject` in the T-posture (X forward, Y up, Z to the right) and move with the
//! segment that begins at the joint: thigh at the hip, shank at the knee, upper arm at the shoulder, forearm at the
//! elbow, trunk at the torso joint. Other joints have none.

use super::episode::{Episodes, episodes};
use super::standard_normals;
use crate::body::{Joint, Limb, Pose};
use crate::geometry::attitude::rotation_from_attitude;
use crate::recording::SkeletonRecording;
use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};
use rand::Rng;
use std::f64::consts::PI;

/// How orientations are disturbed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientationNoise {
    /// Standard deviation about each axis, degrees.
    pub sd_deg: f64,
    /// Further standard deviation about the long axis of a straight limb, degrees; it falls with the hinge's flexion.
    pub axial_sd_deg: f64,
    /// Turns by 180° about the long axis, by segment.
    pub flips: Episodes,
}

/// Time constant of the noise, seconds: it wanders rather than jitters.
const TIME_CONSTANT_S: f64 = 0.4;

/// Hinge flexion at which the further axial noise has fallen to 1/e, radians.
const AXIAL_SCALE_RAD: f64 = 25.0 * PI / 180.0;

/// `world_from_joint` of every joint that begins a segment, in the order of `joints`.
pub fn world_from_joints(
    joints: &[Joint],
    pose: &Pose,
    world_from_subject: &Rotation3<f64>,
) -> Vec<Option<UnitQuaternion<f64>>> {
    let world_from_trunk = world_from_subject * pose.trunk;
    joints
        .iter()
        .map(|joint| {
            let rotation = match segment_of(*joint)? {
                Segment::Trunk => world_from_trunk,
                Segment::Proximal(limb) => world_from_trunk * pose.limbs[limb.index()],
                Segment::Distal(limb) => world_from_trunk * pose.limbs[limb.index()] * hinge_rotation(limb, pose),
            };
            Some(UnitQuaternion::from_rotation_matrix(&rotation))
        })
        .collect()
}

/// Disturbs the orientations of a recording; `poses` holds the true posture of each frame.
pub fn disturb(skeleton: &mut SkeletonRecording, poses: &[Pose], noise: OrientationNoise, rng: &mut impl Rng) {
    let n = skeleton.joints.len();
    for column in 0..n {
        let Some(segment) = segment_of(skeleton.joints[column]) else { continue };
        let (axis, limb) = match segment {
            Segment::Trunk => (Vector3::y(), None),
            Segment::Proximal(limb) | Segment::Distal(limb) => (limb.reference_direction(), Some(limb)),
        };
        let mut error = standard_normals(rng);
        let mut axial = standard_normals(rng).x;
        let mut before = 0;
        for (t, pose) in poses.iter().enumerate() {
            let elapsed = (skeleton.time_ns[t] - before) as f64 * 1e-9;
            before = skeleton.time_ns[t];
            // A first-order process that keeps its variance whatever the time between frames.
            let kept = (-elapsed / TIME_CONSTANT_S).exp();
            let fresh = (1.0 - kept * kept).max(0.0).sqrt();
            error = error * kept + standard_normals(rng) * fresh;
            axial = axial * kept + standard_normals(rng).x * fresh;
            let straightness = limb.map_or(0.0, |limb| (-(pose.hinges[limb.index()] / AXIAL_SCALE_RAD).powi(2)).exp());
            let attitude =
                error * noise.sd_deg.to_radians() + axis * (axial * noise.axial_sd_deg.to_radians() * straightness);
            turn(skeleton, t * n + column, &rotation_from_attitude(&attitude));
        }
        if limb.is_some() {
            let flip = Rotation3::from_axis_angle(&Unit::new_normalize(axis), PI);
            for t in episodes(&skeleton.time_ns, noise.flips, rng).into_iter().flatten() {
                turn(skeleton, t * n + column, &flip);
            }
        }
    }
}

enum Segment {
    Trunk,
    Proximal(Limb),
    Distal(Limb),
}

fn segment_of(joint: Joint) -> Option<Segment> {
    if joint == Joint::Torso {
        return Some(Segment::Trunk);
    }
    Limb::ALL.into_iter().find_map(|limb| {
        let [root, middle, _] = limb.joints();
        match joint {
            _ if joint == root.0 => Some(Segment::Proximal(limb)),
            _ if joint == middle.0 => Some(Segment::Distal(limb)),
            _ => None,
        }
    })
}

fn hinge_rotation(limb: Limb, pose: &Pose) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Unit::new_normalize(limb.hinge_axis()), pose.hinges[limb.index()])
}

/// Turns an orientation in the joint's own axes.
fn turn(skeleton: &mut SkeletonRecording, i: usize, by: &Rotation3<f64>) {
    if let Some(Some(orientation)) = skeleton.orientations.get_mut(i) {
        *orientation *= UnitQuaternion::from_rotation_matrix(by);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Skeleton;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::pose::PoseVector;
    use crate::body::skeleton::point_index;

    #[test]
    fn orientations_carry_the_segments_to_where_the_joints_are() {
        let skeleton = Skeleton::of_stature(1.7);
        let pose = Pose::from_vector(&PoseVector::from_fn(|i, _| 0.1 + 0.04 * i as f64));
        let points = forward_kinematics(&skeleton, &pose);
        let joints: Vec<Joint> = Limb::ALL.iter().flat_map(|limb| limb.joints().map(|(joint, _)| joint)).collect();
        let turns = world_from_joints(&joints, &pose, &Rotation3::identity());
        for limb in Limb::ALL {
            for (level, length) in [(0, skeleton.proximal[limb.index()]), (1, skeleton.distal[limb.index()])] {
                let i = point_index(limb, level);
                let along = turns[i].unwrap() * limb.reference_direction() * length;
                assert!((points[i + 1] - points[i] - along).norm() < 1e-12, "{limb:?} {level}");
            }
            assert_eq!(turns[point_index(limb, 2)], None);
        }
    }
}
