//! Recordings with known truth: a subject, an exercise, a sensor.
//!
//! The subject stands before the sensor and faces it. In `world` (right-handed, y up, z away from the sensor, the
//! sensor at the origin) the subject therefore looks along −z and has the right hand at +x; a yaw turns the subject to
//! the left. The exercise gives postures as a smooth function of time, forward kinematics the true joints, the sensor
//! the recorded ones. Truth comes along on the recording's reference channels.

pub mod clock;
pub mod exercise;
pub mod inertial;
pub mod motion;
pub mod movement;
pub mod posture;
pub mod sensor;
pub mod subject;
pub mod walker;

pub use exercise::Exercise;
pub use inertial::{FusionSimulation, FusionTruth, simulate_fusion};
pub use movement::Movement;
pub use sensor::Preset;
pub use subject::Subject;

use crate::assessment::AngleChannel;
use crate::body::anatomical_angles::{ANGLE_COUNT, angles_of_pose};
use crate::body::kinematics::forward_kinematics;
use crate::body::pose::PoseVector;
use crate::body::{Joint, Pose, Skeleton};
use crate::recording::{Device, Header, Recording, ReferenceSeries, SkeletonRecording};
use nalgebra::{Rotation3, Vector3};
use posture::Stance;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// Name of the reference system on the truth's channels.
pub const TRUTH_SOURCE: &str = "synthetic-truth";

/// Distance of the subject from the sensor, metres.
const DISTANCE_M: f64 = 2.5;

/// Height of the sensor above the floor, metres.
const SENSOR_HEIGHT_M: f64 = 0.9;

/// What is simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulationSettings {
    /// What the subject does.
    pub exercise: Exercise,
    /// What records it.
    pub sensor: Preset,
    /// Length of the recording, seconds; 6 to 3600.
    pub duration_s: f64,
    /// Nominal frame rate, Hz; 1 to 240.
    pub rate_hz: f64,
    /// Whether the time between frames varies as it does with real sensors.
    pub jitter: bool,
    /// The subject's height, metres; 0.5 to 2.5.
    pub stature_m: f64,
    /// The subject's initial turn to the left of the sensor's direction, degrees; −180 to 180.
    pub yaw_deg: f64,
    /// Seed of the subject and the sensor.
    pub seed: u64,
}

impl SimulationSettings {
    /// Twenty seconds at 30 Hz of an average adult who faces the sensor.
    pub fn new(exercise: Exercise, sensor: Preset, seed: u64) -> Self {
        Self { exercise, sensor, duration_s: 20.0, rate_hz: 30.0, jitter: false, stature_m: 1.7, yaw_deg: 0.0, seed }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`SettingOutOfRange`] names the first setting that is outside.
    pub fn check(&self) -> Result<(), SettingOutOfRange> {
        let ranges = [
            ("seconds", self.duration_s, 6.0, 3600.0),
            ("rate", self.rate_hz, 1.0, 240.0),
            ("stature", self.stature_m, 0.5, 2.5),
            ("yaw-deg", self.yaw_deg, -180.0, 180.0),
        ];
        for (name, value, low, high) in ranges {
            // Written so that NaN is outside too.
            if !(low..=high).contains(&value) {
                return Err(SettingOutOfRange { name, value, low, high });
            }
        }
        Ok(())
    }
}

/// A setting that no simulation can have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} is {value}, but must lie between {low} and {high}")]
pub struct SettingOutOfRange {
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
}

/// A recording and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// What the sensor gave, with the truth on its reference channels.
    pub recording: Recording,
    /// The subject.
    pub subject: Subject,
    /// The true posture and place of each frame.
    pub stances: Vec<Stance>,
}

