//! Anatomical angles of a posture, their sign conventions, and how an error of the posture spreads into them.
//!
//! Flexion, abduction and internal rotation are positive on both sides: a left limb is mirrored in the sagittal plane
//! before it is decomposed, so both sides share the formulas of the right one. Hip and trunk are Z-X-Y, the shoulder
//! is Y-X-Y (ISB; Z-X-Y is singular in the T-posture).

use super::joint::Side;
use super::pose::{POSE_DIMENSION, Pose, PoseVector, attitude_offset, hinge_offset};
use super::skeleton::Limb;
use crate::geometry::euler::{yxy_from_rotation, zxy_from_rotation};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Number of anatomical angles.
pub const ANGLE_COUNT: usize = 19;

/// Anatomical angles in radians: trunk flexion, lateral bending, axial rotation; for the left then the right side
/// shoulder plane, elevation, axial rotation, elbow flexion; for the left then the right side hip flexion, abduction,
/// axial rotation, knee flexion.
pub type Angles = SVector<f64, ANGLE_COUNT>;

/// Hinge flexion (15°) under which the joint centres say nothing of the axial rotation of the proximal segment.
pub const AXIAL_OBSERVABLE_FROM_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// First angle of a side's arm in [`Angles`].
pub fn arm_offset(side: Side) -> usize {
    if side == Side::Left { 3 } else { 7 }
}

/// First angle of a side's leg in [`Angles`].
pub fn leg_offset(side: Side) -> usize {
    if side == Side::Left { 11 } else { 15 }
}

/// Angles of a posture, and which decompositions are singular in it (by angle).
pub fn angles_of_pose(pose: &Pose) -> (Angles, [bool; ANGLE_COUNT]) {
    let mut angles = Angles::zeros();
    let mut singular = [false; ANGLE_COUNT];
    let trunk = zxy_from_rotation(&pose.trunk);
    // A turn about +Z tips the trunk backwards and one about +X to the right: bending forwards is −Z.
    set(&mut angles, &mut singular, 0, [-trunk.first, trunk.second, trunk.third], trunk.is_singular);
    for limb in Limb::ALL {
        let rotation = as_right_side(limb, &pose.limbs[limb.index()]);
        let hinge = pose.hinges[limb.index()];
        if limb.is_arm() {
            let humerus = yxy_from_rotation(&(rotation * t_posture_from_hanging()));
            let start = arm_offset(limb.side());
            let values = [humerus.first, -humerus.second, humerus.third];
            set(&mut angles, &mut singular, start, values, humerus.is_singular);
            angles[start + 3] = hinge;
        } else {
            let thigh = zxy_from_rotation(&rotation);
            let start = leg_offset(limb.side());
            set(&mut angles, &mut singular, start, [thigh.first, -thigh.second, thigh.third], thigh.is_singular);
            angles[start + 3] = hinge;
        }
    }
    (angles, singular)
}

/// Which axial rotations the joint centres do not determine in a posture (by angle).
pub fn unobservable_angles(pose: &Pose) -> [bool; ANGLE_COUNT] {
    let mut unobservable = [false; ANGLE_COUNT];
    for limb in Limb::ALL {
        if pose.hinges[limb.index()].abs() < AXIAL_OBSERVABLE_FROM_RAD {
            let start = if limb.is_arm() { arm_offset(limb.side()) } else { leg_offset(limb.side()) };
            unobservable[start + 2] = true;
        }
    }
    unobservable
}

/// Derivative of the angles with respect to the error vector of [`Pose::perturbed`], by central differences.
///
/// Each angle depends on one joint only, so four evaluations serve: one per component of a joint's error, and the
/// hinges, which are angles themselves.
pub fn angle_jacobian(pose: &Pose) -> SMatrix<f64, ANGLE_COUNT, POSE_DIMENSION> {
    const STEP: f64 = 1e-5;
    let mut jacobian = SMatrix::<f64, ANGLE_COUNT, POSE_DIMENSION>::zeros();
    for axis in 0..3 {
        let mut error = PoseVector::zeros();
        for joint in 0..5 {
            error[3 * joint + axis] = STEP;
        }
        let difference = angles_of_pose(&pose.perturbed(&error)).0 - angles_of_pose(&pose.perturbed(&-error)).0;
        for row in 0..ANGLE_COUNT {
            jacobian[(row, 3 * joint_of_angle(row) + axis)] = wrapped(difference[row]) / (2.0 * STEP);
        }
    }
    for limb in Limb::ALL {
        jacobian.fixed_view_mut::<1, POSE_DIMENSION>(hinge_angle(limb), 0).fill(0.0);
        jacobian[(hinge_angle(limb), hinge_offset(limb.index()))] = 1.0;
    }
    jacobian
}

