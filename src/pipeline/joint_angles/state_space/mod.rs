//! The state-space model that the Gaussian methods share: posture and rates as the state, twelve points as the
//! observation, a Student-t weight for each point.
//!
//! ```text
//! y = K(θ) + r + s₁ d₁ + s₂ d₂ + e
//! ```
//!
//! K is the skeleton of constant lengths. A sensor does not see a body of constant lengths: it misplaces the root of a
//! limb (r, common to its three points) and lets segments seem longer or shorter along their directions d (s, common to
//! all points beyond). These slacks have the size of the sensor's slow offset and are marginalised in every frame; e is
//! white noise and what else of the offset is each point's own, smaller at the roots than at hands and feet.
//!
//! What joint centres cannot show, the twist of a straight limb, is held by a weak prior at zero twist
//! ([`Tuning::twist_sd`]). Two errors make the interval: white noise, which the passes average, and the sensor's slow
//! offset, which stays as long as the posture does and is carried into the angles by one frame's geometry.

use super::inverse_kinematics::pose_from_points;
use super::observation::{ALL_SEEN, Frame, Observations, seen_mask};
use super::posterior::{PoseCovariance, Posterior};
use super::sensor_noise::SensorNoise;
use crate::assessment::series::FLAG_OUTLIER;
use crate::body::kinematics::{Points, forward_kinematics, forward_kinematics_with_jacobian};
use crate::body::pose::{POSE_DIMENSION, PoseVector, attitude_offset, hinge_offset};
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::skeleton::point_index;
use crate::body::{Limb, OBSERVATION_DIMENSION, POINT_COUNT, Pose, Skeleton};
use crate::estimation::rate_smoother::{RateModel, RateSettings};
use crate::estimation::truncated_normal::truncated_mean;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// What can be tuned, each with the measurement that set it in `docs/measurements.md`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuning {
    /// Least and largest error of a point that the passes count as independent from frame to frame beside its white
    /// noise, metres. Between the two it is the recording's own slow offset; the bound keeps a bad sensor from losing
    /// its weight against the dynamics, the floor a perfect one from having infinite weight.
    pub model_sd: [f64; 2],
    /// Share of that error at the root, the middle and the end of a limb: depth sensors place shoulders and hips better
    /// than hands and feet (20 to 56 mm in the recordings of UI-PRMD).
    pub level_share: [f64; 3],
    /// Standard deviation of a limb's common displacement against the trunk, as a share of the slow offset.
    pub root_slack: f64,
    /// Standard deviation of the change of a segment's apparent length, as a share of the slow offset.
    pub length_slack: f64,
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

impl Tuning {
    /// The variant without slacks, for methods that ask for the likelihood itself: their weights are exact only where it is
    /// a product over points, and slacks tie the points of a limb together.
    pub fn rigid() -> Self {
        Self { root_slack: 0.0, length_slack: 0.0, ..Self::default() }
    }
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            model_sd: [0.005, 0.025],
            level_share: [0.4, 1.0, 1.6],
            root_slack: 0.25,
            length_slack: 0.5,
            student_t_dof: 6.0,
            twist_sd: 5f64.to_radians(),
            twist_time_s: 1.0 / 30.0,
            trunk_density: 3.0,
            limb_density: 6.0,
            rates: RateSettings { rate_decay_s: 0.7, initial_sd: 0.5, initial_rate_sd: 1.0, iterations: 3 },
        }
    }
}

/// Standard deviation of a rotation of which nothing is seen, radians (60°).
const UNSEEN_SD: f64 = std::f64::consts::FRAC_PI_3;
/// Weight under which a point counts as an outlier of its frame.
const OUTLIER_WEIGHT: f64 = 0.25;
/// Least offset of a point that an interval allows for, metres: a person is not a linked skeleton, whatever the sensor.
const LEAST_OFFSET: f64 = 0.003;
/// Slack whose inverse square is still far from overflow, metres.
const LEAST_SLACK: f64 = 1e-5;

