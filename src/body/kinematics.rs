//! Forward kinematics y = K(θ) and its derivative (\[angles\] Eq. 1).
//!
//! ```text
//! root   = R_trunk o
//! middle = root   + L_proximal R_trunk R_limb d
//! end    = middle + L_distal   R_trunk R_limb (d cos φ + e sin φ)
//! ```
//!
//! with `o` the limb's offset, `d` its reference direction, `e` its flexed direction and φ the hinge flexion.
//! Positions are relative to the torso joint, in `subject`, metres.

use super::pose::{Pose, attitude_offset, hinge_offset};
use super::skeleton::{Limb, OBSERVATION_DIMENSION, POINT_COUNT, Skeleton, point_index};
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Positions of the twelve points relative to the torso joint, in `subject`, metres.
pub type Points = [Vector3<f64>; POINT_COUNT];

/// Derivative of the stacked points with respect to the error vector of [`Pose::perturbed`].
pub type Jacobian = SMatrix<f64, OBSERVATION_DIMENSION, 19>;

/// Points of a posture (K; also called direct kinematics).
#[doc(alias = "direct kinematics")]
pub fn forward_kinematics(skeleton: &Skeleton, pose: &Pose) -> Points {
    let mut points = [Vector3::zeros(); POINT_COUNT];
    for limb in Limb::ALL {
        let i = limb.index();
        let turn = pose.trunk * pose.limbs[i];
        let (sine, cosine) = pose.hinges[i].sin_cos();
        let root = pose.trunk * skeleton.offsets[i];
        let middle = root + turn * limb.reference_direction() * skeleton.proximal[i];
        let distal = limb.reference_direction() * cosine + limb.flexed_direction() * sine;
        points[point_index(limb, 0)] = root;
        points[point_index(limb, 1)] = middle;
        points[point_index(limb, 2)] = middle + turn * distal * skeleton.distal[i];
    }
    points
}