/// Simulates one recording; the same settings give the same recording, bit for bit.
///
/// # Errors
/// [`SettingOutOfRange`] for settings that make no sense.
pub fn simulate(settings: &SimulationSettings) -> Result<Simulation, SettingOutOfRange> {
    settings.check()?;
    let subject = Subject::of_seed(settings.seed, settings.stature_m);
    let mut clock = sensor::stream(settings.seed, sensor::Stream::Clock);
    let gaps = settings.sensor.frame_gaps();
    let time_ns = clock::frame_times_ns(settings.duration_s, settings.rate_hz, settings.jitter, gaps, &mut clock);
    let stances: Vec<Stance> = time_ns
        .iter()
        .map(|time| settings.exercise.stance(&subject, settings.duration_s, *time as f64 * 1e-9))
        .collect();

    let scene = Scene {
        sensor: settings.sensor,
        skeleton: &subject.skeleton,
        stature_m: settings.stature_m,
        yaw_deg: settings.yaw_deg,
    };
    let poses: Vec<Pose> = stances.iter().map(|stance| stance.pose.clone()).collect();
    let thetas = continuous_thetas(&poses);
    let skeleton = scene.record(time_ns, &stances, &poses, &thetas, settings.seed);
    let header = Header {
        protocol: Some(settings.exercise.name().to_owned()),
        device: Device {
            model: Some(settings.sensor.name().to_owned()),
            middleware: Some(format!("surefoot-simulate {}", env!("CARGO_PKG_VERSION"))),
        },
        subject_height_m: Some(settings.stature_m),
        segment_lengths_m: BTreeMap::new(),
        start_time: None,
    };
    let references = truth(&skeleton.time_ns, &poses, &thetas);
    let recording = Recording { header, skeleton: Some(skeleton), inertial: None, references };
    Ok(Simulation { recording, subject, stances })
}

/// `world_from_subject` of a subject who faces the sensor, turned to the left by a yaw in degrees.
pub fn world_from_subject(yaw_deg: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2 + yaw_deg.to_radians())
}

/// State vectors of successive postures, attitude vectors on continuous branches.
fn continuous_thetas(poses: &[Pose]) -> Vec<PoseVector> {
    let mut thetas: Vec<PoseVector> = Vec::with_capacity(poses.len());
    for pose in poses {
        thetas.push(pose.to_vector(thetas.last().unwrap_or(&PoseVector::zeros())));
    }
    thetas
}

/// The place on the floor where the subject first stands, in `world`, metres.
fn standing_place() -> Vector3<f64> {
    Vector3::new(0.0, -SENSOR_HEIGHT_M, DISTANCE_M)
}

/// A subject before a sensor.
struct Scene<'a> {
    sensor: Preset,
    skeleton: &'a Skeleton,
    stature_m: f64,
    yaw_deg: f64,
}

impl Scene<'_> {
    /// What the sensor records of a subject in some stances.
    fn record(
        &self,
        time_ns: Vec<i64>,
        stances: &[Stance],
        poses: &[Pose],
        thetas: &[PoseVector],
        seed: u64,
    ) -> SkeletonRecording {
        let mut recorded = self.true_skeleton(time_ns, stances);
        self.sensor.disturb(&mut recorded, poses, thetas, seed);
        recorded
    }

    /// What a sensor without any error records.
    fn true_skeleton(&self, time_ns: Vec<i64>, stances: &[Stance]) -> SkeletonRecording {
        let joints: Vec<Joint> = self.sensor.joints();
        let turn = world_from_subject(self.yaw_deg);
        let origin = standing_place();
        let mut positions = Vec::with_capacity(joints.len() * stances.len());
        let mut orientations = Vec::with_capacity(joints.len() * stances.len());
        for stance in stances {
            let points = forward_kinematics(self.skeleton, &stance.pose);
            positions.extend(joints.iter().map(|joint| {
                let from_torso = sensor::true_position(*joint, &points, &stance.pose, self.stature_m);
                origin + turn * (stance.torso + from_torso)
            }));
            orientations.extend(sensor::orientation::world_from_joints(&joints, &stance.pose, &turn));
        }
        let confidence = vec![1.0; positions.len()];
        SkeletonRecording { joints, time_ns, positions, confidence, orientations }
    }
}

/// The true series of every channel, degrees; NaN where a decomposition is singular.
fn truth(time_ns: &[i64], poses: &[Pose], thetas: &[PoseVector]) -> Vec<ReferenceSeries> {
    let mut columns = vec![Vec::with_capacity(poses.len()); AngleChannel::all().len()];
    for (pose, theta) in poses.iter().zip(thetas) {
        let (angles, singular) = angles_of_pose(pose);
        for (i, column) in columns.iter_mut().enumerate() {
            column.push(match i {
                _ if i >= ANGLE_COUNT => theta[i - ANGLE_COUNT].to_degrees(),
                _ if singular[i] => f64::NAN,
                _ => angles[i].to_degrees(),
            });
        }
    }
    let series = |(channel, values): (AngleChannel, Vec<f64>)| ReferenceSeries {
        channel: channel.name(),
        source: TRUTH_SOURCE.to_owned(),
        clock_offset_ns: 0,
        time_ns: time_ns.to_vec(),
        values,
    };
    AngleChannel::all().into_iter().zip(columns).map(series).collect()
}

#[cfg(test)]
mod tests;
