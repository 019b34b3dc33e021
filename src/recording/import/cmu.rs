//! CMU motion capture: walking of a fitted model at 120 Hz, whose joint angles are exact by construction.

use super::acclaim::{Skeleton, parse_motion};
use super::table::text_of;
use super::{Dataset, ImportError, ImportNotes, Source, Trial, file_names, regular_times, without_gz};
use crate::body::Joint;
use crate::recording::{Device, Header, Recording, ReferenceSeries, SkeletonRecording};
use nalgebra::Vector3;
use std::path::Path;

const FRAME_HZ: f64 = 120.0;

/// Joints and the bone whose end they are.
const JOINTS: [(Joint, &str); 19] = [
    (Joint::Head, "head"),
    (Joint::Neck, "lowerneck"),
    (Joint::SpineShoulder, "thorax"),
    (Joint::Torso, "lowerback"),
    (Joint::Pelvis, "root"),
    (Joint::LeftShoulder, "lclavicle"),
    (Joint::LeftElbow, "lhumerus"),
    (Joint::LeftWrist, "lradius"),
    (Joint::LeftHip, "lhipjoint"),
    (Joint::LeftKnee, "lfemur"),
    (Joint::LeftAnkle, "ltibia"),
    (Joint::LeftFoot, "lfoot"),
    (Joint::RightShoulder, "rclavicle"),
    (Joint::RightElbow, "rhumerus"),
    (Joint::RightWrist, "rradius"),
    (Joint::RightHip, "rhipjoint"),
    (Joint::RightKnee, "rfemur"),
    (Joint::RightAnkle, "rtibia"),
    (Joint::RightFoot, "rfoot"),
];

/// Bones whose only degree of freedom is knee flexion.
const KNEES: [(&str, &str); 2] = [("left_knee_flexion_deg", "ltibia"), ("right_knee_flexion_deg", "rtibia")];

pub(super) fn list(root: &Path) -> Result<Vec<Source>, ImportError> {
    let mut sources = Vec::new();
    for file in file_names(root)? {
        if let Some(stem) = without_gz(&file).strip_suffix(".amc") {
            sources.push(Source {
                dataset: Dataset::Cmu,
                name: stem.to_owned(),
                exercise: "walking".into(),
                file: root.join(&file),
            });
        }
    }
    Ok(sources)
}

pub(super) fn read(source: &Source) -> Result<Trial, ImportError> {
    let folder = source.file.parent().unwrap_or(Path::new(""));
    let subject = source.name.split('_').next().unwrap_or_default();
    let name = format!("{subject}.asf");
    let asf = super::table::existing(folder, &name).ok_or_else(|| ImportError::Inconsistent {
        file: source.file.clone(),
        reason: format!("its skeleton {name} is missing"),
    })?;
    let (skeleton_text, motion_text) = (text_of(&asf)?, text_of(&source.file)?);
    let recording = recording_from(&skeleton_text, &motion_text, &asf, &source.file)?;
    let notes = ImportNotes {
        name: source.name.clone(),
        dataset: source.dataset.name().to_owned(),
        exercise: source.exercise.clone(),
        n_frames: recording.skeleton.as_ref().map_or(0, SkeletonRecording::len),
        frame_rate_hz: FRAME_HZ,
        references: recording.references.iter().map(|reference| reference.channel.clone()).collect(),
        remarks: vec!["bone lengths are constant by construction: a fitted model, not a sensor".to_owned()],
        ..ImportNotes::default()
    };
    Ok(Trial { recording, notes })
}

/// The recording of a skeleton and a motion text; the files are only named in errors.
pub(super) fn recording_from(
    skeleton_text: &str,
    motion_text: &str,
    skeleton_file: &Path,
    motion_file: &Path,
) -> Result<Recording, ImportError> {
    let inconsistent = |reason: String| ImportError::Inconsistent { file: motion_file.to_owned(), reason };
    let model = Skeleton::parse(skeleton_text, skeleton_file)?;
    let motion = parse_motion(motion_text, motion_file)?;
    let time_ns = regular_times(motion.len(), FRAME_HZ);
    let mut skeleton = SkeletonRecording {
        joints: JOINTS.iter().map(|(joint, _)| *joint).collect(),
        time_ns: time_ns.clone(),
        ..SkeletonRecording::default()
    };
    for (t, frame) in motion.iter().enumerate() {
        if frame.get("root").is_none_or(|values| values.len() != 6) {
            return Err(inconsistent(format!("frame {} has no root with six values", t + 1)));
        }
        let ends = model.ends(frame);
        for (joint, bone) in JOINTS {
            let end: Option<&Vector3<f64>> = ends.get(bone);
            let end = end.ok_or_else(|| inconsistent(format!("the skeleton has no bone `{bone}` for `{joint}`")))?;
            skeleton.positions.push(*end);
            skeleton.confidence.push(1.0);
        }
    }
    let mut references = Vec::new();
    for (channel, bone) in KNEES {
        let value = |frame: &super::acclaim::Frame<'_>| frame.get(bone).and_then(|values| values.first()).copied();
        references.push(ReferenceSeries {
            channel: channel.into(),
            source: "acclaim-model".into(),
            clock_offset_ns: 0,
            time_ns: time_ns.clone(),
            values: motion.iter().map(|frame| value(frame).unwrap_or(f64::NAN)).collect(),
        });
    }
    let header = Header {
        protocol: Some("walking".into()),
        device: Device { model: Some("vicon".into()), middleware: Some("acclaim".into()) },
        ..Header::default()
    };
    Ok(Recording { header, skeleton: Some(skeleton), inertial: None, references })
}
