//! What an estimator knows of one frame, and how a sequence of it becomes series.

use super::events::Repairs;
use super::observation::{SeenMask, sees_trunk};
use crate::assessment::series::{FLAG_BRIDGED, FLAG_NOT_OBSERVABLE, FLAG_OUTLIER, FLAG_SINGULAR, FLAG_SWAP_CORRECTED};
use crate::assessment::{AngleChannel, Series};
use crate::body::anatomical_angles::{
    ANGLE_COUNT, Angles, angle_jacobian, angles_of_pose, arm_offset, leg_offset, unobservable_angles,
};
use crate::body::pose::{POSE_DIMENSION, Pose, PoseVector, attitude_offset, hinge_offset};
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::skeleton::point_index;
use crate::body::{Limb, Side};
use crate::geometry::attitude::left_jacobian;
use nalgebra::{Matrix3, SMatrix, Vector3};

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

/// Collects posteriors into the series of an assessment.
#[derive(Debug)]
pub struct SeriesBuilder {
    series: Vec<Series>,
    repairs: Repairs,
    previous: PoseVector,
    previous_angles: Angles,
    is_first: bool,
}

impl SeriesBuilder {
    /// A builder with room for a number of frames, and what was done to their observations before the estimate; empty
    /// repairs mean none.
    pub fn new(frames: usize, repairs: Repairs) -> Self {
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
            repairs,
            previous: PoseVector::zeros(),
            previous_angles: Angles::zeros(),
            is_first: true,
        }
    }

    /// Adds the next frame.
    pub fn push(&mut self, frame: &Summary) {
        let (mut angles, singular) = angles_of_pose(&frame.pose);
        if !self.is_first {
            unwrap_angles(&mut angles, &self.previous_angles);
        }
        let unobservable = unobservable_angles(&frame.pose);
        let hinges = hinge_bounds();
        let index = self.series[0].value.len();
        let mask = |of: &[SeenMask]| of.get(index).copied().unwrap_or(0);
        let (rejected, exchanged) = (mask(&self.repairs.rejected), mask(&self.repairs.exchanged));
        let repair_flags = |angle: usize| {
            let needed = needed_points(angle);
            let outlier = if rejected & needed == 0 { 0 } else { FLAG_OUTLIER };
            outlier | if exchanged & needed == 0 { 0 } else { FLAG_SWAP_CORRECTED }
        };
        for angle in 0..ANGLE_COUNT {
            let mut flags = dependency_flags(angle, frame) | repair_flags(angle);
            flags |= if singular[angle] { FLAG_SINGULAR } else { 0 };
            flags |= if unobservable[angle] { FLAG_NOT_OBSERVABLE } else { 0 };
            let mut bounds = interval(angles[angle], frame.spread.as_ref().map(|spread| spread.angles[angle]));
            if let Some((_, range)) = hinges.iter().find(|(hinge, _)| *hinge == angle) {
                bounds = within(bounds, angles[angle], *range);
            }
            self.append(angle, angles[angle], bounds, flags);
        }
        let theta = frame.pose.to_vector(&self.previous);
        for joint in 0..5 {
            let attitude = theta.fixed_rows::<3>(3 * joint).into_owned();
            let sd = frame.spread.as_ref().map(|spread| attitude_sd(&attitude, &spread.attitudes[joint]));
            let first = first_angle_of_joint(joint);
            let flags = dependency_flags(first, frame) | repair_flags(first);
            for axis in 0..3 {
                let bounds = interval(attitude[axis], sd.map(|sd| sd[axis]));
                self.append(ANGLE_COUNT + 3 * joint + axis, attitude[axis], bounds, flags);
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

    fn append(&mut self, channel: usize, value: f64, [low, high]: [f64; 2], flags: u8) {
        let series = &mut self.series[channel];
        series.value.push(value.to_degrees() as f32);
        series.low.push(low.to_degrees() as f32);
        series.high.push(high.to_degrees() as f32);
        series.flags.push(flags);
    }
}

/// The 95 % interval of a value; NaN without a standard deviation.
fn interval(value: f64, sd: Option<f64>) -> [f64; 2] {
    let half = sd.map_or(f64::NAN, |sd| Z95 * sd);
    [value - half, value + half]
}

/// An interval cut off at a range, but never at the value itself; an absent one stays absent.
fn within([low, high]: [f64; 2], value: f64, [least, most]: [f64; 2]) -> [f64; 2] {
    if low.is_nan() {
        return [low, high];
    }
    [low.max(least.min(value)), high.min(most.max(value))]
}

/// Each hinge's place among the angles and its range of motion, radians: an interval does not leave it.
fn hinge_bounds() -> [(usize, [f64; 2]); 4] {
    let range = RangeOfMotion::healthy_adult();
    Limb::ALL.map(|limb| {
        let hinge = hinge_offset(limb.index());
        (limb_angles(limb).start + 3, [range.low[hinge], range.high[hinge]])
    })
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
    let spread = jacobian * covariance;
    Angles::from_fn(|angle, _| {
        let variance = spread.row(angle).dot(&jacobian.row(angle));
        // An angle is at most half a turn off: beyond, "anything" is all that is known.
        variance.max(0.0).sqrt().min(std::f64::consts::PI)
    })
}

/// Standard deviation of an attitude vector's components, radians, from the covariance of its error vector.
fn attitude_sd(attitude: &Vector3<f64>, block: &Matrix3<f64>) -> Vector3<f64> {
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
fn dependency_flags(angle: usize, posterior: &Summary) -> u8 {
    let trunk_seen = sees_trunk(posterior.seen);
    let bridged = |is_seen: bool| if is_seen { 0 } else { FLAG_BRIDGED };
    let Some(limb) = Limb::ALL.into_iter().find(|limb| limb_angles(*limb).contains(&angle)) else {
        return bridged(trunk_seen);
    };
    let is_hinge = angle - limb_angles(limb).start == 3;
    let needed = needed_points(angle);
    // The hinge needs no trunk.
    bridged(posterior.seen & needed == needed && (trunk_seen || is_hinge)) | posterior.limb_flags[limb.index()]
}

/// Points that an angle of a limb shows at, or the limbs' roots for one of the trunk: the swing shows at the middle
/// joint, twist and hinge only at the end.
fn needed_points(angle: usize) -> SeenMask {
    match Limb::ALL.into_iter().find(|limb| limb_angles(*limb).contains(&angle)) {
        None => Limb::ALL.iter().fold(0, |mask, limb| mask | 1 << point_index(*limb, 0)),
        Some(limb) if angle - limb_angles(limb).start < 2 => 0b011 << point_index(limb, 0),
        Some(limb) => 0b111 << point_index(limb, 0),
    }
}

/// Anatomical angles of a limb.
fn limb_angles(limb: Limb) -> std::ops::Range<usize> {
    let start = if limb.is_arm() { arm_offset(limb.side()) } else { leg_offset(limb.side()) };
    start..start + 4
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::joint_angles::observation::ALL_SEEN;

    fn posterior(pose: Pose, seen: SeenMask) -> Posterior {
        Posterior { pose, covariance: Some(PoseCovariance::identity() * 1e-4), seen, limb_flags: [0; 4] }
    }

    fn series_of(posteriors: &[Posterior], channel: &str) -> Series {
        let mut builder = SeriesBuilder::new(posteriors.len(), Repairs::default());
        for posterior in posteriors {
            builder.push(&posterior.summarize());
        }
        builder.finish().into_iter().find(|s| s.channel == channel).expect("the channel")
    }

    #[test]
    fn a_hinge_has_the_interval_of_its_own_standard_deviation() {
        let series = series_of(&[posterior(Pose::reference(), ALL_SEEN)], "left_knee_flexion_deg");
        assert!((series.high[0] - series.low[0] - 2.0 * 1.96 * 0.573).abs() < 0.01);
        assert_eq!(series.flags, [0]);
    }

    #[test]
    fn the_interval_of_a_straight_knee_ends_at_its_range_of_motion() {
        let frame =
            Posterior { covariance: Some(PoseCovariance::identity()), ..posterior(Pose::reference(), ALL_SEEN) };
        let series = series_of(&[frame], "left_knee_flexion_deg");
        assert_eq!(series.low[0], -10.0);
        assert!((series.high[0] - 112.3).abs() < 0.1, "{}", series.high[0]);
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