/// One subject seen by one sensor.
#[derive(Debug, Clone)]
pub struct StateSpace {
    skeleton: Skeleton,
    tuning: Tuning,
    range: RangeOfMotion,
    /// Inverse variance of each point's coordinates, m⁻².
    precision: [Vector3<f64>; POINT_COUNT],
    /// Offset of a point's coordinates that no averaging over time takes away, metres.
    slow_offset: f64,
    /// Inverse variances of a limb's slacks: displacement of the root (3), length of the two segments, m⁻²; `None` when
    /// the tuning has none.
    slack_precision: Option<SVector<f64, SLACKS>>,
}

/// Slacks of a limb.
const SLACKS: usize = 5;
/// What a limb's points depend on: trunk (3), limb attitude (3), hinge (1).
const LIMB_DIMENSION: usize = 7;

type LimbInformation = SMatrix<f64, LIMB_DIMENSION, LIMB_DIMENSION>;
type LimbVector = SVector<f64, LIMB_DIMENSION>;

impl StateSpace {
    /// The model of a calibrated subject and a sensor.
    pub fn new(skeleton: &Skeleton, noise: &SensorNoise, tuning: &Tuning) -> Self {
        let slow_offset = noise.slow_offset.max(LEAST_OFFSET);
        let model_sd = slow_offset.clamp(tuning.model_sd[0], tuning.model_sd[1]);
        let precision = std::array::from_fn(|p| {
            let share = tuning.level_share[p % 3];
            noise.white[p].map(|sd| 1.0 / (sd.powi(2) + (share * model_sd).powi(2)))
        });
        let shares = [tuning.root_slack, tuning.length_slack];
        let [root, length] = shares.map(|share| (share * noise.slow_offset).max(LEAST_SLACK).powi(-2));
        let has_slacks = shares != [0.0; 2];
        Self {
            skeleton: skeleton.clone(),
            tuning: tuning.clone(),
            range: RangeOfMotion::healthy_adult(),
            precision,
            slow_offset,
            slack_precision: has_slacks.then(|| SVector::from([root, root, root, length, length])),
        }
    }

    /// Posture of the first complete frame by closed geometry: where the passes start.
    pub fn initial_pose(&self, observations: &Observations) -> Pose {
        let complete = (0..observations.len()).find(|t| observations.seen(*t) == ALL_SEEN);
        complete.map_or_else(Pose::reference, |t| {
            pose_from_points(&self.skeleton, &observations.points[t], &Pose::reference())
        })
    }

    /// Settings of the passes.
    pub fn rate_settings(&self) -> RateSettings {
        self.tuning.rates
    }

    /// What is known of a frame, from the estimate of a pass: hinges become the means of their distributions cut off at
    /// the range of motion, the sensor's offset has its part in the covariance, outliers are flagged.
    pub fn posterior(&self, observed: &Points, mut pose: Pose, covariance: &PoseCovariance) -> Posterior {
        let points = forward_kinematics(&self.skeleton, &pose);
        let limb_flags = Limb::ALL.map(|limb| {
            let is_outlier = (0..3).map(|level| point_index(limb, level)).any(|p| {
                let residual = observed[p] - points[p];
                residual.x.is_finite() && self.weight(p, &residual) < OUTLIER_WEIGHT
            });
            if is_outlier { FLAG_OUTLIER } else { 0 }
        });
        let offset = self.offset_covariance(&pose);
        for limb in Limb::ALL {
            let hinge = hinge_offset(limb.index());
            let sd = covariance[(hinge, hinge)].max(0.0).sqrt();
            let bounds = [self.range.low[hinge], self.range.high[hinge]];
            pose.hinges[limb.index()] = truncated_mean(pose.hinges[limb.index()], sd, bounds);
        }
        Posterior { pose, covariance: Some(covariance + offset), seen: seen_mask(observed), limb_flags }
    }

    /// Student-t weight of a residual of three coordinates: 1 and a little at zero, falling with its squared length.
    fn weight(&self, point: usize, residual: &Vector3<f64>) -> f64 {
        let distance = residual.component_mul(residual).dot(&self.precision[point]);
        (self.tuning.student_t_dof + 3.0) / (self.tuning.student_t_dof + distance)
    }

