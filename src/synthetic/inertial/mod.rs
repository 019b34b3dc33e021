//! A camera and up to nine inertial units on one subject, with everything known (\[fusion\]).
//!
//! A movement gives the body as a smooth function of time, and each unit a way through `world`: from the plank over the
//! hand that puts it on to its place on a bone, where soft tissue lets it wobble. The second derivative of that way is
//! what its accelerometer reads (with gravity, and with the shocks of landings), the turning what its gyroscope reads,
//! both through errors of their own and on a clock of their own. Each kind of error is a file with its settings and
//! draws from a random stream of its own for each unit.

pub mod clock;
pub mod defect;
pub mod errors;
pub mod jump;
pub mod mounting;
pub mod path;
pub mod protocol;
mod shock;
pub mod tissue;
mod truth;

use super::clock::frame_times_ns;
use super::movement::Movement;
use super::posture::Stance;
use super::sensor::episode::{Episodes, episodes};
use super::sensor::{Preset, Stream, UnitError, occlusion, standard_normals, stream, unit_stream};
use super::subject::Subject;
use super::{Scene, SettingOutOfRange, continuous_thetas, standing_place, world_from_subject};
use crate::body::bones::bone_rotations;
use crate::body::kinematics::forward_kinematics;
use crate::body::skeleton::point_index;
use crate::body::{Bone, Pose, Skeleton};
use crate::recording::inertial::MOUNTING_SCHEME;
use crate::recording::{Device, Header, InertialRecording, InertialSensor, Recording, Segment};
use clock::{ClockErrors, UnitClock};
use errors::UnitErrors;
use mounting::{Mounting, PuttingOn, bone_from_unit_position};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use path::{GRID_HZ, RigidPath, grid_index, grid_len, grid_time};
use protocol::{Phases, Protocol};
use rand::{Rng, RngExt};
use rayon::prelude::*;
use shock::Shocks;
use std::collections::BTreeMap;
use std::ops::Range;
use tissue::TissueSettings;

/// Standard acceleration of free fall, m/s².
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// Rate of the true joint angles, Hz; a whole share of [`GRID_HZ`] and of a second in nanoseconds.
pub const TRUTH_HZ: f64 = 256.0;

/// Model of the simulated units, as recordings name it.
const DEVICE_MODEL: &str = "simulated-x-imu";

/// What is simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct FusionSimulation {
    /// What the subject does after the protocol.
    pub movement: Movement,
    /// Length of the movement, seconds; 5 to 3600.
    pub movement_s: f64,
    /// What comes before.
    pub protocol: Protocol,
    /// The bones that carry a unit, each once. None: a recording of the camera alone.
    pub units: Vec<Bone>,
    /// Those of `units` that are upside down on their bone against the scheme.
    pub upside_down: Vec<Bone>,
    /// How units are turned against their bones.
    pub mounting: Mounting,
    /// Error of the plank's attitude, standard deviation about each axis, degrees.
    pub plank_error_deg: f64,
    /// Errors of the units' sensors.
    pub errors: UnitErrors,
    /// Errors of the units' clocks.
    pub clocks: ClockErrors,
    /// Soft tissue under the units.
    pub tissue: TissueSettings,
    /// Factor of the vibration after landings; 0 for none.
    pub shock: f64,
    /// Rate of the units, Hz; 50 to 512.
    pub unit_rate_hz: f64,
    /// The camera.
    pub camera: Preset,
    /// Nominal frame rate of the camera, Hz; 1 to 240.
    pub camera_rate_hz: f64,
    /// Whether the time between frames varies as it does with real sensors.
    pub camera_jitter: bool,
    /// Time during the movement in which the camera does not see a limb, several, or the whole body, seconds in all.
    pub occlusion_s: f64,
    /// The subject's height, metres; 0.5 to 2.5. Of a recorded motion, that of the person recorded is taken.
    pub stature_m: f64,
    /// The subject's initial turn to the left of the sensor's direction, degrees; −180 to 180.
    pub yaw_deg: f64,
    /// Seed of the subject, the camera and the units.
    pub seed: u64,
}