/// Elements of the error vector of [`Pose::perturbed`] that an angle depends on: the hinge itself, or the three of its
/// joint.
pub fn elements_of_angle(angle: usize) -> std::ops::Range<usize> {
    let joint = joint_of_angle(angle);
    let hinge = Limb::ALL.into_iter().find(|limb| attitude_offset(limb.index()) == 3 * joint);
    match hinge {
        Some(limb) if hinge_angle(limb) == angle => hinge_offset(limb.index())..hinge_offset(limb.index()) + 1,
        _ => 3 * joint..3 * joint + 3,
    }
}

/// Limb rotation of the T-posture-based state of a hip whose anatomical angles are given (radians; flexion,
/// abduction, internal rotation), on a side.
pub fn hip_rotation(side: Side, flexion: f64, abduction: f64, axial: f64) -> Rotation3<f64> {
    let right = crate::geometry::euler::rotation_from_zxy(flexion, -abduction, axial);
    as_right_side(if side == Side::Left { Limb::LeftLeg } else { Limb::RightLeg }, &right)
}

/// Limb rotation of the T-posture-based state of a shoulder whose anatomical angles are given (radians; plane,
/// elevation ≥ 0, internal rotation), on a side.
pub fn shoulder_rotation(side: Side, plane: f64, elevation: f64, axial: f64) -> Rotation3<f64> {
    let humerus = crate::geometry::euler::rotation_from_yxy(plane, -elevation, axial);
    let right = humerus * t_posture_from_hanging().inverse();
    as_right_side(if side == Side::Left { Limb::LeftArm } else { Limb::RightArm }, &right)
}

/// Humerus frame (ISB: Y towards the shoulder) of a right arm in the T-posture.
pub fn t_posture_from_hanging() -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::x_axis(), -FRAC_PI_2)
}

/// The rotation of a limb, mirrored in the sagittal plane for a left one. Mirroring twice is the identity.
pub fn as_right_side(limb: Limb, rotation: &Rotation3<f64>) -> Rotation3<f64> {
    if limb.side() == Side::Right {
        return *rotation;
    }
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    Rotation3::from_matrix_unchecked(mirror * rotation.matrix() * mirror)
}

fn set(angles: &mut Angles, singular: &mut [bool], start: usize, values: [f64; 3], is_singular: bool) {
    for (i, value) in values.into_iter().enumerate() {
        angles[start + i] = value;
        singular[start + i] = is_singular;
    }
}

/// Angle of a limb's hinge, the last of the limb's four.
fn hinge_angle(limb: Limb) -> usize {
    3 + if limb.is_arm() { arm_offset(limb.side()) } else { leg_offset(limb.side()) }
}

/// Number of the attitude vector (trunk, then limbs) that an angle depends on.
fn joint_of_angle(angle: usize) -> usize {
    match angle {
        0..3 => 0,
        3..7 => attitude_offset(0) / 3,
        7..11 => attitude_offset(1) / 3,
        11..15 => attitude_offset(2) / 3,
        _ => attitude_offset(3) / 3,
    }
}

