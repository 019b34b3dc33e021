//! From the posterior of each frame to the channels of an assessment: value, 95 % interval and flags.

use super::events::Repairs;
use super::observation::{SeenMask, sees_trunk};
use super::posterior::Summary;
use crate::assessment::series::{FLAG_BRIDGED, FLAG_NOT_OBSERVABLE, FLAG_OUTLIER, FLAG_SINGULAR, FLAG_SWAP_CORRECTED};
use crate::assessment::{AngleChannel, Series};
use crate::body::anatomical_angles::{
    ANGLE_COUNT, Angles, angles_of_pose, arm_offset, leg_offset, unobservable_angles,
};
use crate::body::pose::{PoseVector, hinge_offset};
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::skeleton::point_index;
use crate::body::{Limb, Side};
use crate::geometry::attitude::inverse_left_jacobian;
use nalgebra::{Matrix3, Vector3};

/// Half the width of a 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_985;

/// Channels: the anatomical angles, then three components of each attitude vector.
pub const CHANNEL_COUNT: usize = ANGLE_COUNT + 15;

/// Joints with an attitude vector: trunk, then limbs.
const JOINTS: [usize; 5] = [0, 1, 2, 3, 4];

/// One channel in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Estimate, degrees.
    pub value: f32,
    /// Lower end of the 95 % credible interval, degrees; NaN when the method gives none.
    pub low: f32,
    /// Upper end of the 95 % credible interval, degrees; NaN when the method gives none.
    pub high: f32,
    /// Union of the `FLAG_…` bits.
    pub flags: u8,
}

impl Reading {
    fn new(value: f64, [low, high]: [f64; 2], flags: u8) -> Self {
        let degrees = |radians: f64| radians.to_degrees() as f32;
        Self { value: degrees(value), low: degrees(low), high: degrees(high), flags }
    }
}

/// Points of a frame that were changed before the estimate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameRepairs {
    /// Points taken out.
    pub rejected: SeenMask,
    /// Points exchanged between left and right.
    pub exchanged: SeenMask,
}

/// Reads the channels of one frame after the other; angles are continuous over full turns.
#[derive(Debug, Clone)]
pub struct AngleReader {
    previous: PoseVector,
    previous_angles: Option<Angles>,
    rests_on: [RestsOn; ANGLE_COUNT],
    ranges: [Option<[f64; 2]>; ANGLE_COUNT],
}

impl Default for AngleReader {
    fn default() -> Self {
        Self {
            previous: PoseVector::zeros(),
            previous_angles: None,
            rests_on: std::array::from_fn(RestsOn::of),
            ranges: hinge_ranges(),
        }
    }
}

impl AngleReader {
    /// The channels of the next frame, in the order of [`AngleChannel::all`].
    pub fn read(&mut self, frame: &Summary, repairs: FrameRepairs) -> [Reading; CHANNEL_COUNT] {
        let (mut angles, singular) = angles_of_pose(&frame.pose);
        if let Some(previous) = &self.previous_angles {
            unwrap_angles(&mut angles, previous);
        }
        let mut unobservable = unobservable_angles(&frame.pose);
        for limb in Limb::ALL.into_iter().filter(|limb| frame.twist_seen[limb.index()]) {
            unobservable[limb_angles(limb).start + 2] = false;
        }
        let theta = frame.pose.to_vector(&self.previous);
        let attitudes = JOINTS.map(|joint| theta.fixed_rows::<3>(3 * joint).into_owned());
        let attitude_sds = JOINTS.map(|joint| {
            let spread = frame.spread.as_ref();
            spread.map(|spread| attitude_sd(&attitudes[joint], &spread.attitudes[joint]))
        });
        let flags_of_angles = self.rests_on.map(|points| points.flags(frame, repairs));
        let readings = std::array::from_fn(|channel| {
            let Some(component) = channel.checked_sub(ANGLE_COUNT) else {
                let mut flags = flags_of_angles[channel];
                flags |= if singular[channel] { FLAG_SINGULAR } else { 0 };
                flags |= if unobservable[channel] { FLAG_NOT_OBSERVABLE } else { 0 };
                let sd = frame.spread.as_ref().map(|spread| spread.angles[channel]);
                let mut bounds = interval(angles[channel], sd);
                if let Some(range) = self.ranges[channel] {
                    bounds = within(bounds, angles[channel], range);
                }
                return Reading::new(angles[channel], bounds, flags);
            };
            let (joint, axis) = (component / 3, component % 3);
            let value = attitudes[joint][axis];
            let flags = flags_of_angles[first_angle_of_joint(joint)];
            Reading::new(value, interval(value, attitude_sds[joint].map(|sd| sd[axis])), flags)
        });
        self.previous = theta;
        self.previous_angles = Some(angles);
        readings
    }
}

