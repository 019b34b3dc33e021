//! A real camera with one real unit on the right thigh.
//!
//! The reference is the unit's own tilt against gravity (`right_thigh_tilt_change_deg`), so a contender that uses the unit is
//! not compared with anything independent: the question is how much of what the unit knows arrives in the fused skeleton,
//! and at what price in the places that the camera saw.
//!
//! The reference is the angle between up in the thigh's axes at the start and now. Of a contender with a posture the same is
//! taken; joints alone do not tell how a thigh is turned about itself, so of the raw joints it is the angle between the
//! bone's direction at the start and now. Beside it stands what a camera's tilt does to the naive measure, the change of the
//! angle to the camera's vertical: a thigh that starts behind the vertical swings through it unnoticed.

use super::contender::Contender;
use crate::assessment::{AngleChannel, Assessment, Clocks, SkeletonFusionSettings};
use crate::body::Joint;
use crate::evaluation::agreement::{Agreement, median, quantiles};
use crate::evaluation::reference::interpolated;
use crate::geometry::attitude::rotation_from_attitude;
use crate::pipeline::skeleton_fusion;
use crate::progress::Monitor;
use crate::recording::{Recording, ReferenceSeries, SkeletonRecording};
use nalgebra::{Rotation3, Vector3};
use serde::Serialize;

/// The reference.
pub const CHANNEL: &str = "right_thigh_tilt_change_deg";

/// Time from the first sample over which the tilt at the start is averaged, nanoseconds: that of the reference.
const START_NS: i64 = 200_000_000;

/// Half of the time over which the camera's knee is averaged for its smooth course, nanoseconds: a knee in these exercises
/// takes half a second from one turn to the next.
const HALF_WINDOW_NS: i64 = 150_000_000;

const MM_PER_M: f64 = 1000.0;

/// What one contender did in one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThighErrors {
    /// What was compared.
    pub contender: Contender,
    /// Root mean square error of how far the thigh has turned against the vertical, degrees.
    pub turn_rmse_deg: Option<f64>,
    /// The same of the change of the bone's angle to the camera's vertical, degrees.
    pub tilt_rmse_deg: Option<f64>,
    /// Distance of its right knee from the camera's, median and 95 % quantile, millimetres; for the camera's own joints their
    /// scatter, see [`scatter_mm`]. None for results without places.
    pub knee_mm: Option<[f64; 2]>,
    /// Why there is nothing.
    pub failure: Option<String>,
}

/// Every contender on a recording; nothing for a recording without the reference or a skeleton.
pub fn evaluate(recording: &Recording, contenders: &[Contender]) -> Vec<ThighErrors> {
    let reference = recording.references.iter().find(|series| series.channel == CHANNEL);
    let (Some(reference), Some(skeleton)) = (reference, &recording.skeleton) else { return Vec::new() };
    // The importer knows how far apart camera and unit are, from the same comparison for every contender.
    let others = SkeletonFusionSettings { clocks: Clocks::Declared, ..SkeletonFusionSettings::default() };
    let outcome = |contender: &Contender| {
        let nothing = ThighErrors {
            contender: *contender,
            turn_rmse_deg: None,
            tilt_rmse_deg: None,
            knee_mm: None,
            failure: None,
        };
        let Some(settings) = contender.settings(&others) else {
            let (time_ns, thigh) = (&skeleton.time_ns, raw_thigh(skeleton));
            return ThighErrors {
                turn_rmse_deg: rmse(reference, time_ns, &angle_from_start_deg(time_ns, &thigh)),
                tilt_rmse_deg: rmse(reference, time_ns, &tilt_change_deg(time_ns, &thigh)),
                knee_mm: spread(&scatter_mm(skeleton)),
                ..nothing
            };
        };
        match skeleton_fusion::assess(recording, &settings, &Monitor::default()) {
            Ok(found) => of_assessment(nothing, &found, reference, skeleton),
            Err(error) => ThighErrors { failure: Some(error.to_string()), ..nothing },
        }
    };
    contenders.iter().map(outcome).collect()
}

