//! UI-PRMD: Kinect v2 as local Euler angles and bone offsets, Vicon's model angles beside it.
//!
//! ```text
//! R_local = Rz(a2) Rx(a0) Ry(a1)      W_child = W_parent R_local(child)      p_child = p_parent + W_parent offset(child)
//! ```
//!
//! Orientations are `W`, the middleware's own. Their convention, as the offsets show it: with all angles zero the
//! subject stands in T-posture with x to the subject's left, y up and z forward, and `W` of a joint turns the bone that
//! *leaves* the joint: trunk along +y, thigh and shank along −y, foot along +z, left arm along +x, right arm along −x.
//!
//! Kinect and Vicon were cut apart by hand, so each trial has its own lag. It is estimated from the raw three-point
//! knee angles of both knees, within ±0.7 s (the worst in the data set is 0.6 s).

use super::defects::mark_lost;
use super::report::ClockOffset;
use super::table::{Table, existing};
use super::{Dataset, ImportError, ImportNotes, Source, Trial, file_names, regular_times, without_gz};
use crate::body::{Joint, Side};
use crate::geometry::three_point::flexion_of_three_points;
use crate::recording::{Device, Header, Recording, ReferenceSeries, SkeletonRecording};
use crate::signal::alignment::{Pair, Search, estimate_lag};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::path::Path;

const N_JOINTS: usize = 22;
const KINECT_HZ: f64 = 30.0;
const VICON_HZ: f64 = 100.0;
const VICON_COLUMNS: usize = 117;
const M_PER_CM: f64 = 0.01;

/// Parent of each of the 22 joints; the root is its own.
const PARENTS: [usize; N_JOINTS] = [0, 0, 1, 2, 3, 4, 2, 6, 7, 8, 2, 10, 11, 12, 0, 14, 15, 16, 0, 18, 19, 20];

/// Joints that are imported; head tip and collars have no name here.
const JOINTS: [(usize, Joint); 19] = [
    (4, Joint::Head),
    (3, Joint::Neck),
    (2, Joint::SpineShoulder),
    (1, Joint::Torso),
    (0, Joint::Pelvis),
    (7, Joint::LeftShoulder),
    (8, Joint::LeftElbow),
    (9, Joint::LeftWrist),
    (14, Joint::LeftHip),
    (15, Joint::LeftKnee),
    (16, Joint::LeftAnkle),
    (17, Joint::LeftFoot),
    (11, Joint::RightShoulder),
    (12, Joint::RightElbow),
    (13, Joint::RightWrist),
    (18, Joint::RightHip),
    (19, Joint::RightKnee),
    (20, Joint::RightAnkle),
    (21, Joint::RightFoot),
];

/// Column of knee flexion among Vicon's model angles: triples 19 (left) and 20 (right), x.
const KNEE_COLUMN: [(Side, usize); 2] = [(Side::Left, 19 * 3), (Side::Right, 20 * 3)];

/// Reference excursion below which a knee says nothing of the lag, degrees.
const MIN_EXCURSION_DEG: f64 = 10.0;

/// Part of the variance of the raw knee angles that the reference must explain for the lag to be believed.
const MIN_EXPLAINED: f64 = 0.5;

const SEARCH: Search = Search { max_lag_ns: 700_000_000, step_ns: 10_000_000, min_overlap: 0.5, fits_gain: false };

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let mut sources = Vec::new();
    for (folder, suffix) in [("segmented", ""), ("incorrect", "_inc")] {
        let positions = root.join(folder).join("kinect").join("positions");
        for file in file_names(&positions)? {
            let ending = format!("_positions{suffix}.txt");
            let Some(stem) = without_gz(&file).strip_suffix(&ending) else { continue };
            sources.push(Source {
                dataset: Dataset::Uiprmd,
                name: format!("{stem}{suffix}"),
                exercise: exercise(stem).to_owned(),
                file: positions.join(&file),
            });
        }
    }
    Ok(sources)
}

fn exercise(stem: &str) -> &str {
    match stem.split('_').next().unwrap_or(stem) {
        "m01" => "m01_deep_squat",
        "m02" => "m02_hurdle_step",
        "m03" => "m03_inline_lunge",
        "m04" => "m04_side_lunge",
        "m05" => "m05_sit_to_stand",
        "m06" => "m06_standing_leg_raise",
        "m07" => "m07_shoulder_abduction",
        other => other,
    }
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let positions = Table::read(&source.file, 0, 3 * N_JOINTS)?;
    let is_incorrect = source.name.ends_with("_inc");
    let stem = source.name.trim_end_matches("_inc");
    let suffix = if is_incorrect { "_inc" } else { "" };
    // …/segmented/kinect/positions/FILE
    let device = source.file.ancestors().nth(2).unwrap_or(Path::new(""));
    let folder = device.parent().unwrap_or(Path::new(""));
    let angles_name = format!("{stem}_angles{suffix}.txt");
    let angles_file = existing(&device.join("angles"), &angles_name).ok_or_else(|| ImportError::Inconsistent {
        file: source.file.clone(),
        reason: format!("its angles file kinect/angles/{angles_name} is missing"),
    })?;
    let angles = Table::read(&angles_file, 0, 3 * N_JOINTS)?;
    if angles.n_rows() != positions.n_rows() {
        let reason = format!("{} rows, but {} in the positions", angles.n_rows(), positions.n_rows());
        return Err(ImportError::Inconsistent { file: angles_file, reason });
    }
    let mut skeleton = skeleton_from(&positions, &angles);
    let mut defects = mark_lost(&mut skeleton);
    let mut remarks = Vec::new();
    if is_incorrect {
        remarks.push("the exercise was done wrongly on purpose".to_owned());
    }

    let vicon = folder.join("vicon");
    let (mut references, mut clock_offset) = (Vec::new(), None);
    match existing(&vicon.join("angles"), &angles_name) {
        Some(file) => {
            let angles = Table::read(&file, 0, VICON_COLUMNS)?;
            references = references_from(&angles);
            clock_offset = align(&skeleton, &mut references);
        }
        None => remarks.push("there is no Vicon file for this trial".to_owned()),
    }
    if let Some(file) = existing(&vicon.join("positions"), &format!("{stem}_positions{suffix}.txt")) {
        defects.lost_reference_markers = Table::read(&file, 0, VICON_COLUMNS)?.n_zero_triples();
    }

    let notes = ImportNotes {
        name: source.name.clone(),
        dataset: source.dataset.name().to_owned(),
        exercise: source.exercise.clone(),
        n_frames: skeleton.len(),
        frame_rate_hz: KINECT_HZ,
        references: references.iter().map(|reference| reference.channel.clone()).collect(),
        clock_offset,
        defects,
        inertial: Vec::new(),
        remarks,
    };
    let header = Header {
        protocol: Some(source.exercise.clone()),
        device: Device { model: Some("kinect-v2".into()), middleware: Some("ui-prmd-euler".into()) },
        ..Header::default()
    };
    Ok(Trial { recording: Recording { header, skeleton: Some(skeleton), inertial: None, references }, notes })
}

