//! UTD-MHAD: Kinect v1, 20 joints, with one inertial sensor: on the right thigh in the actions that are imported (a22 to
//! a27), on the wrist in the others, which are passed over.
//!
//! The skeleton has no time stamps and not the 30 frames/s of its sensor; both streams are taken as starting and ending
//! together, so the frame rate is frames / inertial duration (50 samples/s).
//!
//! The unit's samples, sent in g and degrees per second, are the recording's inertial part.
//!
//! The reference is how far the thigh has tilted from its attitude at the start, `right_thigh_tilt_change_deg`: the
//! angle between the direction of gravity in the sensor then and now. It needs no knowledge of how the sensor sat on
//! the thigh. Gravity is carried along by the gyroscope and pulled towards the accelerometer:
//!
//! ```text
//! g ← normalise(g − (ω × g) Δt);    g ← normalise(g + k (a/|a| − g)),   k = Δt / T · exp(−((|a| − 1 g) / s)²)
//! ```

use super::defects::mark_lost;
use super::report::ClockOffset;
use super::table::{Table, existing};
use super::units::{G_M_S2, sensor, unit_notes};
use super::{Dataset, ImportError, ImportNotes, Source, Trial, file_names, regular_times};
use crate::body::Joint;
use crate::recording::{
    Device, Header, InertialRecording, InertialSensor, Recording, ReferenceSeries, Segment, SkeletonRecording,
};
use crate::signal::alignment::{Pair, Search, estimate_lag};
use nalgebra::Vector3;
use std::path::Path;

const INERTIAL_HZ: f64 = 50.0;

/// Time constant of the pull towards the accelerometer, seconds; a movement of these actions takes about as long.
const TIME_CONSTANT_S: f64 = 0.5;

/// Deviation of |a| from 1 g at which the pull is down to 1/e, in g.
const QUIET_G: f64 = 0.1;

/// Samples at the start from which the first direction of gravity is averaged: 0.2 s.
const N_START: usize = 10;

/// Kinect v1 sees too little of the thigh's tilt while sitting (43° of 78°), so a gain is fitted with the lag.
const SEARCH: Search = Search { max_lag_ns: 300_000_000, step_ns: 10_000_000, min_overlap: 0.5, fits_gain: true };

/// Excursion of the reference below which it says nothing of the lag, degrees.
const MIN_EXCURSION_DEG: f64 = 10.0;

/// Part of the variance that the reference must explain for the lag to be believed.
const MIN_EXPLAINED: f64 = 0.7;

/// Order of the joints in a row.
const JOINTS: [Joint; 20] = [
    Joint::Head,
    Joint::SpineShoulder,
    Joint::Torso,
    Joint::Pelvis,
    Joint::LeftShoulder,
    Joint::LeftElbow,
    Joint::LeftWrist,
    Joint::LeftHand,
    Joint::RightShoulder,
    Joint::RightElbow,
    Joint::RightWrist,
    Joint::RightHand,
    Joint::LeftHip,
    Joint::LeftKnee,
    Joint::LeftAnkle,
    Joint::LeftFoot,
    Joint::RightHip,
    Joint::RightKnee,
    Joint::RightAnkle,
    Joint::RightFoot,
];

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let mut sources = Vec::new();
    for file in file_names(root)? {
        let Some(stem) = super::without_gz(&file).strip_suffix("_skeleton.csv") else { continue };
        let Some(exercise) = exercise(stem) else { continue };
        sources.push(Source {
            dataset: Dataset::Utdmhad,
            name: stem.to_owned(),
            exercise: exercise.to_owned(),
            file: root.join(&file),
        });
    }
    Ok(sources)
}

fn exercise(stem: &str) -> Option<&'static str> {
    Some(match stem.split('_').next()? {
        "a22" => "a22_jog_in_place",
        "a23" => "a23_walk_in_place",
        "a24" => "a24_sit_to_stand",
        "a25" => "a25_stand_to_sit",
        "a26" => "a26_forward_lunge",
        "a27" => "a27_squat",
        _ => return None,
    })
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let table = Table::read(&source.file, 1, 3 * JOINTS.len())?;
    let folder = source.file.parent().unwrap_or(Path::new(""));
    let name = format!("{}_inertial.csv", source.name);
    let inertial_file = existing(folder, &name).ok_or_else(|| ImportError::Inconsistent {
        file: source.file.clone(),
        reason: format!("its inertial file {name} is missing, which alone tells the frame rate"),
    })?;
    let inertial = Table::read(&inertial_file, 1, 6)?;
    if table.n_rows() < 2 || inertial.n_rows() < N_START {
        let reason = format!("{} frames and {} inertial samples are too few", table.n_rows(), inertial.n_rows());
        return Err(ImportError::Inconsistent { file: source.file.clone(), reason });
    }
    let frame_rate_hz = table.n_rows() as f64 * INERTIAL_HZ / inertial.n_rows() as f64;
    let mut skeleton = SkeletonRecording {
        joints: JOINTS.to_vec(),
        time_ns: regular_times(table.n_rows(), frame_rate_hz),
        ..SkeletonRecording::default()
    };
    for t in 0..table.n_rows() {
        skeleton.positions.extend(table.row(t).chunks_exact(3).map(|p| Vector3::new(p[0], p[1], p[2])));
        skeleton.confidence.extend([1.0; JOINTS.len()]);
    }
    let defects = mark_lost(&mut skeleton);
    let mut reference = ReferenceSeries {
        channel: "right_thigh_tilt_change_deg".into(),
        source: "inertial-50hz".into(),
        clock_offset_ns: 0,
        time_ns: regular_times(inertial.n_rows(), INERTIAL_HZ),
        values: tilt_change_deg(&inertial),
    };
    let clock_offset = align(&skeleton, &mut reference);
    let unit = thigh_unit(&inertial, reference.clock_offset_ns);
    let notes = ImportNotes {
        name: source.name.clone(),
        dataset: source.dataset.name().to_owned(),
        exercise: source.exercise.clone(),
        n_frames: skeleton.len(),
        frame_rate_hz,
        references: vec![reference.channel.clone()],
        clock_offset,
        defects,
        inertial: vec![unit_notes(&unit)],
        remarks: Vec::new(),
    };
    let header = Header {
        protocol: Some(source.exercise.clone()),
        device: Device { model: Some("kinect-v1".into()), middleware: Some("kinect-sdk-1".into()) },
        ..Header::default()
    };
    let inertial = Some(InertialRecording { sensors: vec![unit] });
    let recording = Recording { header, skeleton: Some(skeleton), inertial, references: vec![reference] };
    Ok(Trial { recording, notes })
}

