//! The state-space model that the Gaussian methods share: posture and rates as the state, twelve points as the
//! observation, a Student-t weight for each point.
//!
//! What joint centres cannot show, the twist of a straight limb, is held by a weak prior at zero twist
//! ([`Tuning::twist_sd`]). Two errors make the interval: white noise, which the passes average, and the sensor's slow
//! offset, which stays as long as the posture does and is carried into the angles by one frame's geometry.

use super::calibration::Calibration;
use super::inverse_kinematics::pose_from_points;
use super::observation::{ALL_SEEN, Observations};
use super::posterior::{PoseCovariance, Posterior};
use super::sensor_noise::{slow_offset, white_noise};
use crate::assessment::series::FLAG_OUTLIER;
use crate::body::kinematics::{forward_kinematics, forward_kinematics_with_jacobian};
use crate::body::pose::{POSE_DIMENSION, PoseVector, attitude_offset, hinge_offset};
use crate::body::skeleton::point_index;
use crate::body::{Limb, OBSERVATION_DIMENSION, POINT_COUNT, Pose, Skeleton};
use crate::estimation::rate_smoother::{RateModel, RateSettings};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// What can be tuned, each with the measurement that set it in `docs/measurements.md`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuning {
    /// Least and largest error of a point that the passes count as independent from frame to frame beside its white
    /// noise, metres. Between the two it is the recording's own slow offset; the bound keeps a bad sensor from losing
    /// its weight against the dynamics, the floor a perfect one from having infinite weight.
    pub model_sd: [f64; 2],
    /// Degrees of freedom of the Student-t weight of a point: with 6 a point that is 5 standard deviations off has a
    /// fifth of its weight left, one that is 20 off a fiftieth.
    pub student_t_dof: f64,
    /// Standard deviation of the twist of a limb about its own axis, radians.
    pub twist_sd: f64,
    /// Time over which the twist prior counts once, seconds. One frame: a sensor's offset repeats itself in every frame
    /// too, so a prior that counted less often would lose against an error that never averages out.
    pub twist_time_s: f64,
    /// Spectral density of angular acceleration of the trunk, rad²/s³.
    pub trunk_density: f64,
    /// Spectral density of angular acceleration of shoulders, hips, elbows and knees, rad²/s³.
    pub limb_density: f64,
    /// How postures and rates start and decay.
    pub rates: RateSettings,
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            model_sd: [0.005, 0.025],
            student_t_dof: 6.0,
            twist_sd: 10f64.to_radians(),
            twist_time_s: 1.0 / 30.0,
            trunk_density: 3.0,
            limb_density: 10.0,
            rates: RateSettings { rate_decay_s: 0.7, initial_sd: 0.5, initial_rate_sd: 1.0, iterations: 3 },
        }
    }
}

/// Standard deviation of a rotation of which nothing is seen, radians (60°).
const UNSEEN_SD: f64 = std::f64::consts::FRAC_PI_3;
/// Weight under which a point counts as an outlier of its frame.
const OUTLIER_WEIGHT: f64 = 0.25;

/// One subject seen by one sensor.
#[derive(Debug)]
pub struct StateSpace<'a> {
    observations: &'a Observations,
    skeleton: &'a Skeleton,
    tuning: &'a Tuning,
    /// Inverse variance of each point's coordinates, m⁻².
    precision: [Vector3<f64>; POINT_COUNT],
    /// Offset of a point's coordinates that no averaging over time takes away, metres.
    slow_offset: f64,
}

impl<'a> StateSpace<'a> {
    /// The model of a calibrated subject; its noise is estimated from the observations.
    pub fn new(observations: &'a Observations, calibration: &'a Calibration, tuning: &'a Tuning) -> Self {
        let skeleton = &calibration.skeleton;
        let white = white_noise(observations);
        let slow_offset = slow_offset(observations, &white);
        let model_variance = slow_offset.clamp(tuning.model_sd[0], tuning.model_sd[1]).powi(2);
        let precision = white.map(|white| white.map(|sd| 1.0 / (sd.powi(2) + model_variance)));
        Self { observations, skeleton, tuning, precision, slow_offset }
    }

    /// Posture of the first complete frame by closed geometry.
    pub fn initial_pose(&self) -> Pose {
        let complete = (0..self.observations.len()).find(|t| self.observations.seen(*t) == ALL_SEEN);
        complete.map_or_else(Pose::reference, |t| {
            pose_from_points(self.skeleton, &self.observations.points[t], &Pose::reference())
        })
    }