fn skeleton_from(positions: &Table, angles: &Table) -> SkeletonRecording {
    let n_frames = positions.n_rows();
    let mut skeleton = SkeletonRecording {
        joints: JOINTS.iter().map(|(_, joint)| *joint).collect(),
        time_ns: regular_times(n_frames, KINECT_HZ),
        ..SkeletonRecording::default()
    };
    for t in 0..n_frames {
        let (rotations, points) = absolute(positions.row(t), angles.row(t));
        for (column, _) in JOINTS {
            skeleton.positions.push(points[column] * M_PER_CM);
            skeleton.confidence.push(1.0);
            skeleton.orientations.push(Some(UnitQuaternion::from_rotation_matrix(&rotations[column])));
        }
    }
    skeleton
}

/// `W` and position (in the unit of the offsets) of every joint of one frame.
fn absolute(offsets: &[f64], angles: &[f64]) -> ([Rotation3<f64>; N_JOINTS], [Vector3<f64>; N_JOINTS]) {
    let mut rotations = [Rotation3::identity(); N_JOINTS];
    let mut points = [Vector3::zeros(); N_JOINTS];
    for j in 0..N_JOINTS {
        let triple = |values: &[f64]| Vector3::new(values[3 * j], values[3 * j + 1], values[3 * j + 2]);
        let a = triple(angles).map(f64::to_radians);
        let local = Rotation3::from_axis_angle(&Vector3::z_axis(), a.z)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), a.x)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), a.y);
        if j == 0 {
            (rotations[0], points[0]) = (local, triple(offsets));
        } else {
            let parent = PARENTS[j];
            rotations[j] = rotations[parent] * local;
            points[j] = points[parent] + rotations[parent] * triple(offsets);
        }
    }
    (rotations, points)
}

fn references_from(angles: &Table) -> Vec<ReferenceSeries> {
    let time_ns = regular_times(angles.n_rows(), VICON_HZ);
    let series = |(side, column): (Side, usize)| ReferenceSeries {
        channel: format!("{}_knee_flexion_deg", side.name()),
        source: "vicon-plug-in-gait".into(),
        clock_offset_ns: 0,
        time_ns: time_ns.clone(),
        values: angles.column(column),
    };
    KNEE_COLUMN.map(series).into()
}

/// Raw knee flexion of every frame, degrees.
pub(super) fn raw_knee_flexion_deg(skeleton: &SkeletonRecording, side: Side) -> Vec<f64> {
    let chain = match side {
        Side::Left => [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle],
        Side::Right => [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle],
    };
    let [Some(hip), Some(knee), Some(ankle)] = chain.map(|joint| skeleton.column(joint)) else {
        return vec![f64::NAN; skeleton.len()];
    };
    (0..skeleton.len())
        .map(|t| {
            let frame = skeleton.frame(t);
            flexion_of_three_points(&frame[hip], &frame[knee], &frame[ankle]).to_degrees()
        })
        .collect()
}

/// Estimates the lag from both knees and stores it in the references.
fn align(skeleton: &SkeletonRecording, references: &mut [ReferenceSeries]) -> Option<ClockOffset> {
    let raw = Side::BOTH.map(|side| raw_knee_flexion_deg(skeleton, side));
    let pairs: Vec<Pair<'_>> = raw
        .iter()
        .zip(references.iter())
        .map(|(values, reference)| Pair {
            time_ns: &skeleton.time_ns,
            values,
            reference_time_ns: &reference.time_ns,
            reference_values: &reference.values,
        })
        .collect();
    let lag = estimate_lag(&pairs, &SEARCH)?;
    let excursion = |reference: &ReferenceSeries| {
        let (low, high) = reference.values.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        high - low
    };
    let moves = references.iter().any(|reference| excursion(reference) >= MIN_EXCURSION_DEG);
    let is_determined = !lag.is_at_limit && lag.explained >= MIN_EXPLAINED && moves;
    // Without movement the minimum is noise: the streams are taken as starting together.
    let offset_ns = if is_determined { lag.lag_ns } else { 0 };
    for reference in references.iter_mut() {
        reference.clock_offset_ns = offset_ns;
    }
    Some(ClockOffset {
        offset_s: offset_ns as f64 * 1e-9,
        rmse_without_offset_deg: lag.rmse_without_offset,
        is_determined,
    })
}
