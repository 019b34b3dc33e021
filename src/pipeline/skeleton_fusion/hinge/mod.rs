//! Hinge joints from two inertial units, one on each side, without a calibration pose and without a camera.
//!
//! Nothing is known of how the units sit on their segments. What makes them one joint is enough:
//!
//! | step | what is used | file |
//! |---|---|---|
//! | axis in each unit's frame | both rates have the same part across the axis; the axis has one inclination | `axes` |
//! | heading between the units over time | the axis is one direction in the world | `heading` |
//! | place of the joint, and which ends of the two axes agree | the joint has one acceleration | `joint_centre` |
//! | which way is flexion | knees and elbows bend to one side of straight | `joint_centre` |
//! | zero of the angle | a standing leg is taken as straight | `standing` |
//!
//! The axis is found by the constraint of Seel, Schauer and Raisch (IEEE Int. Conf. on Control Applications 2012), with the
//! inclination beside it. The heading, which they do not need and magnetometer-free orientation lacks, is a smooth offline
//! estimate here. `surefoot evaluate hinge` prints what each part is worth.

mod axes;
mod heading;
mod joint_centre;
mod pair;
mod standing;
#[cfg(test)]
mod tests;
mod tridiagonal;

use heading::Heading;
use joint_centre::JointCentre;
use nalgebra::{UnitQuaternion, Vector3};
use pair::Pair;

/// Time over which the disagreement of the two axes is averaged for the uncertainty of the angle, s.
const DISAGREEMENT_SECONDS: f64 = 2.0;

/// What one unit measured, and its orientation by any filter; all four slices are equally long.
#[derive(Debug, Clone, Copy)]
pub struct UnitMotion<'a> {
    /// Times in nanoseconds on a clock that both units share, strictly increasing.
    pub time_ns: &'a [i64],
    /// Specific force in the unit's frame, m/s².
    pub acceleration: &'a [Vector3<f64>],
    /// Angular rate in the unit's frame, rad/s.
    pub angular_rate: &'a [Vector3<f64>],
    /// Rotation from the unit's frame into `earth` (y up); the heading may be anything and may drift.
    pub earth_from_imu: &'a [UnitQuaternion<f64>],
}

/// The axis of a hinge as its two units see it: turning the distal segment about it in the positive sense is flexion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HingeAxes {
    /// Unit vector along the axis in the frame of the proximal unit.
    pub proximal_axis_in_imu: Vector3<f64>,
    /// The same direction in the frame of the distal unit.
    pub distal_axis_in_imu: Vector3<f64>,
    /// Standard deviation of the two directions in their worst direction, rad: proximal, distal. It counts what the
    /// residuals scatter, not that a knee's axis itself moves.
    pub uncertainty_rad: [f64; 2],
    /// From the joint to the proximal unit, in that unit's frame, metres.
    pub proximal_from_joint_m: Vector3<f64>,
    /// From the joint to the distal unit, in that unit's frame, metres.
    pub distal_from_joint_m: Vector3<f64>,
    /// True when the range of motion tells flexion from extension; otherwise the axis may point to either side.
    pub is_flexion_sense_known: bool,
    /// By which factor the opposite end of the distal axis explains the joint's acceleration worse (root mean squares);
    /// near 1 the ends may not belong together.
    pub opposite_end_ratio: f64,
}

impl HingeAxes {
    fn joint_centre(&self) -> JointCentre {
        JointCentre { proximal: self.proximal_from_joint_m, distal: self.distal_from_joint_m, disagreement: 0.0 }
    }
}

/// How the heading between the two units is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HeadingModel {
    /// One for the whole recording: what orientation filters alone offer.
    Constant,
    /// Walks slowly, held by the axis of the joint.
    #[default]
    Tracked,
}

/// Where the angle counts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Zero {
    /// Anywhere: only changes of the angle mean something.
    Arbitrary,
    /// A straight leg, seen in quiet standing; where nobody stands, as [`Zero::Arbitrary`].
    #[default]
    Standing,
}

/// Flexion over time.
#[derive(Debug, Clone, PartialEq)]
pub struct HingeAngles {
    /// Times of the proximal unit's samples at which the distal unit measured too, nanoseconds.
    pub time_ns: Vec<i64>,
    /// Flexion, rad, continuous.
    pub flexion: Vec<f64>,
    /// Standard deviation of flexion about its zero, rad. The error about the axis, which nobody sees, is taken to be as
    /// large as the one across it, which is how far the two axes disagree in the world.
    pub flexion_sd: Vec<f64>,
    /// Heading of the distal unit's `earth` in the proximal unit's, rad, continuous.
    pub heading: Vec<f64>,
    /// Standard deviation of the heading, rad.
    pub heading_sd: Vec<f64>,
    /// What the zero was taken from; none when it is arbitrary.
    pub standing: Option<StandingZero>,
}

/// The quiet standing that the zero was taken from.
#[derive(Debug, Clone, PartialEq)]
pub struct StandingZero {
    /// Indices into [`HingeAngles::time_ns`] of each stretch.
    pub stretches: Vec<std::ops::Range<usize>>,
    /// Standard deviation of the zero, rad: of the knee in quiet standing about straight, and within these stretches.
    pub sd: f64,
}

/// Why two units make no hinge.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HingeError {
    /// The slices of a unit differ in length.
    #[error("times, accelerations, angular rates and orientations of a unit differ in number")]
    UnequalLengths,
    /// The units did not measure at the same time.
    #[error("the two units share {seconds:.1} s; expected at least {MIN_SECONDS} s", MIN_SECONDS = pair::MIN_SECONDS)]
    NoOverlap {
        /// Time that both cover, s.
        seconds: f64,
    },
    /// There is nothing to find the axis from.
    #[error("the joint moved for {seconds:.1} s; bend and stretch it for at least {} s", axes::MIN_MOVING_SECONDS)]
    TooLittleMovement {
        /// Time in movement, s.
        seconds: f64,
    },
}