    /// What an offset of the sensor that outlasts the smoothing does to a posture, rad²: the covariance of one frame's
    /// estimate from points that are each off by the slow offset, with the twist prior. A point that is not seen in this
    /// frame counts too: the offset it was last seen with is still in the estimate, and what its absence adds is in the
    /// covariance of the passes.
    fn offset_covariance(&self, pose: &Pose) -> PoseCovariance {
        let (_, jacobian) = forward_kinematics_with_jacobian(&self.skeleton, pose);
        // No rotation is known worse than this; it also keeps the matrix invertible.
        let mut information = PoseCovariance::identity() / UNSEEN_SD.powi(2);
        information.gemm_tr(self.slow_offset.powi(-2), &jacobian, &jacobian, 1.0);
        for limb in Limb::ALL {
            let axis = pose.limbs[limb.index()] * limb.reference_direction() / self.tuning.twist_sd;
            let a = attitude_offset(limb.index());
            let mut block = information.fixed_view_mut::<3, 3>(a, a);
            block += axis * axis.transpose();
        }
        information.cholesky().map_or_else(PoseCovariance::zeros, |factor| factor.inverse())
    }
}

impl RateModel<POSE_DIMENSION> for StateSpace {
    type Posture = Pose;
    type Observation = Frame;

    fn moved(&self, posture: &Pose, step: &PoseVector) -> Pose {
        posture.perturbed(step)
    }

    fn step_between(&self, from: &Pose, to: &Pose) -> PoseVector {
        to.error_from(from)
    }

