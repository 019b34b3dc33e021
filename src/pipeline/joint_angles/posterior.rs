//! What an estimator knows of one frame, and how a sequence of it becomes series.

use super::observation::{SeenMask, sees_trunk};
use crate::assessment::series::{FLAG_BRIDGED, FLAG_NOT_OBSERVABLE, FLAG_SINGULAR};
use crate::assessment::{AngleChannel, Series};
use crate::body::anatomical_angles::{
    ANGLE_COUNT, Angles, angle_jacobian, angles_of_pose, arm_offset, elements_of_angle, leg_offset, unobservable_angles,
};
use crate::body::pose::{POSE_DIMENSION, Pose, PoseVector, attitude_offset};
use crate::body::skeleton::point_index;
use crate::body::{Limb, Side};
use crate::geometry::attitude::left_jacobian;
use nalgebra::{SMatrix, Vector3};

/// Covariance of the error vector of a pose, rad².
pub type PoseCovariance = SMatrix<f64, POSE_DIMENSION, POSE_DIMENSION>;

/// Half the width of a 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_985;

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

/// Collects posteriors into the series of an assessment.
#[derive(Debug)]
pub struct SeriesBuilder {
    series: Vec<Series>,
    previous: PoseVector,
    previous_angles: Angles,
    is_first: bool,
}

impl SeriesBuilder {
    /// A builder with room for a number of frames.
    pub fn new(frames: usize) -> Self {
        let empty = |channel: AngleChannel| {
            let mut series = Series::empty(channel.name(), 0);
            for column in [&mut series.value, &mut series.low, &mut series.high] {
                column.reserve_exact(frames);
            }
            series.flags.reserve_exact(frames);
            series
        };
        Self {
            series: AngleChannel::all().into_iter().map(empty).collect(),
            previous: PoseVector::zeros(),
            previous_angles: Angles::zeros(),
            is_first: true,
        }
    }

    /// Adds the next frame.
    pub fn push(&mut self, posterior: &Posterior) {
        let (mut angles, singular) = angles_of_pose(&posterior.pose);
        if !self.is_first {
            unwrap_angles(&mut angles, &self.previous_angles);
        }
        let unobservable = unobservable_angles(&posterior.pose);
        let sd = posterior.covariance.as_ref().map(|c| angle_sd(&posterior.pose, c));
        for angle in 0..ANGLE_COUNT {
            let mut flags = dependency_flags(angle, posterior);
            flags |= if singular[angle] { FLAG_SINGULAR } else { 0 };
            flags |= if unobservable[angle] { FLAG_NOT_OBSERVABLE } else { 0 };
            self.append(angle, angles[angle], sd.map(|sd| sd[angle]), flags);
        }
        let theta = posterior.pose.to_vector(&self.previous);
        for joint in 0..5 {
            let attitude = theta.fixed_rows::<3>(3 * joint).into_owned();
            let sd = posterior.covariance.as_ref().map(|c| attitude_sd(&attitude, c, 3 * joint));
            let flags = dependency_flags(first_angle_of_joint(joint), posterior);
            for axis in 0..3 {
                self.append(ANGLE_COUNT + 3 * joint + axis, attitude[axis], sd.map(|sd| sd[axis]), flags);
            }
        }
        self.previous = theta;
        self.previous_angles = angles;
        self.is_first = false;
    }

    /// The finished series.
    pub fn finish(self) -> Vec<Series> {
        self.series
    }

    fn append(&mut self, channel: usize, value: f64, sd: Option<f64>, flags: u8) {
        let series = &mut self.series[channel];
        let half = sd.map_or(f64::NAN, |sd| Z95 * sd);
        series.value.push(value.to_degrees() as f32);
        series.low.push((value - half).to_degrees() as f32);
        series.high.push((value + half).to_degrees() as f32);
        series.flags.push(flags);
    }
}