fn of_assessment(
    nothing: ThighErrors,
    found: &Assessment,
    reference: &ReferenceSeries,
    skeleton: &SkeletonRecording,
) -> ThighErrors {
    let time_ns = &found.time_ns;
    let attitudes = thigh_attitudes(found);
    let places = joint(found, Joint::RightHip).zip(joint(found, Joint::RightKnee));
    // The places are in the camera's frame; a posture alone is in the subject's, whose vertical is the camera's too.
    let thigh: Vec<Vector3<f64>> = match &places {
        Some((hip, knee)) => hip.iter().zip(knee).map(|(hip, knee)| knee - hip).collect(),
        None => attitudes.iter().map(|attitude| attitude * -Vector3::y()).collect(),
    };
    let up: Vec<Vector3<f64>> = attitudes.iter().map(|attitude| attitude.inverse() * Vector3::y()).collect();
    let knee_mm = places.and_then(|(_, knee)| {
        let camera = skeleton.column(Joint::RightKnee)?;
        let distance = |t: usize| {
            let here = at(time_ns, &knee, skeleton.time_ns[t])?;
            Some((here - skeleton.frame(t)[camera]).norm() * MM_PER_M)
        };
        spread(&(0..skeleton.len()).filter_map(distance).collect::<Vec<f64>>())
    });
    ThighErrors {
        turn_rmse_deg: rmse(reference, time_ns, &angle_from_start_deg(time_ns, &up)),
        tilt_rmse_deg: rmse(reference, time_ns, &tilt_change_deg(time_ns, &thigh)),
        knee_mm,
        ..nothing
    }
}

fn rmse(reference: &ReferenceSeries, time_ns: &[i64], estimate: &[f64]) -> Option<f64> {
    Agreement::between(estimate, &interpolated(reference, time_ns)).rmse()
}

/// How far a bone has tilted from the first 0.2 s on, against the vertical y, degrees.
pub fn tilt_change_deg(time_ns: &[i64], bone: &[Vector3<f64>]) -> Vec<f64> {
    let tilts: Vec<f64> = bone.iter().map(|bone| angle_deg(bone, &-Vector3::y())).collect();
    let start = median(&tilts[..n_start(time_ns)]).unwrap_or(f64::NAN);
    tilts.into_iter().map(|tilt| (tilt - start).abs()).collect()
}

/// Angle of each direction to the mean one of the first 0.2 s, degrees.
pub fn angle_from_start_deg(time_ns: &[i64], direction: &[Vector3<f64>]) -> Vec<f64> {
    let start = direction[..n_start(time_ns).min(direction.len())].iter().filter(|d| d.norm().is_finite());
    let start: Vector3<f64> = start.sum();
    direction.iter().map(|direction| angle_deg(direction, &start)).collect()
}

/// Angle between two directions, degrees; NaN when one of them is none.
fn angle_deg(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    let is_direction = |v: &Vector3<f64>| v.norm().is_finite() && v.norm() > 0.0;
    if is_direction(a) && is_direction(b) { a.angle(b).to_degrees() } else { f64::NAN }
}

fn n_start(time_ns: &[i64]) -> usize {
    let end_ns = time_ns.first().map_or(0, |first| first + START_NS);
    time_ns.partition_point(|time| *time < end_ns)
}

/// The camera's way from right hip to right knee in each frame, metres.
fn raw_thigh(skeleton: &SkeletonRecording) -> Vec<Vector3<f64>> {
    let (Some(hip), Some(knee)) = (skeleton.column(Joint::RightHip), skeleton.column(Joint::RightKnee)) else {
        return vec![Vector3::repeat(f64::NAN); skeleton.len()];
    };
    (0..skeleton.len()).map(|t| skeleton.frame(t)[knee] - skeleton.frame(t)[hip]).collect()
}