impl FusionSimulation {
    /// Thirty seconds of a movement after the paper's protocol: nine units with the usual errors, and a Kinect with its
    /// offsets.
    pub fn new(movement: Movement, seed: u64) -> Self {
        Self {
            movement,
            movement_s: 30.0,
            protocol: Protocol::FULL,
            units: Bone::ALL.to_vec(),
            upside_down: Vec::new(),
            mounting: Mounting::USUAL,
            plank_error_deg: 0.5,
            errors: UnitErrors::default(),
            clocks: ClockErrors::default(),
            tissue: TissueSettings::default(),
            shock: 1.0,
            unit_rate_hz: 256.0,
            camera: Preset::KinectOffset,
            camera_rate_hz: 30.0,
            camera_jitter: true,
            occlusion_s: 0.0,
            stature_m: 1.7,
            yaw_deg: 0.0,
            seed,
        }
    }

    /// The same without any error of units, clocks, mounting, tissue or camera.
    pub fn without_errors(movement: Movement, seed: u64) -> Self {
        Self {
            mounting: Mounting::Scheme(0.0..0.0),
            plank_error_deg: 0.0,
            errors: UnitErrors::NONE,
            clocks: ClockErrors::NONE,
            tissue: TissueSettings::RIGID,
            shock: 0.0,
            camera: Preset::Clean,
            camera_jitter: false,
            ..Self::new(movement, seed)
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`SettingOutOfRange`] names the first setting that is outside.
    pub fn check(&self) -> Result<(), SettingOutOfRange> {
        let mounting = match &self.mounting {
            Mounting::Scheme(degrees) => [degrees.start, degrees.end],
            Mounting::Arbitrary => [0.0; 2],
        };
        let ranges = [
            ("seconds", self.movement_s, 5.0, 3600.0),
            ("rate", self.camera_rate_hz, 1.0, 240.0),
            ("unit-rate", self.unit_rate_hz, 50.0, GRID_HZ),
            ("stature", self.stature_m, 0.5, 2.5),
            ("yaw-deg", self.yaw_deg, -180.0, 180.0),
            ("occlusion", self.occlusion_s, 0.0, 3600.0),
            ("clock-offset-s", self.clocks.offset_s, 0.0, 3600.0),
            ("drift-ppm", self.clocks.drift_ppm, 0.0, 10_000.0),
            ("misalignment-deg", mounting[0], 0.0, 180.0),
            ("misalignment-deg", mounting[1], mounting[0], 180.0),
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

/// A recording and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct FusionTruth {
    /// What camera and units gave, with the truth on its reference channels (`docs/recording-format.md` lists them).
    pub recording: Recording,
    /// The subject.
    pub subject: Subject,
    /// When what happened.
    pub phases: Phases,
    /// Times of `stances` on the camera's clock, nanoseconds: [`TRUTH_HZ`], from 0.
    pub time_ns: Vec<i64>,
    /// The true body.
    pub stances: Vec<Stance>,
    /// The units, in the order of [`Bone::ALL`].
    pub units: Vec<UnitTruth>,
    /// When the camera did not see parts of the body, on its clock, seconds.
    pub occlusions: Vec<Range<f64>>,
}

/// What is true of one unit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitTruth {
    /// The bone that it is on.
    pub bone: Bone,
    /// Its mounting, soft tissue at rest.
    pub bone_from_imu: UnitQuaternion<f64>,
    /// Its clock.
    pub clock: UnitClock,
    /// Bias of its gyroscope in the first sample, rad/s, in `imu`.
    pub gyroscope_bias: Vector3<f64>,
    /// `world_from_imu` at each of its samples, wobble included.
    pub world_from_imu: Vec<UnitQuaternion<f64>>,
    /// Its position in `world` at each of its samples, metres, wobble included.
    pub position: Vec<Vector3<f64>>,
}

/// Simulates one recording; the same settings give the same recording, bit for bit.
///
/// # Errors
/// [`SettingOutOfRange`] for settings that make no sense.
pub fn simulate_fusion(settings: &FusionSimulation) -> Result<FusionTruth, SettingOutOfRange> {
    settings.check()?;
    let subject = settings.movement.subject(settings.seed, settings.stature_m);
    let phases = Phases::of(settings.protocol, settings.movement_s, subject.stature_m, settings.seed);
    let body = |t: f64| phases.stance(&subject, &settings.movement, t);
    let grid: Vec<Stance> = (0..grid_len(phases.end_s)).into_par_iter().map(|i| body(grid_time(i))).collect();

    let bones: Vec<Bone> = Bone::ALL.into_iter().filter(|bone| settings.units.contains(bone)).collect();
    let made: Vec<(InertialSensor, UnitTruth)> =
        bones.into_par_iter().map(|bone| unit(settings, &subject.skeleton, &phases, &grid, bone)).collect();
    let (sensors, units): (Vec<InertialSensor>, Vec<UnitTruth>) = made.into_iter().unzip();

    let every = (GRID_HZ / TRUTH_HZ) as usize;
    let count = (phases.end_s * TRUTH_HZ) as usize + 1;
    let time_ns: Vec<i64> = (0..count).map(|k| (k as f64 * 1e9 / TRUTH_HZ).round() as i64).collect();
    let stances: Vec<Stance> = (0..count).map(|k| grid[grid_index(every * k)].clone()).collect();
    drop(grid);
    let poses: Vec<Pose> = stances.iter().map(|stance| stance.pose.clone()).collect();
    let mut references = super::truth(&time_ns, &poses, &continuous_thetas(&poses));
    references.iter_mut().flat_map(|series| &mut series.values).for_each(|value| *value = six_decimals(*value));
    references.extend(truth::of_protocol(&phases));
    references.extend(units.iter().flat_map(truth::of_unit));

    let (skeleton, occlusions) = film(settings, &subject, &phases, body);
    let header = Header {
        protocol: Some(settings.movement.name().to_owned()),
        device: Device {
            model: Some(settings.camera.name().to_owned()),
            middleware: Some(format!("surefoot-simulate {}", env!("CARGO_PKG_VERSION"))),
        },
        subject_height_m: Some(subject.stature_m),
        segment_lengths_m: BTreeMap::new(),
        start_time: None,
    };
    let inertial = (!sensors.is_empty()).then_some(InertialRecording { sensors });
    let recording = Recording { header, skeleton: Some(skeleton), inertial, references };
    Ok(FusionTruth { recording, subject, phases, time_ns, stances, units, occlusions })
}

/// What the camera records, and when it did not see everything.
fn film(
    settings: &FusionSimulation,
    subject: &Subject,
    phases: &Phases,
    body: impl Fn(f64) -> Stance,
) -> (crate::recording::SkeletonRecording, Vec<Range<f64>>) {
    let mut clock = stream(settings.seed, Stream::Clock);
    let gaps = settings.camera.frame_gaps();
    let time_ns = frame_times_ns(phases.end_s, settings.camera_rate_hz, settings.camera_jitter, gaps, &mut clock);
    let stances: Vec<Stance> = time_ns.iter().map(|time| body(*time as f64 * 1e-9)).collect();
    let poses: Vec<Pose> = stances.iter().map(|stance| stance.pose.clone()).collect();
    let scene = Scene {
        sensor: settings.camera,
        skeleton: &subject.skeleton,
        stature_m: subject.stature_m,
        yaw_deg: settings.yaw_deg,
    };
    let mut skeleton = scene.record(time_ns, &stances, &poses, &continuous_thetas(&poses), settings.seed);
    let mut rng = stream(settings.seed, Stream::Occlusion);
    let occlusions = occlusion::apply(&mut skeleton, settings.occlusion_s, phases.movement.clone(), &mut rng);
    (skeleton, occlusions)
}

/// One unit's samples and what is true of it.
fn unit(
    settings: &FusionSimulation,
    skeleton: &Skeleton,
    phases: &Phases,
    grid: &[Stance],
    bone: Bone,
) -> (InertialSensor, UnitTruth) {
    let random = |kind: UnitError| unit_stream(settings.seed, bone.index(), kind);
    let upside_down = settings.upside_down.contains(&bone);
    let bone_from_imu = settings.mounting.draw(bone, upside_down, &mut random(UnitError::Mounting));
    let shocks = Shocks::draw(&phases.jumps, bone, settings.shock, &mut random(UnitError::Shock));
    let rigid = path_on_bone(settings, skeleton, grid, bone, &bone_from_imu);
    let mounted = settings.tissue.wobble(&rigid, bone, |i| shocks.at(i));
    let plank_error = standard_normals(&mut stream(settings.seed, Stream::Plank)) * settings.plank_error_deg;
    let plank_error = UnitQuaternion::new(plank_error.map(f64::to_radians));
    let handling = &mut random(UnitError::Handling);
    let path = match PuttingOn::draw(phases, bone, &standing_place(), &plank_error, handling) {
        Some(putting_on) => putting_on.path(&mounted),
        None => mounted,
    };

    let mut rng = random(UnitError::Clock);
    let clock = settings.clocks.draw(&mut rng);
    let time_ns = clock.time_stamps(settings.unit_rate_hz, phases.end_s, rng.random());
    let kept = kept_samples(&time_ns, settings.errors.gaps, &mut random(UnitError::Gaps));
    let times: Vec<f64> = time_ns.iter().map(|time| clock.camera_time(*time as f64 * 1e-9)).collect();
    let samples = settings.errors.measure(
        &path.readings(|i| shocks.at(i)),
        &times,
        settings.unit_rate_hz,
        settings.seed,
        bone.index(),
    );
    let times = retained(times, &kept);
    let sensor = InertialSensor {
        device_model: Some(DEVICE_MODEL.to_owned()),
        mounting: match settings.mounting {
            Mounting::Scheme(_) => Some(MOUNTING_SCHEME.to_owned()),
            Mounting::Arbitrary => None,
        },
        nominal_rate_hz: Some(settings.unit_rate_hz),
        time_ns: retained(time_ns, &kept),
        acceleration: retained(samples.acceleration, &kept).into_iter().map(|a| a.map(six_decimals)).collect(),
        angular_rate: retained(samples.angular_rate, &kept).into_iter().map(|w| w.map(six_decimals)).collect(),
        ..InertialSensor::new(Segment::of_bone(bone))
    };
    let truth = UnitTruth {
        bone,
        bone_from_imu,
        clock,
        gyroscope_bias: samples.gyroscope_bias,
        world_from_imu: times.iter().map(|t| path.rotation_at(*t)).collect(),
        position: times.iter().map(|t| path::value_at(&path.position, *t)).collect(),
    };
    (sensor, truth)
}

/// The way of a unit that is rigid with its bone.
fn path_on_bone(
    settings: &FusionSimulation,
    skeleton: &Skeleton,
    grid: &[Stance],
    bone: Bone,
    bone_from_imu: &UnitQuaternion<f64>,
) -> RigidPath {
    let turn = world_from_subject(settings.yaw_deg);
    let origin = standing_place();
    let in_bone = bone_from_unit_position(skeleton, bone);
    let place = |stance: &Stance| {
        let subject_from_bone: Rotation3<f64> = bone_rotations(&stance.pose)[bone.index()];
        let start = match bone {
            Bone::Trunk => Vector3::zeros(),
            Bone::Proximal(limb) => forward_kinematics(skeleton, &stance.pose)[point_index(limb, 0)],
            Bone::Distal(limb) => forward_kinematics(skeleton, &stance.pose)[point_index(limb, 1)],
        };
        let position = origin + turn * (stance.torso + start + subject_from_bone * in_bone);
        (position, UnitQuaternion::from_rotation_matrix(&(turn * subject_from_bone)) * bone_from_imu)
    };
    let (position, rotation) = grid.iter().map(place).unzip();
    RigidPath { position, rotation }
}

/// Which samples arrive; the first always does.
fn kept_samples(time_ns: &[i64], gaps: Episodes, rng: &mut impl Rng) -> Vec<bool> {
    let first = time_ns.first().copied().unwrap_or(0);
    let since_first: Vec<i64> = time_ns.iter().map(|time| time - first).collect();
    let mut kept = vec![true; time_ns.len()];
    for lost in episodes(&since_first, gaps, rng) {
        kept[lost].fill(false);
    }
    if let Some(first) = kept.first_mut() {
        *first = true;
    }
    kept
}

/// A number as it is written to a recording: far finer than any sensor's step, and a third of the digits.
fn six_decimals(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Those of some values whose flag is set.
fn retained<T>(values: Vec<T>, flags: &[bool]) -> Vec<T> {
    values.into_iter().zip(flags).filter_map(|(value, keep)| keep.then_some(value)).collect()
}

#[cfg(test)]
mod tests;