/// Brings each angle to the turn nearest to the previous frame's, within ±360°.
fn unwrap_angles(angles: &mut Angles, previous: &Angles) {
    let turn = std::f64::consts::TAU;
    for (angle, before) in angles.iter_mut().zip(previous.iter()) {
        let unwrapped = *angle + turn * ((before - *angle) / turn).round();
        if unwrapped.abs() <= turn {
            *angle = unwrapped;
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

/// Standard deviation of an attitude vector's components, radians.
fn attitude_sd(attitude: &Vector3<f64>, covariance: &PoseCovariance, offset: usize) -> Vector3<f64> {
    let block = covariance.fixed_view::<3, 3>(offset, offset).into_owned();
    // The error acts on the left: exp(v + δv) = exp(J δv) exp(v). At a full turn J is singular and says nothing.
    match left_jacobian(attitude).try_inverse() {
        Some(inverse) => (inverse * block * inverse.transpose()).diagonal().map(|v| v.max(0.0).sqrt()),
        None => Vector3::repeat(f64::NAN),
    }
}

/// First anatomical angle of an attitude vector (trunk, then limbs).
fn first_angle_of_joint(joint: usize) -> usize {
    match joint {
        0 => 0,
        1 => arm_offset(Side::Left),
        2 => arm_offset(Side::Right),
        3 => leg_offset(Side::Left),
        _ => leg_offset(Side::Right),
    }
}

/// Flags of an angle by the points it depends on: the trunk's roots, and the limb's points up to the one that shows it.
fn dependency_flags(angle: usize, posterior: &Posterior) -> u8 {
    let trunk_seen = sees_trunk(posterior.seen);
    let bridged = |is_seen: bool| if is_seen { 0 } else { FLAG_BRIDGED };
    let Some(limb) = Limb::ALL.into_iter().find(|limb| limb_angles(*limb).contains(&angle)) else {
        return bridged(trunk_seen);
    };
    let within = angle - limb_angles(limb).start;
    // The hinge needs no trunk; the swing shows at the middle joint, twist and hinge only at the end.
    let needed = if within < 2 { 0b011 } else { 0b111 };
    let limb_seen = posterior.seen >> point_index(limb, 0) & needed == needed;
    bridged(limb_seen && (trunk_seen || within == 3)) | posterior.limb_flags[limb.index()]
}

/// Anatomical angles of a limb.
fn limb_angles(limb: Limb) -> std::ops::Range<usize> {
    let start = if limb.is_arm() { arm_offset(limb.side()) } else { leg_offset(limb.side()) };
    start..start + 4
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
    use crate::pipeline::joint_angles::observation::ALL_SEEN;

    fn posterior(pose: Pose, seen: SeenMask) -> Posterior {
        Posterior { pose, covariance: Some(PoseCovariance::identity() * 1e-4), seen, limb_flags: [0; 4] }
    }

    fn series_of(posteriors: &[Posterior], channel: &str) -> Series {
        let mut builder = SeriesBuilder::new(posteriors.len());
        for posterior in posteriors {
            builder.push(posterior);
        }
        builder.finish().into_iter().find(|s| s.channel == channel).expect("the channel")
    }

    #[test]
    fn a_hinge_has_the_interval_of_its_own_standard_deviation() {
        let series = series_of(&[posterior(Pose::reference(), ALL_SEEN)], "left_knee_flexion_deg");
        assert!((series.high[0] - series.low[0] - 2.0 * 1.96 * 0.573).abs() < 0.01);
        assert_eq!(series.flags, [0]);
    }

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

    #[test]
    fn a_lost_ankle_bridges_the_knee_but_not_the_hip() {
        let seen = ALL_SEEN & !(1 << point_index(Limb::LeftLeg, 2));
        let frames = [posterior(Pose::reference(), seen)];
        assert_eq!(series_of(&frames, "left_knee_flexion_deg").flags[0] & FLAG_BRIDGED, FLAG_BRIDGED);
        assert_eq!(series_of(&frames, "left_hip_flexion_deg").flags[0] & FLAG_BRIDGED, 0);
        assert_eq!(series_of(&frames, "right_knee_flexion_deg").flags[0] & FLAG_BRIDGED, 0);
    }

    #[test]
    fn the_axial_rotation_of_a_straight_leg_is_flagged() {
        let series = series_of(&[posterior(Pose::reference(), ALL_SEEN)], "left_hip_axial_rotation_deg");
        assert_eq!(series.flags[0], FLAG_NOT_OBSERVABLE);
    }

    #[test]
    fn a_subject_who_turns_round_keeps_a_continuous_trunk_rotation() {
        let turned = |degrees: f64| {
            let trunk = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
            posterior(Pose { trunk, ..Pose::reference() }, ALL_SEEN)
        };
        let frames: Vec<_> = (0..25).map(|i| turned(f64::from(i) * 10.0)).collect();
        let series = series_of(&frames, "trunk_axial_rotation_deg");
        assert!((series.value[24] - 240.0).abs() < 1e-3, "{}", series.value[24]);
    }
}
