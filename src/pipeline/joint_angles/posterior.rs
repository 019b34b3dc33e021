//! What an estimator knows of one frame.

use super::observation::SeenMask;
use crate::body::anatomical_angles::{Angles, angle_jacobian};
use crate::body::pose::{POSE_DIMENSION, Pose, PoseVector, attitude_offset};
use crate::geometry::attitude::left_jacobian;
use nalgebra::{Matrix3, SMatrix};

/// Covariance of the error vector of a pose, rad².
pub type PoseCovariance = SMatrix<f64, POSE_DIMENSION, POSE_DIMENSION>;

/// Estimate of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// Posture.
    pub pose: Pose,
    /// Covariance of its error (see [`Pose::perturbed`]); `None` when the method gives none.
    pub covariance: Option<PoseCovariance>,
    /// Points the estimate rests on.
    pub seen: SeenMask,
    /// Flags that concern every angle of a limb, by limb.
    pub limb_flags: [u8; 4],
}

impl Posterior {
    /// What the series need of this posterior, a tenth of its size.
    pub fn summarize(&self) -> Summary {
        let spread = self.covariance.as_ref().map(|covariance| Spread {
            angles: angle_sd(&self.pose, covariance),
            attitudes: std::array::from_fn(|i| covariance.fixed_view::<3, 3>(3 * i, 3 * i).into_owned()),
        });
        Summary { pose: self.pose.clone(), spread, seen: self.seen, limb_flags: self.limb_flags }
    }
}

/// A posterior without the correlations between joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Posture.
    pub pose: Pose,
    /// How uncertain it is; `None` when the method does not say.
    pub spread: Option<Spread>,
    /// Points the estimate rests on.
    pub seen: SeenMask,
    /// Flags that concern every angle of a limb, by limb.
    pub limb_flags: [u8; 4],
}

/// Uncertainty of a posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Standard deviation of each anatomical angle, radians.
    pub angles: Angles,
    /// Covariance of the error vector of trunk, left and right shoulder, left and right hip, rad².
    pub attitudes: [Matrix3<f64>; 5],
}

/// Standard deviation of each anatomical angle, radians.
fn angle_sd(pose: &Pose, covariance: &PoseCovariance) -> Angles {
    let jacobian = angle_jacobian(pose);
    let spread = jacobian * covariance;
    Angles::from_fn(|angle, _| {
        let variance = spread.row(angle).dot(&jacobian.row(angle));
        // An angle is at most half a turn off: beyond, "anything" is all that is known.
        variance.max(0.0).sqrt().min(std::f64::consts::PI)
    })
}

/// Covariance of the error vector from that of the state vector θ around `theta`: `exp(v + δv) = exp(J δv) exp(v)`.
pub fn error_covariance(theta: &PoseVector, covariance: &PoseCovariance) -> PoseCovariance {
    let mut spread = PoseCovariance::identity();
    for offset in std::iter::once(0).chain((0..4).map(attitude_offset)) {
        let jacobian = left_jacobian(&theta.fixed_rows::<3>(offset).into_owned());
        spread.fixed_view_mut::<3, 3>(offset, offset).copy_from(&jacobian);
    }
    spread * covariance * spread.transpose()
}
