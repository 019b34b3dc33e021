//! KERAAL: Kinect v2 with positions and quaternions, x y z qw qx qy qz for each of 25 joints, 30 frames/s.
//!
//! Orientations are the Kinect SDK's: local y of a joint lies along the bone that *arrives* at it from its parent. That
//! settles the order of the quaternion's numbers, which is described as qx qy qz qw: with the scalar first, y lies
//! along the bone to 0.1° in every joint and frame; with the scalar last it points anywhere.
//! Joints at the ends of limbs and the head have none (four zeros). The Vicon files hold rigid targets on the body, not
//! joint centres, so there is no angle reference.

use super::defects::mark_lost;
use super::table::Table;
use super::{Dataset, ImportError, ImportNotes, Source, Trial, file_names, regular_times, without_gz};
use crate::body::Joint;
use crate::recording::{Device, Header, Recording, SkeletonRecording};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;

const KINECT_HZ: f64 = 30.0;
const VALUES_PER_JOINT: usize = 7;

/// Order of the joints in a row.
const JOINTS: [Joint; 25] = [
    Joint::Pelvis,
    Joint::Torso,
    Joint::Neck,
    Joint::Head,
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
    Joint::SpineShoulder,
    Joint::LeftHandTip,
    Joint::LeftThumb,
    Joint::RightHandTip,
    Joint::RightThumb,
];

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let mut sources = Vec::new();
    for file in file_names(root)? {
        let Some(stem) = without_gz(&file).strip_suffix(".txt") else { continue };
        // Group-Device-Exercise-Subject-…
        let parts: Vec<&str> = stem.split('-').collect();
        if parts.len() < 4 || parts[1] != "Kinect" {
            continue;
        }
        sources.push(Source {
            dataset: Dataset::Keraal,
            name: stem.replace("-Kinect-", "-"),
            exercise: parts[2].to_ascii_lowercase(),
            file: root.join(&file),
        });
    }
    Ok(sources)
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let table = Table::read(&source.file, 0, VALUES_PER_JOINT * JOINTS.len())?;
    let mut skeleton = SkeletonRecording {
        joints: JOINTS.to_vec(),
        time_ns: regular_times(table.n_rows(), KINECT_HZ),
        ..SkeletonRecording::default()
    };
    let mut n_zero = 0;
    for t in 0..table.n_rows() {
        for values in table.row(t).chunks_exact(VALUES_PER_JOINT) {
            skeleton.positions.push(Vector3::new(values[0], values[1], values[2]));
            skeleton.confidence.push(1.0);
            let q = Quaternion::new(values[3], values[4], values[5], values[6]);
            let orientation = UnitQuaternion::try_new(q, 0.5);
            n_zero += u64::from(orientation.is_none());
            skeleton.orientations.push(orientation);
        }
    }
    let mut defects = mark_lost(&mut skeleton);
    defects.zero_quaternions = n_zero;
    let notes = ImportNotes {
        name: source.name.clone(),
        dataset: source.dataset.name().to_owned(),
        exercise: source.exercise.clone(),
        n_frames: skeleton.len(),
        frame_rate_hz: KINECT_HZ,
        defects,
        remarks: vec!["the Vicon targets are not joint centres: there is no angle reference".to_owned()],
        ..ImportNotes::default()
    };
    let header = Header {
        protocol: Some(source.exercise.clone()),
        device: Device { model: Some("kinect-v2".into()), middleware: Some("kinect-sdk-2".into()) },
        ..Header::default()
    };
    Ok(Trial {
        recording: Recording { header, skeleton: Some(skeleton), inertial: None, references: Vec::new() },
        notes,
    })
}