/// An angle difference brought into ±π.
fn wrapped(difference: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    difference - turn * (difference / turn).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::skeleton::{Skeleton, point_index};
    use proptest::prelude::*;

    fn close(a: f64, b_deg: f64) -> bool {
        (a.to_degrees() - b_deg).abs() < 1e-6
    }

    #[test]
    fn a_right_knee_raised_forwards_is_positive_hip_flexion_on_the_right() {
        let mut pose = Pose::reference();
        pose.limbs[3] = hip_rotation(Side::Right, 60f64.to_radians(), 0.0, 0.0);
        let knee = forward_kinematics(&Skeleton::of_stature(1.7), &pose)[point_index(Limb::RightLeg, 1)];
        assert!(knee.x > 0.3, "the knee must lie in front of the hip: {knee}");
        let (angles, _) = angles_of_pose(&pose);
        assert!(close(angles[leg_offset(Side::Right)], 60.0) && close(angles[leg_offset(Side::Left)], 0.0));
    }

    #[test]
    fn legs_spread_sideways_are_positive_abduction_on_both_sides() {
        let skeleton = Skeleton::of_stature(1.7);
        for (side, limb, outward) in [(Side::Left, Limb::LeftLeg, -1.0), (Side::Right, Limb::RightLeg, 1.0)] {
            let mut pose = Pose::reference();
            pose.limbs[limb.index()] = hip_rotation(side, 0.0, 30f64.to_radians(), 0.0);
            let points = forward_kinematics(&skeleton, &pose);
            let reach = points[point_index(limb, 1)] - points[point_index(limb, 0)];
            assert!(reach.z * outward > 0.1, "{side:?}: {reach}");
            assert!(close(angles_of_pose(&pose).0[leg_offset(side) + 1], 30.0));
        }
    }

    #[test]
    fn internal_rotation_turns_a_bent_shank_outwards() {
        // With the knee bent, turning the thigh inwards swings the foot to the outside.
        for (side, limb, outward) in [(Side::Left, Limb::LeftLeg, -1.0), (Side::Right, Limb::RightLeg, 1.0)] {
            let mut pose = Pose::reference();
            pose.limbs[limb.index()] = hip_rotation(side, 0.0, 0.0, 20f64.to_radians());
            pose.hinges[limb.index()] = FRAC_PI_2;
            let points = forward_kinematics(&Skeleton::of_stature(1.7), &pose);
            let shank = points[point_index(limb, 2)] - points[point_index(limb, 1)];
            assert!(shank.z * outward > 0.05, "{side:?}: {shank}");
            assert!(close(angles_of_pose(&pose).0[leg_offset(side) + 2], 20.0));
        }
    }

    #[test]
    fn the_t_posture_is_90_degrees_of_elevation_in_the_plane_of_abduction() {
        let (angles, singular) = angles_of_pose(&Pose::reference());
        for side in Side::BOTH {
            let start = arm_offset(side);
            assert!(close(angles[start], 0.0) && close(angles[start + 1], 90.0) && close(angles[start + 2], 0.0));
            assert!(!singular[start]);
        }
    }

    #[test]
    fn an_arm_raised_forwards_is_elevation_in_the_plane_of_flexion() {
        let skeleton = Skeleton::of_stature(1.7);
        for (side, limb) in [(Side::Left, Limb::LeftArm), (Side::Right, Limb::RightArm)] {
            let mut pose = Pose::reference();
            pose.limbs[limb.index()] = shoulder_rotation(side, FRAC_PI_2, FRAC_PI_2, 0.0);
            let points = forward_kinematics(&skeleton, &pose);
            let reach = points[point_index(limb, 1)] - points[point_index(limb, 0)];
            assert!(reach.x > 0.2, "{side:?}: {reach}");
            assert!(close(angles_of_pose(&pose).0[arm_offset(side)], 90.0));
        }
    }

    #[test]
    fn bending_the_trunk_forwards_right_and_turning_left_are_positive() {
        let skeleton = Skeleton::of_stature(1.7);
        let lean = |attitude: Vector3<f64>| {
            let pose = Pose { trunk: Rotation3::new(attitude), ..Pose::reference() };
            let points = forward_kinematics(&skeleton, &pose);
            let neck = (points[point_index(Limb::LeftArm, 0)] + points[point_index(Limb::RightArm, 0)]) / 2.0;
            (angles_of_pose(&pose).0, neck, points[point_index(Limb::RightArm, 0)])
        };
        let (angles, neck, _) = lean(Vector3::new(0.0, 0.0, -0.5));
        assert!(neck.x > 0.05 && angles[0] > 0.4);
        let (angles, neck, _) = lean(Vector3::new(0.5, 0.0, 0.0));
        assert!(neck.z > 0.05 && angles[1] > 0.4);
        let (angles, _, right_shoulder) = lean(Vector3::new(0.0, 0.5, 0.0));
        assert!(right_shoulder.x > 0.05 && angles[2] > 0.4);
    }

    #[test]
    fn axial_rotation_of_a_straight_limb_is_not_observable() {
        let mut pose = Pose::reference();
        assert!(unobservable_angles(&pose)[leg_offset(Side::Left) + 2]);
        pose.hinges = [0.5; 4];
        assert_eq!(unobservable_angles(&pose), [false; ANGLE_COUNT]);
    }

    proptest! {
        #[test]
        fn the_jacobian_predicts_small_changes(
            theta in prop::array::uniform19(-0.6..0.6f64),
            error in prop::array::uniform19(-1.0..1.0f64),
        ) {
            let pose = Pose::from_vector(&PoseVector::from(theta));
            let error = PoseVector::from(error) * 1e-5;
            let change = angles_of_pose(&pose.perturbed(&error)).0 - angles_of_pose(&pose).0;
            let predicted = angle_jacobian(&pose) * error;
            prop_assert!((change - predicted).norm() < 1e-7, "{change} against {predicted}");
        }

        #[test]
        fn an_angle_depends_on_its_elements_alone(theta in prop::array::uniform19(-0.6..0.6f64)) {
            let jacobian = angle_jacobian(&Pose::from_vector(&PoseVector::from(theta)));
            for angle in 0..ANGLE_COUNT {
                for element in (0..POSE_DIMENSION).filter(|i| !elements_of_angle(angle).contains(i)) {
                    prop_assert_eq!(jacobian[(angle, element)], 0.0);
                }
            }
        }
    }
}
