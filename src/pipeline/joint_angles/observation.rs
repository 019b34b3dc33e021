//! From skeleton frames to the observations of the model: twelve points relative to the torso joint.

use crate::assessment::JointAngleSettings;
use crate::body::kinematics::Points;
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, POINT_COUNT};
use crate::pipeline::PipelineError;
use crate::recording::SkeletonRecording;
use nalgebra::{Rotation3, Vector3};

/// The observed points of every frame, relative to the torso joint, metres; NaN where a point was not seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Observations {
    /// Time of each frame, nanoseconds.
    pub time_ns: Vec<i64>,
    /// Points in the order of [`point_index`], in the frame that `subject_from_world` leads to.
    pub points: Vec<[Vector3<f64>; POINT_COUNT]>,
    /// Turn about the vertical that has been applied to the points.
    pub subject_from_world: Rotation3<f64>,
}

/// One frame as the Gaussian methods take it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Points relative to the torso joint, metres, in the order of [`point_index`]; NaN where not seen.
    pub points: Points,
    /// Time since the frame before, seconds; 0 for the first.
    pub interval_s: f64,
}

/// Bit mask of the points seen in a frame.
pub type SeenMask = u16;

/// Every point seen.
pub const ALL_SEEN: SeenMask = (1 << POINT_COUNT) - 1;

impl Observations {
    /// Reads the model's points from a recording, still in `world`.
    ///
    /// A point counts as seen when the sensor's confidence in it and in the torso joint reaches
    /// `settings.min_confidence`. Without a torso joint in the recording the middle of shoulders and hips stands in.
    ///
    /// # Errors
    /// `joints_missing` when the recording lacks a joint that the model needs.
    pub fn from_recording(skeleton: &SkeletonRecording, settings: &JointAngleSettings) -> Result<Self, PipelineError> {
        let columns = PointColumns::of(&skeleton.joints)?;
        let read = |t| columns.points(skeleton.frame(t), skeleton.frame_confidence(t), settings.min_confidence);
        let points = (0..skeleton.len()).map(read).collect();
        Ok(Self { time_ns: skeleton.time_ns.clone(), points, subject_from_world: Rotation3::identity() })
    }

    /// Turns the points about the vertical.
    pub fn rotate(&mut self, subject_from_world: Rotation3<f64>) {
        for frame in &mut self.points {
            for point in frame {
                *point = subject_from_world * *point;
            }
        }
        self.subject_from_world = subject_from_world * self.subject_from_world;
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.time_ns.len()
    }

    /// True without any frame.
    pub fn is_empty(&self) -> bool {
        self.time_ns.is_empty()
    }

    /// Time from the previous frame to frame `t`, seconds; 0 for the first.
    pub fn interval_s(&self, t: usize) -> f64 {
        if t == 0 { 0.0 } else { (self.time_ns[t] - self.time_ns[t - 1]) as f64 * 1e-9 }
    }

    /// Frame `t`.
    pub fn frame(&self, t: usize) -> Frame {
        Frame { points: self.points[t], interval_s: self.interval_s(t) }
    }

    /// Time from the first to the last frame, seconds.
    pub fn duration_s(&self) -> f64 {
        match (self.time_ns.first(), self.time_ns.last()) {
            (Some(first), Some(last)) => (last - first) as f64 * 1e-9,
            _ => 0.0,
        }
    }

    /// Points seen in frame `t`.
    pub fn seen(&self, t: usize) -> SeenMask {
        seen_mask(&self.points[t])
    }
}

/// Bit mask of the points that are present.
pub fn seen_mask(points: &[Vector3<f64>; POINT_COUNT]) -> SeenMask {
    let bits = points.iter().enumerate().filter(|(_, point)| point.x.is_finite());
    bits.fold(0, |mask, (p, _)| mask | 1 << p)
}

/// True when the mask holds all three points of a limb.
pub fn sees_limb(mask: SeenMask, limb: Limb) -> bool {
    mask >> point_index(limb, 0) & 0b111 == 0b111
}

/// True when the mask holds at least three of the four limb roots, which fix the trunk.
pub fn sees_trunk(mask: SeenMask) -> bool {
    Limb::ALL.iter().filter(|limb| mask >> point_index(**limb, 0) & 1 == 1).count() >= 3
}

/// True when a confidence reaches the least that is believed; a lost joint (0) never is.
pub fn is_trusted(confidence: f32, min_confidence: f32) -> bool {
    confidence >= min_confidence && confidence > 0.0
}

/// Where the twelve points stand among a sensor's joints.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PointColumns {
    /// Column of each point.
    pub points: [usize; POINT_COUNT],
    /// Columns whose mean is the torso joint: its own, or without one those of shoulders and hips.
    torso: Vec<usize>,
}

impl PointColumns {
    /// The columns of a sensor that reports these joints.
    ///
    /// # Errors
    /// `joints_missing` when the sensor lacks a joint that the model needs.
    pub fn of(joints: &[Joint]) -> Result<Self, PipelineError> {
        let column = |joint: Joint| joints.iter().position(|j| *j == joint);
        let mut points = [0; POINT_COUNT];
        let mut missing = Vec::new();
        for limb in Limb::ALL {
            for (level, (joint, stand_in)) in limb.joints().into_iter().enumerate() {
                match column(joint).or_else(|| column(stand_in)) {
                    Some(column) => points[point_index(limb, level)] = column,
                    None => missing.push(joint.name()),
                }
            }
        }
        if !missing.is_empty() {
            let sentence = format!(
                "joint angles need the joints {}, which this recording does not have; record them, or name them as in \
                 the recording format",
                missing.join(", ")
            );
            return Err(PipelineError::Unsuitable { code: "joints_missing", place: Some("joints".into()), sentence });
        }
        let torso = match column(Joint::Torso) {
            Some(column) => vec![column],
            None => Limb::ALL.iter().map(|limb| points[point_index(*limb, 0)]).collect(),
        };
        Ok(Self { points, torso })
    }

    /// The points of a frame relative to the torso joint, metres; NaN where the sensor's confidence in the point or in
    /// the torso joint is below `min_confidence`. Slices as long as the sensor's joints.
    pub fn points(&self, frame: &[Vector3<f64>], confidence: &[f32], min_confidence: f32) -> Points {
        let seen = |column: usize| {
            let is_seen = is_trusted(confidence[column], min_confidence);
            if is_seen { frame[column] } else { Vector3::repeat(f64::NAN) }
        };
        let torso = self.torso(frame, confidence, min_confidence);
        self.points.map(|column| seen(column) - torso)
    }

    /// The torso joint of a frame, in its axes, metres; NaN where the sensor's confidence in it is below `min_confidence`.
    pub fn torso(&self, frame: &[Vector3<f64>], confidence: &[f32], min_confidence: f32) -> Vector3<f64> {
        let seen = |column: usize| {
            let is_seen = is_trusted(confidence[column], min_confidence);
            if is_seen { frame[column] } else { Vector3::repeat(f64::NAN) }
        };
        self.torso.iter().map(|column| seen(*column)).sum::<Vector3<f64>>() / self.torso.len() as f64
    }
}
