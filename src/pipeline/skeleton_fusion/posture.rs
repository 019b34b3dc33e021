//! From the rotations of bones to a posture of the linked skeleton, and from the errors of bones to its uncertainty.

use super::alignment::hinge_angle;
use crate::body::pose::{attitude_offset, hinge_offset};
use crate::body::{BONE_COUNT, Bone, Limb, Pose};
use crate::pipeline::joint_angles::posterior::PoseCovariance;
use nalgebra::{Matrix3, Rotation3};

/// `subject_from_bone` of every bone, in the order of [`Bone::ALL`].
pub type BoneRotations = [Rotation3<f64>; BONE_COUNT];

/// The posture in which the bones are turned so; of a distal bone only its turn about the hinge is taken.
pub fn pose_of_bones(bones: &BoneRotations) -> Pose {
    let trunk = bones[Bone::Trunk.index()];
    let mut pose = Pose { trunk, ..Pose::reference() };
    for limb in Limb::ALL {
        let (proximal, distal) = (&bones[Bone::Proximal(limb).index()], &bones[Bone::Distal(limb).index()]);
        pose.limbs[limb.index()] = trunk.inverse() * proximal;
        pose.hinges[limb.index()] = hinge_angle(limb, proximal, distal);
    }
    pose
}

/// Covariances of small turns of two bones, in `subject`, rad².
pub trait TurnCovariance {
    /// Covariance of the turn of bone `a` with that of bone `b`.
    fn between(&self, a: Bone, b: Bone) -> Matrix3<f64>;
}

/// Covariance of a posture's error (see [`Pose::perturbed`]) from those of its bones; correlations between different
/// joints are left at zero, as no angle asks for them.
pub fn pose_covariance(bones: &BoneRotations, turns: &impl TurnCovariance) -> PoseCovariance {
    let mut covariance = PoseCovariance::zeros();
    let of_trunk = turns.between(Bone::Trunk, Bone::Trunk);
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&of_trunk);
    let trunk = bones[Bone::Trunk.index()].matrix();
    for limb in Limb::ALL {
        let (proximal, distal) = (Bone::Proximal(limb), Bone::Distal(limb));
        let of_proximal = turns.between(proximal, proximal);
        let cross = turns.between(Bone::Trunk, proximal);
        let relative = of_trunk + of_proximal - cross - cross.transpose();
        let in_trunk = trunk.transpose() * relative * trunk;
        let a = attitude_offset(limb.index());
        covariance.fixed_view_mut::<3, 3>(a, a).copy_from(&in_trunk);
        let across = turns.between(proximal, distal);
        let relative = of_proximal + turns.between(distal, distal) - across - across.transpose();
        let axis = bones[proximal.index()] * limb.hinge_axis();
        let h = hinge_offset(limb.index());
        covariance[(h, h)] = (axis.transpose() * relative * axis)[0].max(0.0);
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::bones::bone_rotations;
    use crate::body::pose::PoseVector;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_posture_comes_back_from_its_bones(theta in prop::array::uniform19(-1.2..1.2f64)) {
            let pose = Pose::from_vector(&PoseVector::from(theta));
            let found = pose_of_bones(&bone_rotations(&pose));
            prop_assert!(found.error_from(&pose).norm() < 1e-7);
        }
    }

    struct SameForAll(f64);

    impl TurnCovariance for SameForAll {
        fn between(&self, _: Bone, _: Bone) -> Matrix3<f64> {
            Matrix3::identity() * self.0
        }
    }

    #[test]
    fn a_turn_that_all_bones_share_is_an_error_of_the_trunk_alone() {
        let bones = bone_rotations(&Pose::reference());
        let covariance = pose_covariance(&bones, &SameForAll(0.01));
        assert!((covariance.fixed_view::<3, 3>(0, 0) - Matrix3::identity() * 0.01).norm() < 1e-15);
        assert!(covariance.view((3, 3), (16, 16)).amax() < 1e-15);
    }
}