/// The axes of the hinge between a proximal and a distal unit.
///
/// # Errors
/// [`HingeError`] when the units do not fit each other or the joint hardly moved.
pub fn axes(units: &[UnitMotion<'_>; 2]) -> Result<HingeAxes, HingeError> {
    let pair = Pair::new(units)?;
    let found = axes::estimate(&pair)?;
    // Rates and inclination hardly tell which ends of the two axes belong together: the joint's acceleration does.
    let ends = [1.0, -1.0].map(|sign| {
        let axes = [found.axes[0], found.axes[1] * sign];
        let heading = heading::estimate(&pair, &axes, HeadingModel::Tracked);
        let centre = joint_centre::estimate(&pair, &heading);
        (axes, heading, centre)
    });
    let [same, opposite] = &ends;
    let is_same = same.2.disagreement <= opposite.2.disagreement;
    let (chosen, other) = if is_same { (same, opposite) } else { (opposite, same) };
    let (axes, heading, centre) = chosen;
    let angles = angles(&pair, axes, heading);
    let sense = match standing::find(&pair, centre, &angles) {
        Some((straight, _)) => joint_centre::flexion_sense(&angles, straight, joint_centre::MIN_FLEXION_FROM_STANDING),
        None => joint_centre::straight_angle(&pair, axes, heading, centre, &angles)
            .and_then(|straight| joint_centre::flexion_sense(&angles, straight, joint_centre::MIN_FLEXION_FROM_UNITS)),
    };
    let sign = sense.unwrap_or(1.0);
    Ok(HingeAxes {
        proximal_axis_in_imu: axes[0] * sign,
        distal_axis_in_imu: axes[1] * sign,
        uncertainty_rad: found.sd,
        proximal_from_joint_m: centre.proximal,
        distal_from_joint_m: centre.distal,
        is_flexion_sense_known: sense.is_some(),
        opposite_end_ratio: other.2.disagreement / centre.disagreement.max(f64::MIN_POSITIVE),
    })
}

/// Flexion of the hinge over time.
///
/// # Errors
/// [`HingeError`] when the units do not fit each other.
pub fn flexion(
    units: &[UnitMotion<'_>; 2],
    hinge: &HingeAxes,
    heading: HeadingModel,
    zero: Zero,
) -> Result<HingeAngles, HingeError> {
    let pair = Pair::new(units)?;
    let axes = [hinge.proximal_axis_in_imu, hinge.distal_axis_in_imu];
    let heading = heading::estimate(&pair, &axes, heading);
    let mut flexion = angles(&pair, &axes, &heading);
    let standing = match zero {
        Zero::Standing => standing::find(&pair, &hinge.joint_centre(), &flexion),
        Zero::Arbitrary => None,
    };
    if let Some((zero, _)) = &standing {
        flexion.iter_mut().for_each(|angle| *angle -= zero);
    }
    Ok(HingeAngles {
        flexion_sd: flexion_sd(&pair, &axes, &heading),
        flexion,
        heading: heading.angle,
        heading_sd: heading.sd,
        standing: standing.map(|(_, standing)| standing),
        time_ns: pair.time_ns,
    })
}

/// Turn of the distal about the proximal unit around the axis, rad, continuous; zero where the smallest rotation between
/// the two axes as seen by the units is.
fn angles(pair: &Pair, axes: &[Vector3<f64>; 2], heading: &Heading) -> Vec<f64> {
    let distal_from_joint = smallest_rotation(&axes[0], &axes[1]);
    let mut last: f64 = 0.0;
    (0..pair.len())
        .map(|i| {
            let [proximal, distal] = pair.attitudes(i, heading.angle[i]);
            let turn = proximal.inverse() * distal * distal_from_joint;
            let angle = 2.0 * turn.imag().dot(&axes[0]).atan2(turn.w);
            last += (angle - last + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
            last
        })
        .collect()
}

/// The smallest rotation that turns one unit vector into another.
fn smallest_rotation(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    // Between opposite vectors every perpendicular axis serves.
    UnitQuaternion::rotation_between(from, to)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&axes::perpendicular(from), std::f64::consts::PI))
}

/// Standard deviation of the angle at each sample, as [`HingeAngles::flexion_sd`] says.
fn flexion_sd(pair: &Pair, axes: &[Vector3<f64>; 2], heading: &Heading) -> Vec<f64> {
    let mut vertical = Vec::with_capacity(pair.len());
    // Sums up to each sample, so that every window is a difference.
    let mut sums = vec![0.0];
    for i in 0..pair.len() {
        let [proximal, distal] = pair.attitudes(i, heading.angle[i]);
        let (a, b) = (proximal * axes[0], distal * axes[1]);
        sums.push(sums[i] + (a - b).norm_squared());
        vertical.push(a.y);
    }
    let half = DISAGREEMENT_SECONDS * 0.5;
    let (mut first, mut end) = (0, 0);
    let windows = (0..pair.len()).map(|i| {
        let now = pair.seconds[i];
        while pair.seconds[first] < now - half {
            first += 1;
        }
        while end < pair.len() && pair.seconds[end] <= now + half {
            end += 1;
        }
        // Two directions lie across the axis.
        let across = (sums[end] - sums[first]) / (2.0 * (end - first) as f64);
        (across + (vertical[i] * heading.sd[i]).powi(2)).sqrt()
    });
    windows.collect()
}