/// Points and their derivative at a posture.
///
/// A rotation error on the left moves a vector `R v` by `δ × R v`, so each block is minus a cross-product matrix.
pub fn forward_kinematics_with_jacobian(skeleton: &Skeleton, pose: &Pose) -> (Points, Jacobian) {
    let points = forward_kinematics(skeleton, pose);
    let mut jacobian = Jacobian::zeros();
    let trunk: &Matrix3<f64> = pose.trunk.matrix();
    for limb in Limb::ALL {
        let i = limb.index();
        let (sine, cosine) = pose.hinges[i].sin_cos();
        let proximal = pose.limbs[i] * limb.reference_direction() * skeleton.proximal[i];
        let distal = pose.limbs[i] * (limb.reference_direction() * cosine + limb.flexed_direction() * sine);
        let to_end = proximal + distal * skeleton.distal[i];
        let swing = limb.flexed_direction() * cosine - limb.reference_direction() * sine;
        let hinge = trunk * (pose.limbs[i] * swing) * skeleton.distal[i];
        for level in 0..3 {
            let row = 3 * point_index(limb, level);
            let point = points[point_index(limb, level)];
            jacobian.fixed_view_mut::<3, 3>(row, 0).copy_from(&-point.cross_matrix());
        }
        let (middle_row, end_row) = (3 * point_index(limb, 1), 3 * point_index(limb, 2));
        let column = attitude_offset(i);
        jacobian.fixed_view_mut::<3, 3>(middle_row, column).copy_from(&(-trunk * proximal.cross_matrix()));
        jacobian.fixed_view_mut::<3, 3>(end_row, column).copy_from(&(-trunk * to_end.cross_matrix()));
        jacobian.fixed_view_mut::<3, 1>(end_row, hinge_offset(i)).copy_from(&hinge);
    }
    (points, jacobian)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pose::PoseVector;
    use proptest::prelude::*;

    fn point(points: &Points, limb: Limb, level: usize) -> Vector3<f64> {
        points[point_index(limb, level)]
    }

    #[test]
    fn the_null_state_is_the_t_posture() {
        let skeleton = Skeleton::of_stature(1.8);
        let points = forward_kinematics(&skeleton, &Pose::reference());
        for (limb, outward) in [(Limb::LeftArm, -1.0), (Limb::RightArm, 1.0)] {
            let reach = point(&points, limb, 2) - point(&points, limb, 0);
            let length = skeleton.proximal[limb.index()] + skeleton.distal[limb.index()];
            assert!((reach - Vector3::z() * outward * length).norm() < 1e-12);
        }
        for limb in [Limb::LeftLeg, Limb::RightLeg] {
            let reach = point(&points, limb, 2) - point(&points, limb, 0);
            assert!((reach.normalize() + Vector3::y()).norm() < 1e-12);
        }
    }

    #[test]
    fn knees_bend_the_feet_backwards_and_elbows_the_hands_forwards() {
        let skeleton = Skeleton::of_stature(1.8);
        let pose = Pose { hinges: [1.0; 4], ..Pose::reference() };
        let points = forward_kinematics(&skeleton, &pose);
        assert!(point(&points, Limb::RightLeg, 2).x < -0.1 && point(&points, Limb::LeftLeg, 2).x < -0.1);
        assert!(point(&points, Limb::RightArm, 2).x > 0.1 && point(&points, Limb::LeftArm, 2).x > 0.1);
    }

    proptest! {
        #[test]
        fn the_jacobian_is_the_derivative(
            theta in prop::array::uniform19(-1.2..1.2f64),
            error in prop::array::uniform19(-1.0..1.0f64),
        ) {
            let skeleton = Skeleton::of_stature(1.7);
            let pose = Pose::from_vector(&PoseVector::from(theta));
            let (points, jacobian) = forward_kinematics_with_jacobian(&skeleton, &pose);
            let error = PoseVector::from(error) * 1e-6;
            let moved = forward_kinematics(&skeleton, &pose.perturbed(&error));
            let linear = jacobian * error;
            for p in 0..POINT_COUNT {
                let exact = moved[p] - points[p];
                // Second-order terms of a 1e-6 rad step on a limb of 1 m are of the order of 1e-12 m.
                prop_assert!((exact - linear.fixed_rows::<3>(3 * p)).norm() < 1e-10);
            }
        }

        #[test]
        fn bone_lengths_are_those_of_the_skeleton_in_every_posture(theta in prop::array::uniform19(-2.0..2.0f64)) {
            let skeleton = Skeleton::of_stature(1.7);
            let points = forward_kinematics(&skeleton, &Pose::from_vector(&PoseVector::from(theta)));
            for limb in Limb::ALL {
                let proximal = (point(&points, limb, 1) - point(&points, limb, 0)).norm();
                let distal = (point(&points, limb, 2) - point(&points, limb, 1)).norm();
                prop_assert!((proximal - skeleton.proximal[limb.index()]).abs() < 1e-12);
                prop_assert!((distal - skeleton.distal[limb.index()]).abs() < 1e-12);
            }
        }

        #[test]
        fn a_mirrored_posture_has_mirrored_points(theta in prop::array::uniform19(-1.2..1.2f64)) {
            // Mirroring in the sagittal plane (z → −z) negates rotations about x and y and exchanges the sides.
            let theta = PoseVector::from(theta);
            let mirror = |v: &PoseVector, i: usize| Vector3::new(-v[i], -v[i + 1], v[i + 2]);
            let mut mirrored = PoseVector::zeros();
            mirrored.fixed_rows_mut::<3>(0).copy_from(&mirror(&theta, 0));
            for (a, b) in [(0, 1), (1, 0), (2, 3), (3, 2)] {
                mirrored.fixed_rows_mut::<3>(attitude_offset(a)).copy_from(&mirror(&theta, attitude_offset(b)));
                mirrored[hinge_offset(a)] = theta[hinge_offset(b)];
            }
            let skeleton = Skeleton::of_stature(1.7);
            let points = forward_kinematics(&skeleton, &Pose::from_vector(&theta));
            let other = forward_kinematics(&skeleton, &Pose::from_vector(&mirrored));
            for (a, b) in [(0, 1), (2, 3)] {
                for level in 0..3 {
                    let p = points[3 * a + level].component_mul(&Vector3::new(1.0, 1.0, -1.0));
                    prop_assert!((p - other[3 * b + level]).norm() < 1e-12);
                }
            }
        }
    }
}
