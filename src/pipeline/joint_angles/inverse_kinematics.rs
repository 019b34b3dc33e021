//! Closed geometry: the posture of one frame from its points alone.
//!
//! It is the `ik` baseline and the starting point of the filters. The trunk is the rigid rotation that best carries
//! the calibrated limb roots to the observed ones (Kabsch). A limb's proximal segment points along the observed one;
//! its twist comes from the plane of the bent hinge, and is zero (swing only) while the hinge is too straight to show
//! a plane.

use super::observation::{seen_mask, sees_limb, sees_trunk};
use crate::body::anatomical_angles::AXIAL_OBSERVABLE_FROM_RAD;
use crate::body::skeleton::point_index;
use crate::body::{Limb, POINT_COUNT, Pose, Skeleton};
use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

/// Posture of one frame. Parts that were not seen keep those of `previous`.
pub fn pose_from_points(skeleton: &Skeleton, points: &[Vector3<f64>; POINT_COUNT], previous: &Pose) -> Pose {
    let mask = seen_mask(points);
    let mut pose = previous.clone();
    if sees_trunk(mask) {
        pose.trunk = trunk_rotation(skeleton, points).unwrap_or(previous.trunk);
    }
    for limb in Limb::ALL {
        if !sees_limb(mask, limb) {
            continue;
        }
        let at = |level| points[point_index(limb, level)];
        if let Some((rotation, hinge)) = limb_posture(limb, at(1) - at(0), at(2) - at(1), &pose.trunk) {
            pose.limbs[limb.index()] = rotation;
            pose.hinges[limb.index()] = hinge;
        }
    }
    pose
}

/// The rotation that best carries the calibrated roots to the seen ones; `None` when they are collinear.
pub fn trunk_rotation(skeleton: &Skeleton, points: &[Vector3<f64>; POINT_COUNT]) -> Option<Rotation3<f64>> {
    let seen: Vec<usize> = (0..4).filter(|l| points[point_index(Limb::ALL[*l], 0)].x.is_finite()).collect();
    let mean = |of: &dyn Fn(usize) -> Vector3<f64>| {
        seen.iter().map(|l| of(*l)).sum::<Vector3<f64>>() / seen.len().max(1) as f64
    };
    let observed = |l: usize| points[point_index(Limb::ALL[l], 0)];
    let (observed_mean, model_mean) = (mean(&observed), mean(&|l| skeleton.offsets[l]));
    let mut covariance = Matrix3::zeros();
    for &l in &seen {
        covariance += (observed(l) - observed_mean) * (skeleton.offsets[l] - model_mean).transpose();
    }
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    // A trunk is metres wide and high; a second singular value under 1 cm² means that the roots lie on one line.
    if svd.singular_values[1] < 1e-4 {
        return None;
    }
    let sign = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    Some(Rotation3::from_matrix_unchecked(rotation))
}

/// Rotation and hinge angle of a limb from its two segments in `subject`; `None` when a segment has no length.
fn limb_posture(
    limb: Limb,
    proximal: Vector3<f64>,
    distal: Vector3<f64>,
    trunk: &Rotation3<f64>,
) -> Option<(Rotation3<f64>, f64)> {
    let along = Unit::try_new(trunk.inverse() * proximal, 1e-6)?;
    let onward = Unit::try_new(trunk.inverse() * distal, 1e-6)?;
    let hinge = along.cross(&onward).norm().atan2(along.dot(&onward));
    let aside = onward.into_inner() - along.into_inner() * along.dot(&onward);
    let (d, e) = (limb.reference_direction(), limb.flexed_direction());
    let rotation = match Unit::try_new(aside, 1e-9) {
        Some(aside) if hinge >= AXIAL_OBSERVABLE_FROM_RAD => {
            let seen = Matrix3::from_columns(&[*along, *aside, along.cross(&aside)]);
            let reference = Matrix3::from_columns(&[d, e, d.cross(&e)]);
            Rotation3::from_matrix_unchecked(seen * reference.transpose())
        }
        _ => swing(&d, &along),
    };
    Some((rotation, hinge))
}

/// The shortest rotation from one direction to another; a half turn about a fixed axis when they are opposite.
fn swing(from: &Vector3<f64>, to: &Vector3<f64>) -> Rotation3<f64> {
    let turn = UnitQuaternion::rotation_between(from, to)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    turn.to_rotation_matrix()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::pose::PoseVector;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn closed_geometry_inverts_forward_kinematics_when_every_hinge_is_bent(
            rotations in prop::array::uniform15(-0.9..0.9f64),
            hinges in prop::array::uniform4(0.4..2.0f64),
        ) {
            let skeleton = Skeleton::of_stature(1.7);
            let theta = PoseVector::from_fn(|i, _| if i < 15 { rotations[i] } else { hinges[i - 15] });
            let pose = Pose::from_vector(&theta);
            let points = forward_kinematics(&skeleton, &pose);
            let found = pose_from_points(&skeleton, &points, &Pose::reference());
            prop_assert!(found.error_from(&pose).norm() < 1e-6);
        }
    }

    #[test]
    fn a_straight_limb_gets_no_twist() {
        let skeleton = Skeleton::of_stature(1.7);
        let points = forward_kinematics(&skeleton, &Pose::reference());
        let found = pose_from_points(&skeleton, &points, &Pose::reference());
        assert!(found.error_from(&Pose::reference()).norm() < 1e-7);
    }

    #[test]
    fn a_limb_that_is_not_seen_keeps_its_posture() {
        let skeleton = Skeleton::of_stature(1.7);
        let mut points = forward_kinematics(&skeleton, &Pose::reference());
        points[point_index(Limb::LeftLeg, 1)] = Vector3::repeat(f64::NAN);
        let previous = Pose { hinges: [0.0, 0.0, 1.0, 1.0], ..Pose::reference() };
        let found = pose_from_points(&skeleton, &points, &previous);
        assert_eq!(found.hinges[2], 1.0);
        assert!(found.hinges[3].abs() < 1e-7);
    }
}