/// Collects frames into the series of an assessment.
#[derive(Debug)]
pub struct SeriesBuilder {
    series: Vec<Series>,
    repairs: Repairs,
    reader: AngleReader,
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
        Self { series: AngleChannel::all().into_iter().map(empty).collect(), repairs, reader: AngleReader::default() }
    }

    /// Adds the next frame.
    pub fn push(&mut self, frame: &Summary) {
        let index = self.series[0].value.len();
        let mask = |of: &[SeenMask]| of.get(index).copied().unwrap_or(0);
        let repairs = FrameRepairs { rejected: mask(&self.repairs.rejected), exchanged: mask(&self.repairs.exchanged) };
        for (series, reading) in self.series.iter_mut().zip(self.reader.read(frame, repairs)) {
            series.value.push(reading.value);
            series.low.push(reading.low);
            series.high.push(reading.high);
            series.flags.push(reading.flags);
        }
    }

    /// The finished series.
    pub fn finish(self) -> Vec<Series> {
        self.series
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

/// The range of motion of each angle that is a hinge, radians: an interval does not leave it.
fn hinge_ranges() -> [Option<[f64; 2]>; ANGLE_COUNT] {
    let range = RangeOfMotion::healthy_adult();
    let mut ranges = [None; ANGLE_COUNT];
    for limb in Limb::ALL {
        let hinge = hinge_offset(limb.index());
        ranges[limb_angles(limb).start + 3] = Some([range.low[hinge], range.high[hinge]]);
    }
    ranges
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

/// Standard deviation of an attitude vector's components, radians, from the covariance of its error vector.
fn attitude_sd(attitude: &Vector3<f64>, block: &Matrix3<f64>) -> Vector3<f64> {
    // The error acts on the left: exp(v + δv) = exp(J δv) exp(v). At a full turn J is singular and says nothing.
    match inverse_left_jacobian(attitude) {
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

/// What an angle rests on: the trunk's roots, and the limb's points up to the one that shows it.
#[derive(Debug, Clone, Copy)]
struct RestsOn {
    /// Points that it is seen by.
    points: SeenMask,
    /// The limb that it is of, and whether it is the limb's hinge; none for the trunk.
    limb: Option<(usize, bool)>,
}

impl RestsOn {
    fn of(angle: usize) -> Self {
        let limb = Limb::ALL.into_iter().find(|limb| limb_angles(*limb).contains(&angle));
        let limb = limb.map(|limb| (limb.index(), angle - limb_angles(limb).start == 3));
        Self { points: needed_points(angle), limb }
    }

    /// Flags by what was seen of a frame, and what was done to it.
    fn flags(self, frame: &Summary, repairs: FrameRepairs) -> u8 {
        let mut flags = if repairs.rejected & self.points == 0 { 0 } else { FLAG_OUTLIER };
        flags |= if repairs.exchanged & self.points == 0 { 0 } else { FLAG_SWAP_CORRECTED };
        let trunk_seen = sees_trunk(frame.seen);
        let is_seen = match self.limb {
            None => trunk_seen,
            // The hinge needs no trunk.
            Some((_, is_hinge)) => frame.seen & self.points == self.points && (trunk_seen || is_hinge),
        };
        flags |= self.limb.map_or(0, |(limb, _)| frame.limb_flags[limb]);
        flags | if is_seen { 0 } else { FLAG_BRIDGED }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Pose;
    use crate::pipeline::joint_angles::observation::ALL_SEEN;
    use crate::pipeline::joint_angles::posterior::{PoseCovariance, Posterior};

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
