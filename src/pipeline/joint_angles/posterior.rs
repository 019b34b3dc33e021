//! What an estimator knows of one frame.

use super::observation::SeenMask;
use crate::body::anatomical_angles::{Angles, angle_jacobian, elements_of_angle};
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
        let spread = self.covariance.as_ref().map(|covariance| Spread::of(&self.pose, covariance));
        Summary {
            pose: self.pose.clone(),
            spread,
            seen: self.seen,
            limb_flags: self.limb_flags,
            twist_seen: [false; 4],
        }
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
    /// True of a limb whose turn about itself is known from elsewhere than from joint centres, which do not show it.
    pub twist_seen: [bool; 4],
}

/// Uncertainty of a posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Standard deviation of each anatomical angle, radians.
    pub angles: Angles,
    /// Covariance of the error vector of trunk, left and right shoulder, left and right hip, rad².
    pub attitudes: [Matrix3<f64>; 5],
}

impl Spread {
    /// That of a posture whose error has a covariance.
    pub fn of(pose: &Pose, covariance: &PoseCovariance) -> Self {
        Self {
            angles: angle_sd(pose, covariance),
            attitudes: std::array::from_fn(|i| covariance.fixed_view::<3, 3>(3 * i, 3 * i).into_owned()),
        }
    }

    /// Between this one and a later one, by a share of the time to it.
    #[must_use]
    pub fn towards(&self, later: &Spread, share: f64) -> Self {
        Self {
            angles: self.angles + (later.angles - self.angles) * share,
            attitudes: std::array::from_fn(|i| self.attitudes[i] + (later.attitudes[i] - self.attitudes[i]) * share),
        }
    }
}

/// Standard deviation of each anatomical angle, radians.
fn angle_sd(pose: &Pose, covariance: &PoseCovariance) -> Angles {
    let jacobian = angle_jacobian(pose);
    Angles::from_fn(|angle, _| {
        // The sum runs over the few elements that the angle depends on, not over all 361 of the covariance.
        let elements = elements_of_angle(angle);
        let spread = |i: usize| elements.clone().map(|j| covariance[(i, j)] * jacobian[(angle, j)]).sum::<f64>();
        let variance: f64 = elements.clone().map(|i| jacobian[(angle, i)] * spread(i)).sum();
        // An angle is at most half a turn off: beyond, "anything" is all that is known.
        variance.max(0.0).sqrt().min(std::f64::consts::PI)
    })
}

/// Covariance of the error vector from that of the state vector θ around `theta`: `exp(v + δv) = exp(J δv) exp(v)`.
pub fn error_covariance(theta: &PoseVector, covariance: &PoseCovariance) -> PoseCovariance {
    // The derivative is the identity but for five blocks on its diagonal: each turns its rows and its columns.
    let mut turned = *covariance;
    for offset in std::iter::once(0).chain((0..4).map(attitude_offset)) {
        let jacobian = left_jacobian(&theta.fixed_rows::<3>(offset).into_owned());
        let rows = jacobian * turned.fixed_rows::<3>(offset);
        turned.fixed_rows_mut::<3>(offset).copy_from(&rows);
        let columns = turned.fixed_columns::<3>(offset) * jacobian.transpose();
        turned.fixed_columns_mut::<3>(offset).copy_from(&columns);
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A covariance in which every element is correlated with every other.
    fn dense_covariance() -> PoseCovariance {
        let factor =
            PoseCovariance::from_fn(|i, j| 0.01 * ((i * 19 + j) as f64 * 1.7).sin() + f64::from(u8::from(i == j)));
        factor * factor.transpose() * 1e-3
    }

    #[test]
    fn the_spread_of_errors_is_that_of_the_full_matrix_products() {
        let theta = PoseVector::from_fn(|i, _| (i as f64 * 2.3).sin());
        let (pose, covariance) = (Pose::from_vector(&theta), dense_covariance());
        let mut derivative = PoseCovariance::identity();
        for offset in std::iter::once(0).chain((0..4).map(attitude_offset)) {
            let block = left_jacobian(&theta.fixed_rows::<3>(offset).into_owned());
            derivative.fixed_view_mut::<3, 3>(offset, offset).copy_from(&block);
        }
        let plain = derivative * covariance * derivative.transpose();
        assert!((error_covariance(&theta, &covariance) - plain).abs().max() < 1e-17);
        let jacobian = angle_jacobian(&pose);
        let plain = (jacobian * covariance * jacobian.transpose()).diagonal().map(f64::sqrt);
        assert!((angle_sd(&pose, &covariance) - plain).abs().max() < 1e-15);
    }
}