/// Scatter of the camera's right knee in each frame, millimetres: the root of two squares, its distance from its own course
/// averaged over 0.3 s, and how much the thigh differs from its median length in that frame.
///
/// The first is what is not smooth, the second what no body does; errors that are slow and keep the length are in neither,
/// so the true scatter is larger.
pub fn scatter_mm(skeleton: &SkeletonRecording) -> Vec<f64> {
    let Some(knee) = skeleton.column(Joint::RightKnee) else { return Vec::new() };
    let lengths: Vec<f64> = raw_thigh(skeleton).iter().map(|thigh| thigh.norm()).collect();
    let usual = median(&lengths).unwrap_or(f64::NAN);
    let scatter = |t: usize| {
        let now = skeleton.time_ns[t];
        let first = skeleton.time_ns.partition_point(|time| *time < now - HALF_WINDOW_NS);
        let end = skeleton.time_ns.partition_point(|time| *time <= now + HALF_WINDOW_NS);
        // Only where the window is whole: a mean over one side lags behind.
        let reach = (t - first).min(end - 1 - t);
        let window = t - reach..=t + reach;
        let n = 2 * reach + 1;
        let mean: Vector3<f64> = window.map(|i| skeleton.frame(i)[knee]).sum::<Vector3<f64>>() / n as f64;
        (skeleton.frame(t)[knee] - mean).norm().hypot(lengths[t] - usual) * MM_PER_M
    };
    (0..skeleton.len()).map(scatter).collect()
}

/// Median and 95 % quantile.
fn spread(values: &[f64]) -> Option<[f64; 2]> {
    quantiles(values, [0.5, 0.95])
}

/// Places of a joint in a result, metres in the camera's frame; none when it has none.
fn joint(found: &Assessment, joint: Joint) -> Option<Vec<Vector3<f64>>> {
    let column = |axis: &str| {
        let channel = format!("{}_{axis}_m", joint.name());
        found.series.iter().find(|series| series.channel == channel)
    };
    let (x, y, z) = (column("x")?, column("y")?, column("z")?);
    let place = |i: usize| Vector3::new(x.value[i], y.value[i], z.value[i]).map(f64::from);
    Some((0..x.value.len()).map(place).collect())
}

/// Rotation from the right thigh into the subject's frame at each sample; nothing when the result has no such angles.
fn thigh_attitudes(found: &Assessment) -> Vec<Rotation3<f64>> {
    let attitude = |of: fn(usize) -> AngleChannel| {
        let column = |axis: usize| {
            let channel = of(axis).name();
            found.series.iter().find(|series| series.channel == channel)
        };
        let (x, y, z) = (column(0)?, column(1)?, column(2)?);
        let rotation = |i: usize| {
            let degrees = Vector3::new(x.value[i], y.value[i], z.value[i]).map(f64::from);
            rotation_from_attitude(&degrees.map(f64::to_radians))
        };
        Some((0..x.value.len()).map(rotation).collect::<Vec<_>>())
    };
    let hip = attitude(|axis| AngleChannel::HipAttitude(crate::body::Side::Right, axis));
    let (Some(trunk), Some(hip)) = (attitude(AngleChannel::TrunkAttitude), hip) else { return Vec::new() };
    trunk.iter().zip(&hip).map(|(trunk, hip)| trunk * hip).collect()
}

/// A place at a time, on a line between the samples around it; none outside them.
fn at(time_ns: &[i64], places: &[Vector3<f64>], when_ns: i64) -> Option<Vector3<f64>> {
    let after = time_ns.partition_point(|time| *time < when_ns);
    let b = places.get(after)?;
    if time_ns[after] == when_ns {
        return Some(*b);
    }
    let before = after.checked_sub(1)?;
    let share = (when_ns - time_ns[before]) as f64 / (time_ns[after] - time_ns[before]) as f64;
    Some(places[before].lerp(b, share))
}
