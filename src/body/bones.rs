//! The nine bones that inertial units are worn on: trunk, upper arms, forearms, thighs, shanks (\[fusion\]).
//!
//! Each bone has its own axes. In the reference posture (T-posture) the axes of all bones are those of the subject: X
//! forward, Y up, Z to the right. A pose turns them, and a unit on a bone is described by the constant rotation
//! `bone_from_imu`.
//!
//! \[fusion\] mounts its units so: X along the bone towards the distal joint (to the ground while standing with hanging
//! arms), Z towards the inside of the limb; on the chest X to the ground and Z to the back.

use super::joint::Side;
use super::pose::Pose;
use super::skeleton::Limb;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Number of bones.
pub const BONE_COUNT: usize = 9;

/// A bone of the linked skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Bone {
    /// The trunk, the root of the others.
    Trunk,
    /// Upper arm or thigh.
    Proximal(Limb),
    /// Forearm or shank.
    Distal(Limb),
}

impl Bone {
    /// Every bone, the trunk first, then the limbs in the order of [`Limb::ALL`], proximal before distal.
    pub const ALL: [Bone; BONE_COUNT] = [
        Bone::Trunk,
        Bone::Proximal(Limb::LeftArm),
        Bone::Distal(Limb::LeftArm),
        Bone::Proximal(Limb::RightArm),
        Bone::Distal(Limb::RightArm),
        Bone::Proximal(Limb::LeftLeg),
        Bone::Distal(Limb::LeftLeg),
        Bone::Proximal(Limb::RightLeg),
        Bone::Distal(Limb::RightLeg),
    ];

    /// Place in [`Bone::ALL`].
    pub fn index(self) -> usize {
        match self {
            Bone::Trunk => 0,
            Bone::Proximal(limb) => 1 + 2 * limb.index(),
            Bone::Distal(limb) => 2 + 2 * limb.index(),
        }
    }

    /// The limb that the bone is of; none for the trunk.
    pub fn limb(self) -> Option<Limb> {
        match self {
            Bone::Trunk => None,
            Bone::Proximal(limb) | Bone::Distal(limb) => Some(limb),
        }
    }

    /// The bone that this one hangs on; none for the trunk.
    pub fn parent(self) -> Option<Bone> {
        match self {
            Bone::Trunk => None,
            Bone::Proximal(_) => Some(Bone::Trunk),
            Bone::Distal(limb) => Some(Bone::Proximal(limb)),
        }
    }

    /// Direction of the bone in its own axes: towards its distal joint, for the trunk downwards.
    pub fn direction(self) -> Vector3<f64> {
        self.limb().map_or(-Vector3::y(), Limb::reference_direction)
    }

    /// Where a unit sits that is mounted as in \[fusion\].
    pub fn scheme_from_imu(self) -> Rotation3<f64> {
        let x = self.direction();
        let z = match self.limb() {
            None => -Vector3::x(),
            // Hanging arms are turned into the T-posture about X, so what is inside then points down.
            Some(limb) if limb.is_arm() => -Vector3::y(),
            Some(limb) if limb.side() == Side::Right => -Vector3::z(),
            Some(_) => Vector3::z(),
        };
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]))
    }
}

/// `subject_from_bone` of every bone in a posture, in the order of [`Bone::ALL`].
pub fn bone_rotations(pose: &Pose) -> [Rotation3<f64>; BONE_COUNT] {
    let mut rotations = [pose.trunk; BONE_COUNT];
    for limb in Limb::ALL {
        let proximal = pose.trunk * pose.limbs[limb.index()];
        let hinge = Rotation3::new(limb.hinge_axis() * pose.hinges[limb.index()]);
        rotations[Bone::Proximal(limb).index()] = proximal;
        rotations[Bone::Distal(limb).index()] = proximal * hinge;
    }
    rotations
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::anatomical_angles::shoulder_rotation;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::pose::PoseVector;
    use crate::body::skeleton::{Skeleton, point_index};
    use proptest::prelude::*;

    #[test]
    fn every_bone_is_found_at_its_index() {
        for (i, bone) in Bone::ALL.into_iter().enumerate() {
            assert_eq!(bone.index(), i);
        }
    }

    #[test]
    fn units_of_a_person_who_stands_with_hanging_arms_point_down_and_inwards() {
        let mut pose = Pose::reference();
        for (limb, side) in [(Limb::LeftArm, Side::Left), (Limb::RightArm, Side::Right)] {
            pose.limbs[limb.index()] = shoulder_rotation(side, 0.0, 0.0, 0.0);
        }
        let rotations = bone_rotations(&pose);
        for bone in Bone::ALL {
            let subject_from_imu = rotations[bone.index()] * bone.scheme_from_imu();
            assert!((subject_from_imu * Vector3::x() + Vector3::y()).norm() < 1e-12, "{bone:?}");
            let inside = match bone.limb().map(Limb::side) {
                None => -Vector3::x(),
                Some(Side::Left) => Vector3::z(),
                Some(Side::Right) => -Vector3::z(),
            };
            assert!((subject_from_imu * Vector3::z() - inside).norm() < 1e-12, "{bone:?}");
            assert!((subject_from_imu.matrix().determinant() - 1.0).abs() < 1e-12, "{bone:?}");
        }
    }

    proptest! {
        #[test]
        fn bones_lie_between_their_points(theta in prop::array::uniform19(-1.2..1.2f64)) {
            let skeleton = Skeleton::of_stature(1.7);
            let pose = Pose::from_vector(&PoseVector::from(theta));
            let points = forward_kinematics(&skeleton, &pose);
            let rotations = bone_rotations(&pose);
            for limb in Limb::ALL {
                let point = |level| points[point_index(limb, level)];
                let lengths = [skeleton.proximal[limb.index()], skeleton.distal[limb.index()]];
                for (level, bone) in [Bone::Proximal(limb), Bone::Distal(limb)].into_iter().enumerate() {
                    let along = rotations[bone.index()] * bone.direction() * lengths[level];
                    prop_assert!((point(level + 1) - point(level) - along).norm() < 1e-12);
                }
            }
        }
    }
}