    fn information(&self, frame: &Frame, pose: &Pose) -> (PoseCovariance, PoseVector) {
        let mut information = PoseCovariance::zeros();
        let mut gradient = PoseVector::zeros();
        for limb in Limb::ALL {
            let (limb_information, limb_gradient) = self.limb_information(frame, pose, limb);
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

    fn acceleration_density(&self) -> PoseVector {
        PoseVector::from_fn(|i, _| if i < 3 { self.tuning.trunk_density } else { self.tuning.limb_density })
    }
}

impl StateSpace {
    /// Information and gradient of one limb with respect to trunk (3), limb attitude (3) and hinge (1), its slacks
    /// marginalised.
    fn limb_information(&self, frame: &Frame, pose: &Pose, limb: Limb) -> (LimbInformation, LimbVector) {
        let i = limb.index();
        let trunk: &Matrix3<f64> = pose.trunk.matrix();
        let (sine, cosine) = pose.hinges[i].sin_cos();
        let (along, flexed) = (limb.reference_direction(), limb.flexed_direction());
        let directions = [pose.limbs[i] * along, pose.limbs[i] * (along * cosine + flexed * sine)];
        let swing = pose.limbs[i] * (flexed * cosine - along * sine) * self.skeleton.distal[i];
        let root = pose.trunk * self.skeleton.offsets[i];
        let middle = directions[0] * self.skeleton.proximal[i];
        let reach = [Vector3::zeros(), middle, middle + directions[1] * self.skeleton.distal[i]];
        let stretch = directions.map(|direction| trunk * direction);
        let mut information = LimbInformation::zeros();
        let mut gradient = LimbVector::zeros();
        let mut slack = SMatrix::<f64, SLACKS, SLACKS>::from_diagonal(&self.slack_precision.unwrap_or_default());
        let mut slack_gradient = SVector::<f64, SLACKS>::zeros();
        let mut cross = SMatrix::<f64, LIMB_DIMENSION, SLACKS>::zeros();
        for (level, reach) in reach.into_iter().enumerate() {
            let p = point_index(limb, level);
            let point = root + trunk * reach;
            let residual = frame.points[p] - point;
            if !residual.x.is_finite() {
                continue;
            }
            let mut jacobian = SMatrix::<f64, 3, LIMB_DIMENSION>::zeros();
            jacobian.fixed_columns_mut::<3>(0).copy_from(&-point.cross_matrix());
            if level > 0 {
                jacobian.fixed_columns_mut::<3>(3).copy_from(&(-trunk * reach.cross_matrix()));
            }
            if level == 2 {
                jacobian.fixed_columns_mut::<1>(6).copy_from(&(trunk * swing));
            }
            let precision = self.precision[p] * self.weight(p, &residual);
            let weighted = scaled_rows(&jacobian, &precision).transpose();
            information += weighted * jacobian;
            gradient += weighted * residual;
            if self.slack_precision.is_none() {
                continue;
            }
            let mut by_slack = SMatrix::<f64, 3, SLACKS>::identity();
            for (segment, direction) in stretch.iter().enumerate().take(level) {
                by_slack.set_column(3 + segment, direction);
            }
            cross += weighted * by_slack;
            let weighted = scaled_rows(&by_slack, &precision).transpose();
            slack += weighted * by_slack;
            slack_gradient += weighted * residual;
        }
        // The slacks' prior makes their block positive definite; without slacks there is nothing to marginalise.
        if let Some(factor) = self.slack_precision.and_then(|_| slack.cholesky()) {
            information -= cross * factor.solve(&cross.transpose());
            gradient -= cross * factor.solve(&slack_gradient);
        }
        self.add_twist_prior(pose, limb, frame.interval_s, &mut information, &mut gradient);
        (information, gradient)
    }

    /// A weak observation that the limb is not twisted about its own axis. Its precision grows with the interval, so
    /// that a recording of any frame rate is held equally.
    fn add_twist_prior(
        &self,
        pose: &Pose,
        limb: Limb,
        interval_s: f64,
        information: &mut LimbInformation,
        gradient: &mut LimbVector,
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

/// Least time that the twist prior of a frame counts for, seconds: the first frame has no interval.
const LEAST_TWIST_INTERVAL_S: f64 = 1e-3;

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

/// The model for methods that look at the observation itself instead of its derivative. Slacks are no part of it: it is
/// for [`Tuning::rigid`].
impl StateSpace {
    /// What a frame differs from a posture, each row over its standard deviation; 0 for points not seen.
    pub fn whitened_residuals(&self, frame: &Frame, pose: &Pose) -> Residuals {
        let points = forward_kinematics(&self.skeleton, pose);
        let mut residuals = Residuals::zeros();
        for (p, point) in points.iter().enumerate() {
            let residual = frame.points[p] - point;
            if residual.x.is_finite() {
                let whitened = residual.component_mul(&self.precision[p].map(f64::sqrt));
                residuals.fixed_rows_mut::<3>(3 * p).copy_from(&whitened);
            }
        }
        let twist_precision = self.twist_precision(frame.interval_s);
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

    /// Log-likelihood of a frame at a posture, up to a constant of the frame: a trivariate Student-t distribution for each
    /// point, the twist prior for each limb. Its slope is the gradient of [`RateModel::information`].
    pub fn log_likelihood(&self, frame: &Frame, pose: &Pose) -> f64 {
        let residuals = self.whitened_residuals(frame, pose);
        let dof = self.tuning.student_t_dof;
        let of_point = |p: usize| (residuals.fixed_rows::<3>(3 * p).norm_squared() / dof).ln_1p();
        let points: f64 = (0..POINT_COUNT).map(of_point).sum();
        -0.5 * ((dof + 3.0) * points + residuals.fixed_rows::<4>(OBSERVATION_DIMENSION).norm_squared())
    }

    /// Precision of the twist prior in a frame, rad⁻².
    fn twist_precision(&self, interval_s: f64) -> f64 {
        interval_s.max(LEAST_TWIST_INTERVAL_S) / (self.tuning.twist_time_s * self.tuning.twist_sd.powi(2))
    }
}

/// A matrix with each row multiplied by the factor of its axis.
fn scaled_rows<const N: usize>(matrix: &SMatrix<f64, 3, N>, factors: &Vector3<f64>) -> SMatrix<f64, 3, N> {
    SMatrix::from_fn(|row, column| matrix[(row, column)] * factors[row])
}

#[cfg(test)]
mod tests;