    /// Student-t weight of a residual of three coordinates: 1 and a little at zero, falling with its squared length.
    fn weight(&self, point: usize, residual: &Vector3<f64>) -> f64 {
        let distance = residual.component_mul(residual).dot(&self.precision[point]);
        (self.tuning.student_t_dof + 3.0) / (self.tuning.student_t_dof + distance)
    }

    /// Estimate of frame `t` with the offset's part in its covariance and outliers flagged.
    pub fn posterior(&self, t: usize, pose: Pose, covariance: PoseCovariance) -> Posterior {
        let points = forward_kinematics(self.skeleton, &pose);
        let observed = &self.observations.points[t];
        let limb_flags = Limb::ALL.map(|limb| {
            let is_outlier = (0..3).map(|level| point_index(limb, level)).any(|p| {
                let residual = observed[p] - points[p];
                residual.x.is_finite() && self.weight(p, &residual) < OUTLIER_WEIGHT
            });
            if is_outlier { FLAG_OUTLIER } else { 0 }
        });
        let covariance = Some(covariance + self.offset_covariance(t, &pose));
        Posterior { pose, covariance, seen: self.observations.seen(t), limb_flags }
    }
}

impl StateSpace<'_> {
    /// What an offset of the sensor that outlasts the smoothing does to a posture, rad²: the covariance of one frame's
    /// estimate from points that are each off by the slow offset, with the twist prior.
    fn offset_covariance(&self, t: usize, pose: &Pose) -> PoseCovariance {
        let (_, jacobian) = forward_kinematics_with_jacobian(self.skeleton, pose);
        let seen = self.observations.seen(t);
        // A joint that is not seen is known to this at most; it also keeps the matrix invertible.
        let mut information = PoseCovariance::identity() / UNSEEN_SD.powi(2);
        let precision = 1.0 / self.slow_offset.powi(2).max(1e-8);
        for p in (0..POINT_COUNT).filter(|p| seen >> p & 1 == 1) {
            let rows = jacobian.fixed_rows::<3>(3 * p);
            information.gemm_tr(precision, &rows, &rows, 1.0);
        }
        for limb in Limb::ALL {
            let axis = pose.limbs[limb.index()] * limb.reference_direction() / self.tuning.twist_sd;
            let a = attitude_offset(limb.index());
            let mut block = information.fixed_view_mut::<3, 3>(a, a);
            block += axis * axis.transpose();
        }
        information.cholesky().map_or_else(PoseCovariance::zeros, |factor| factor.inverse())
    }
}

impl RateModel<POSE_DIMENSION> for StateSpace<'_> {
    type Posture = Pose;

    fn moved(&self, posture: &Pose, step: &PoseVector) -> Pose {
        posture.perturbed(step)
    }

    fn step_between(&self, from: &Pose, to: &Pose) -> PoseVector {
        to.error_from(from)
    }

    fn information(&self, t: usize, pose: &Pose) -> (PoseCovariance, PoseVector) {
        let mut information = PoseCovariance::zeros();
        let mut gradient = PoseVector::zeros();
        let interval = self.observations.interval_s(t).max(1e-3);
        for limb in Limb::ALL {
            let (limb_information, limb_gradient) = self.limb_information(t, pose, limb, interval);
            let a = attitude_offset(limb.index());
            let columns = [0, 1, 2, a, a + 1, a + 2, hinge_offset(limb.index())];
            for (i, row) in columns.into_iter().enumerate() {
                gradient[row] += limb_gradient[i];
                for (j, column) in columns.into_iter().enumerate() {
                    information[(row, column)] += limb_information[(i, j)];
                }
            }
        }
        (information, gradient)
    }

    fn acceleration_density(&self, _t: usize) -> PoseVector {
        PoseVector::from_fn(|i, _| if i < 3 { self.tuning.trunk_density } else { self.tuning.limb_density })
    }
}

