//! How constant the segments of a body are: of the recorded joints, whose bones stretch, and of an estimate, whose bones
//! must not.
//!
//! The estimate's posture goes through forward kinematics frame by frame, and its segments are measured as those of the
//! recording are.

use super::agreement::median;
use super::contender::Contender;
use super::rows::Sets;
use crate::assessment::{AngleChannel, Assessment};
use crate::body::kinematics::forward_kinematics;
use crate::body::pose::{PoseVector, attitude_offset, hinge_offset};
use crate::body::skeleton::point_index;
use crate::body::{Limb, Pose, Skeleton};
use crate::recording::SkeletonRecording;
use serde::Serialize;

/// Constancy of segment lengths in a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegmentLengths {
    /// Where the trials come from.
    pub dataset: String,
    /// Trials.
    pub n_trials: usize,
    /// Largest deviation of a recorded segment from its median length, millimetres, median over trials.
    pub recorded_deviation_mm: Option<f64>,
    /// The method whose output is measured: the default.
    pub method: String,
    /// Largest deviation of a segment of the output from its median length in any trial, millimetres.
    pub output_deviation_mm: Option<f64>,
}

const MM_PER_M: f64 = 1000.0;

/// One line for each data set; none when the default was left out.
pub(super) fn segment_lengths(sets: &Sets<'_>, contenders: &[Contender]) -> Vec<SegmentLengths> {
    let Some(default) = contenders.iter().position(|contender| contender.is_default()) else { return Vec::new() };
    let mut found: Vec<SegmentLengths> = Vec::new();
    for (dataset, exercises) in sets {
        let Some((_, trials)) = exercises.last() else { continue };
        let recorded: Vec<f64> = trials.iter().filter_map(|trial| trial.recorded_length_deviation_m).collect();
        let output = trials.iter().filter_map(|trial| trial.results[default].as_ref().ok()?.length_deviation_m);
        found.push(SegmentLengths {
            dataset: (*dataset).to_owned(),
            n_trials: trials.len(),
            recorded_deviation_mm: median(&recorded).map(|deviation| deviation * MM_PER_M),
            method: contenders[default].name(),
            output_deviation_mm: output.reduce(f64::max).map(|deviation| deviation * MM_PER_M),
        });
    }
    found
}

/// Largest deviation of a recorded limb segment from its median length over the frames, metres; none when no segment
/// was ever seen.
pub fn largest_deviation_recorded(skeleton: &SkeletonRecording) -> Option<f64> {
    let mut largest: Option<f64> = None;
    for limb in Limb::ALL {
        let columns =
            limb.joints().map(|(joint, stand_in)| skeleton.column(joint).or_else(|| skeleton.column(stand_in)));
        for segment in columns.windows(2) {
            let (Some(proximal), Some(distal)) = (segment[0], segment[1]) else { continue };
            let length = |t: usize| (skeleton.frame(t)[distal] - skeleton.frame(t)[proximal]).norm();
            let lengths: Vec<f64> = (0..skeleton.len()).map(length).collect();
            largest = larger(largest, largest_deviation(&lengths));
        }
    }
    largest
}

/// Largest deviation of a limb segment of the estimated body from its median length over the frames, metres; none
/// without a posture.
pub fn largest_deviation_of_output(assessment: &Assessment) -> Option<f64> {
    let lengths = &assessment.quality.calibration.as_ref()?.segments;
    let mut skeleton = Skeleton::of_stature(1.7);
    for limb in Limb::ALL {
        let [proximal, distal] = limb.segment_names();
        let length_of = |name: String| lengths.iter().find(|s| s.segment == name).map(|s| s.length_m);
        skeleton.proximal[limb.index()] = length_of(proximal).unwrap_or(skeleton.proximal[limb.index()]);
        skeleton.distal[limb.index()] = length_of(distal).unwrap_or(skeleton.distal[limb.index()]);
    }
    let mut columns = Vec::new();
    for (element, channel) in channels_of_pose() {
        let name = channel.name();
        columns.push((element, &assessment.series.iter().find(|series| series.channel == name)?.value));
    }
    let mut measured = vec![Vec::with_capacity(assessment.time_ns.len()); 2 * Limb::ALL.len()];
    for t in 0..assessment.time_ns.len() {
        let mut theta = PoseVector::zeros();
        for (element, values) in &columns {
            theta[*element] = f64::from(values[t]).to_radians();
        }
        if !theta.iter().all(|angle| angle.is_finite()) {
            continue;
        }
        let points = forward_kinematics(&skeleton, &Pose::from_vector(&theta));
        for limb in Limb::ALL {
            for level in 0..2 {
                let segment = points[point_index(limb, level + 1)] - points[point_index(limb, level)];
                measured[2 * limb.index() + level].push(segment.norm());
            }
        }
    }
    measured.iter().fold(None, |largest, lengths| larger(largest, largest_deviation(lengths)))
}

/// The channel that holds each element of the pose vector.
fn channels_of_pose() -> Vec<(usize, AngleChannel)> {
    let mut channels: Vec<(usize, AngleChannel)> =
        (0..3).map(|axis| (axis, AngleChannel::TrunkAttitude(axis))).collect();
    for limb in Limb::ALL {
        let side = limb.side();
        let hinge = if limb.is_arm() { AngleChannel::ElbowFlexion(side) } else { AngleChannel::KneeFlexion(side) };
        channels.push((hinge_offset(limb.index()), hinge));
        for axis in 0..3 {
            let attitude = match limb.is_arm() {
                true => AngleChannel::ShoulderAttitude(side, axis),
                false => AngleChannel::HipAttitude(side, axis),
            };
            channels.push((attitude_offset(limb.index()) + axis, attitude));
        }
    }
    channels
}

fn largest_deviation(lengths: &[f64]) -> Option<f64> {
    let middle = median(lengths)?;
    lengths.iter().map(|length| (length - middle).abs()).filter(|deviation| deviation.is_finite()).reduce(f64::max)
}

fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.max(b)),
        _ => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::{JointAngleSettings, Settings};
    use crate::pipeline;
    use crate::progress::Monitor;
    use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};

    #[test]
    fn recorded_bones_stretch_by_centimetres_and_those_of_the_output_not_at_all() {
        let settings =
            SimulationSettings { duration_s: 8.0, ..SimulationSettings::new(Exercise::Step, Preset::Table1, 1) };
        let recording = simulate(&settings).unwrap().recording;
        let recorded = largest_deviation_recorded(recording.skeleton.as_ref().unwrap()).unwrap();
        assert!(recorded > 0.02, "{recorded} m: white noise of Table 1 has up to 180 mm at the hands");
        let settings = Settings::JointAngles(JointAngleSettings::default());
        let assessment = pipeline::assess(&recording, &settings, &Monitor::default()).unwrap();
        let output = largest_deviation_of_output(&assessment).unwrap();
        assert!(output < 1e-12, "{output} m: rounding of a few sums of f64");
    }

    #[test]
    fn the_largest_deviation_is_from_the_median_and_leaves_out_what_was_not_seen() {
        assert_eq!(largest_deviation(&[1.0, 1.0, f64::NAN, 1.0, 0.75]), Some(0.25));
        assert_eq!(largest_deviation(&[f64::NAN]), None);
    }

    #[test]
    fn every_element_of_the_pose_has_one_channel() {
        let mut elements: Vec<usize> = channels_of_pose().into_iter().map(|(element, _)| element).collect();
        elements.sort_unstable();
        assert_eq!(elements, (0..crate::body::POSE_DIMENSION).collect::<Vec<_>>());
    }
}
