//! A posture of the linked skeleton: θ ∈ R¹⁹ (\[angles\]).

use super::skeleton::Limb;
use crate::geometry::attitude::{attitude_from_rotation, nearest_branch, rotation_from_attitude};
use nalgebra::{Rotation3, SVector, Vector3};

/// Length of the state θ: trunk 3, both shoulders and hips 3 each, both elbows and knees 1 each.
pub const POSE_DIMENSION: usize = 19;

/// θ as a vector, radians: trunk, left shoulder, right shoulder, left hip, right hip (attitude vectors), then left
/// elbow, right elbow, left knee, right knee (flexion).
pub type PoseVector = SVector<f64, POSE_DIMENSION>;

/// First element of a limb's attitude vector in θ.
pub const fn attitude_offset(limb: usize) -> usize {
    3 + 3 * limb
}

/// Element of a limb's hinge angle in θ.
pub const fn hinge_offset(limb: usize) -> usize {
    15 + limb
}

/// A posture as rotations, free of the singularity of attitude vectors.
#[derive(Debug, Clone, PartialEq)]
pub struct Pose {
    /// `subject_from_trunk`.
    pub trunk: Rotation3<f64>,
    /// Rotation of each limb's proximal segment against the reference posture, in `trunk`.
    pub limbs: [Rotation3<f64>; 4],
    /// Flexion of each limb's hinge, radians, positive in flexion.
    pub hinges: [f64; 4],
}

impl Pose {
    /// The T-posture: null rotation of every joint.
    pub fn reference() -> Self {
        Self { trunk: Rotation3::identity(), limbs: [Rotation3::identity(); 4], hinges: [0.0; 4] }
    }

    /// Posture of a state vector.
    pub fn from_vector(theta: &PoseVector) -> Self {
        let attitude = |i: usize| rotation_from_attitude(&Vector3::new(theta[i], theta[i + 1], theta[i + 2]));
        Self {
            trunk: attitude(0),
            limbs: Limb::ALL.map(|limb| attitude(attitude_offset(limb.index()))),
            hinges: Limb::ALL.map(|limb| theta[hinge_offset(limb.index())]),
        }
    }

    /// State vector of the posture, attitude vectors on the branch nearest to `previous`.
    pub fn to_vector(&self, previous: &PoseVector) -> PoseVector {
        let mut theta = PoseVector::zeros();
        let mut set = |i: usize, rotation: &Rotation3<f64>| {
            let before = previous.fixed_rows::<3>(i).into_owned();
            theta.fixed_rows_mut::<3>(i).copy_from(&nearest_branch(&attitude_from_rotation(rotation), &before));
        };
        set(0, &self.trunk);
        for limb in Limb::ALL {
            set(attitude_offset(limb.index()), &self.limbs[limb.index()]);
        }
        for limb in Limb::ALL {
            theta[hinge_offset(limb.index())] = self.hinges[limb.index()];
        }
        theta
    }

    /// The posture turned by a small error vector: rotations on the left (`exp(δ) R`, error in the parent's frame),
    /// hinges by addition. The order of `error` is that of θ.
    #[must_use]
    pub fn perturbed(&self, error: &PoseVector) -> Self {
        let turned = |i: usize, rotation: &Rotation3<f64>| {
            rotation_from_attitude(&error.fixed_rows::<3>(i).into_owned()) * rotation
        };
        Self {
            trunk: turned(0, &self.trunk),
            limbs: Limb::ALL.map(|limb| turned(attitude_offset(limb.index()), &self.limbs[limb.index()])),
            hinges: Limb::ALL.map(|limb| self.hinges[limb.index()] + error[hinge_offset(limb.index())]),
        }
    }

    /// The error vector that turns `other` into this posture: the inverse of [`Pose::perturbed`].
    pub fn error_from(&self, other: &Pose) -> PoseVector {
        let mut error = PoseVector::zeros();
        error.fixed_rows_mut::<3>(0).copy_from(&attitude_from_rotation(&(self.trunk * other.trunk.inverse())));
        for i in 0..4 {
            let turn = self.limbs[i] * other.limbs[i].inverse();
            error.fixed_rows_mut::<3>(attitude_offset(i)).copy_from(&attitude_from_rotation(&turn));
            error[hinge_offset(i)] = self.hinges[i] - other.hinges[i];
        }
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_error_vector_inverts_the_perturbation(
            theta in prop::array::uniform19(-1.2..1.2f64),
            error in prop::array::uniform19(-0.8..0.8f64),
        ) {
            let pose = Pose::from_vector(&PoseVector::from(theta));
            let error = PoseVector::from(error);
            prop_assert!((pose.perturbed(&error).error_from(&pose) - error).norm() < 1e-7);
        }

        #[test]
        fn the_state_vector_comes_back(theta in prop::array::uniform19(-1.7..1.7f64)) {
            let theta = PoseVector::from(theta);
            prop_assert!((Pose::from_vector(&theta).to_vector(&theta) - theta).norm() < 1e-7);
        }
    }

    #[test]
    fn the_reference_posture_is_the_null_vector() {
        assert_eq!(Pose::from_vector(&PoseVector::zeros()), Pose::reference());
    }
}