impl StateSpace<'_> {
    /// Information and gradient of one limb with respect to trunk (3), limb attitude (3) and hinge (1).
    fn limb_information(
        &self,
        t: usize,
        pose: &Pose,
        limb: Limb,
        interval_s: f64,
    ) -> (SMatrix<f64, 7, 7>, SVector<f64, 7>) {
        let i = limb.index();
        let trunk: &Matrix3<f64> = pose.trunk.matrix();
        let (sine, cosine) = pose.hinges[i].sin_cos();
        let (along, flexed) = (limb.reference_direction(), limb.flexed_direction());
        let proximal = pose.limbs[i] * along * self.skeleton.proximal[i];
        let distal = pose.limbs[i] * (along * cosine + flexed * sine) * self.skeleton.distal[i];
        let swing = pose.limbs[i] * (flexed * cosine - along * sine) * self.skeleton.distal[i];
        let root = pose.trunk * self.skeleton.offsets[i];
        let reach = [Vector3::zeros(), proximal, proximal + distal];
        let mut information = SMatrix::zeros();
        let mut gradient = SVector::zeros();
        for (level, reach) in reach.into_iter().enumerate() {
            let p = point_index(limb, level);
            let point = root + trunk * reach;
            let residual = self.observations.points[t][p] - point;
            if !residual.x.is_finite() {
                continue;
            }
            let mut jacobian = SMatrix::<f64, 3, 7>::zeros();
            jacobian.fixed_columns_mut::<3>(0).copy_from(&-point.cross_matrix());
            if level > 0 {
                jacobian.fixed_columns_mut::<3>(3).copy_from(&(-trunk * reach.cross_matrix()));
            }
            if level == 2 {
                jacobian.fixed_columns_mut::<1>(6).copy_from(&(trunk * swing));
            }
            let precision = self.precision[p] * self.weight(p, &residual);
            let mut weighted = jacobian;
            for (axis, mut row) in weighted.row_iter_mut().enumerate() {
                row *= precision[axis];
            }
            information += weighted.transpose() * jacobian;
            gradient += weighted.transpose() * residual;
        }
        self.add_twist_prior(pose, limb, interval_s, &mut information, &mut gradient);
        (information, gradient)
    }

    /// A weak observation that the limb is not twisted about its own axis. Its precision grows with the interval, so
    /// that a recording of any frame rate is held equally.
    fn add_twist_prior(
        &self,
        pose: &Pose,
        limb: Limb,
        interval_s: f64,
        information: &mut SMatrix<f64, 7, 7>,
        gradient: &mut SVector<f64, 7>,
    ) {
        let axis = pose.limbs[limb.index()] * limb.reference_direction();
        let twist = twist_of(pose, limb);
        let precision = self.twist_precision(interval_s);
        for row in 0..3 {
            gradient[3 + row] -= precision * twist * axis[row];
            for column in 0..3 {
                information[(3 + row, 3 + column)] += precision * axis[row] * axis[column];
            }
        }
    }
}

/// Rows of [`StateSpace::whitened_residuals`]: three for each point, one for each limb's twist.
pub const RESIDUAL_DIMENSION: usize = OBSERVATION_DIMENSION + 4;

/// Residuals in standard deviations, points first, then twists.
pub type Residuals = SVector<f64, RESIDUAL_DIMENSION>;

/// Twist of a limb about its own axis, radians, −π to π.
fn twist_of(pose: &Pose, limb: Limb) -> f64 {
    let quaternion = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.limbs[limb.index()]);
    let twist = 2.0 * quaternion.imag().dot(&limb.reference_direction()).atan2(quaternion.w);
    twist - std::f64::consts::TAU * (twist / std::f64::consts::TAU).round()
}