/// The unit on the right thigh, in SI, with the lag of the reference that was computed from it.
fn thigh_unit(inertial: &Table, clock_offset_ns: i64) -> InertialSensor {
    let time_ns = regular_times(inertial.n_rows(), INERTIAL_HZ);
    let rows = || (0..inertial.n_rows()).map(|i| inertial.row(i));
    let force: Vec<_> = rows().map(|row| Vector3::from_column_slice(&row[..3]) * G_M_S2).collect();
    let rate: Vec<_> = rows().map(|row| Vector3::from_column_slice(&row[3..]).map(f64::to_radians)).collect();
    InertialSensor {
        nominal_rate_hz: Some(INERTIAL_HZ),
        clock_offset_ns,
        ..sensor(Segment::RightThigh, &time_ns, &force, &rate)
    }
}

/// Angle between gravity at the start and gravity at each sample, in the sensor, degrees.
fn tilt_change_deg(inertial: &Table) -> Vec<f64> {
    let dt = 1.0 / INERTIAL_HZ;
    let acceleration = |i: usize| Vector3::from_column_slice(&inertial.row(i)[..3]);
    let start: Vector3<f64> = (0..N_START).map(acceleration).sum();
    let Some(start) = start.try_normalize(1e-9) else { return vec![f64::NAN; inertial.n_rows()] };
    let mut gravity = start;
    (0..inertial.n_rows())
        .map(|i| {
            let rate = Vector3::from_column_slice(&inertial.row(i)[3..]).map(f64::to_radians);
            gravity = (gravity - rate.cross(&gravity) * dt).normalize();
            let a = acceleration(i);
            if let Some(direction) = a.try_normalize(1e-9) {
                let trust = (-((a.norm() - 1.0) / QUIET_G).powi(2)).exp();
                gravity = (gravity + (direction - gravity) * (dt / TIME_CONSTANT_S * trust)).normalize();
            }
            start.angle(&gravity).to_degrees()
        })
        .collect()
}

/// How far the right thigh has tilted from the first frame that shows it, degrees.
pub(super) fn raw_thigh_tilt_change_deg(skeleton: &SkeletonRecording) -> Vec<f64> {
    let (Some(hip), Some(knee)) = (skeleton.column(Joint::RightHip), skeleton.column(Joint::RightKnee)) else {
        return vec![f64::NAN; skeleton.len()];
    };
    let tilt = |t: usize| {
        let frame = skeleton.frame(t);
        (frame[knee] - frame[hip]).angle(&-Vector3::y()).to_degrees()
    };
    let tilts: Vec<f64> = (0..skeleton.len()).map(tilt).collect();
    let first = tilts.iter().copied().find(|tilt| tilt.is_finite()).unwrap_or(f64::NAN);
    tilts.into_iter().map(|tilt| (tilt - first).abs()).collect()
}

fn align(skeleton: &SkeletonRecording, reference: &mut ReferenceSeries) -> Option<ClockOffset> {
    let values = raw_thigh_tilt_change_deg(skeleton);
    let pair = Pair {
        time_ns: &skeleton.time_ns,
        values: &values,
        reference_time_ns: &reference.time_ns,
        reference_values: &reference.values,
    };
    let lag = estimate_lag(&[pair], &SEARCH)?;
    let highest = reference.values.iter().copied().fold(f64::MIN, f64::max);
    let is_determined = !lag.is_at_limit && highest >= MIN_EXCURSION_DEG && lag.explained >= MIN_EXPLAINED;
    reference.clock_offset_ns = if is_determined { lag.lag_ns } else { 0 };
    Some(ClockOffset {
        offset_s: reference.clock_offset_ns as f64 * 1e-9,
        rmse_without_offset_deg: lag.rmse_without_offset,
        is_determined,
    })
}