/// The model for methods that look at the observation itself instead of its derivative.
impl StateSpace<'_> {
    /// What frame `t` differs from a posture, each row over its standard deviation; 0 for points not seen.
    pub fn whitened_residuals(&self, t: usize, pose: &Pose) -> Residuals {
        let points = forward_kinematics(self.skeleton, pose);
        let mut residuals = Residuals::zeros();
        for (p, point) in points.iter().enumerate() {
            let residual = self.observations.points[t][p] - point;
            if residual.x.is_finite() {
                let whitened = residual.component_mul(&self.precision[p].map(f64::sqrt));
                residuals.fixed_rows_mut::<3>(3 * p).copy_from(&whitened);
            }
        }
        let twist_precision = self.twist_precision(self.observations.interval_s(t).max(1e-3));
        for limb in Limb::ALL {
            residuals[OBSERVATION_DIMENSION + limb.index()] = -twist_of(pose, limb) * twist_precision.sqrt();
        }
        residuals
    }

    /// Student-t weight of each row from the expected squares of all: one for a point, 1 for a twist.
    pub fn row_weights(&self, squares: &Residuals) -> Residuals {
        let dof = self.tuning.student_t_dof;
        Residuals::from_fn(|row, _| {
            if row >= OBSERVATION_DIMENSION {
                return 1.0;
            }
            let distance = squares.fixed_rows::<3>(3 * (row / 3)).sum();
            (dof + 3.0) / (dof + distance)
        })
    }

    /// Log-likelihood of frame `t` at a posture, up to a constant of the frame: a trivariate Student-t distribution for each
    /// point, the twist prior for each limb. Its slope is the gradient of [`RateModel::information`].
    pub fn log_likelihood(&self, t: usize, pose: &Pose) -> f64 {
        let residuals = self.whitened_residuals(t, pose);
        let dof = self.tuning.student_t_dof;
        let of_point = |p: usize| (residuals.fixed_rows::<3>(3 * p).norm_squared() / dof).ln_1p();
        let points: f64 = (0..POINT_COUNT).map(of_point).sum();
        -0.5 * ((dof + 3.0) * points + residuals.fixed_rows::<4>(OBSERVATION_DIMENSION).norm_squared())
    }

    /// Precision of the twist prior in a frame, rad⁻².
    fn twist_precision(&self, interval_s: f64) -> f64 {
        interval_s / (self.tuning.twist_time_s * self.tuning.twist_sd.powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::quality::CalibrationQuality;
    use nalgebra::Rotation3;

    #[test]
    fn the_slope_of_the_log_likelihood_is_the_gradient_also_where_points_are_off_or_lost() {
        let skeleton = Skeleton::of_stature(1.7);
        let truth = Pose::from_vector(&PoseVector::from_fn(|i, _| 0.3 * (i as f64).sin() + 0.2));
        let mut points = forward_kinematics(&skeleton, &truth);
        points[2] += Vector3::new(0.4, -0.2, 0.1);
        points[4] = Vector3::repeat(f64::NAN);
        let time_ns = vec![0, 33_333_333];
        let observations = Observations { time_ns, points: vec![points; 2], subject_from_world: Rotation3::identity() };
        let tuning = Tuning::default();
        let quality = CalibrationQuality { source: "test".into(), window_s: None, n_frames: 1, segments: Vec::new() };
        let calibration = Calibration { skeleton, quality, warnings: Vec::new() };
        let model = StateSpace::new(&observations, &calibration, &tuning);
        let pose = truth.perturbed(&PoseVector::from_fn(|i, _| 0.05 * (i as f64).cos()));
        let (_, gradient) = model.information(1, &pose);
        for d in 0..POSE_DIMENSION {
            let step = PoseVector::from_fn(|i, _| if i == d { 1e-5 } else { 0.0 });
            let ahead = model.log_likelihood(1, &pose.perturbed(&step));
            let behind = model.log_likelihood(1, &pose.perturbed(&-step));
            let slope = (ahead - behind) / 2e-5;
            // The gradient takes a limb's own axis as the direction of twist, which holds for limbs that hardly swing.
            let is_swung = (3..15).contains(&d);
            let tolerance = if is_swung { 0.05 * gradient.amax() } else { 1e-4 * gradient.amax() };
            assert!((slope - gradient[d]).abs() < tolerance, "{d}: {slope} for {}", gradient[d]);
        }
    }

    #[test]
    fn the_information_is_that_of_the_full_jacobian() {
        let skeleton = Skeleton::of_stature(1.7);
        let truth = Pose::from_vector(&PoseVector::from_fn(|i, _| 0.1 * (i as f64).sin() + 0.2));
        let points = forward_kinematics(&skeleton, &truth);
        let observations =
            Observations { time_ns: vec![0], points: vec![points], subject_from_world: Rotation3::identity() };
        let tuning = Tuning::default();
        let quality = CalibrationQuality { source: "test".into(), window_s: None, n_frames: 1, segments: Vec::new() };
        let calibration = Calibration { skeleton: skeleton.clone(), quality, warnings: Vec::new() };
        let model = StateSpace::new(&observations, &calibration, &tuning);
        let (_, jacobian) = forward_kinematics_with_jacobian(&skeleton, &truth);
        let (information, gradient) = model.information(0, &truth);
        let mut expected = PoseCovariance::zeros();
        for p in 0..POINT_COUNT {
            let rows = jacobian.fixed_rows::<3>(3 * p);
            // At a residual of zero the Student-t weight is (ν + 3) / ν.
            let weight = (tuning.student_t_dof + 3.0) / tuning.student_t_dof;
            let precision = Matrix3::from_diagonal(&(model.precision[p] * weight));
            expected += rows.transpose() * precision * rows;
        }
        let difference = information - expected;
        // The rest is the twist prior, whose interval is the least one for the first frame.
        let prior = 1e-3 / (tuning.twist_time_s * tuning.twist_sd.powi(2));
        assert!(difference.amax() <= prior * 1.001, "{}", difference.amax());
        assert!(gradient.amax() <= prior, "{}", gradient.amax());
    }
}
