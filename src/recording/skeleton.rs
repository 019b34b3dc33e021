//! Skeleton frames and reference series in memory.

use crate::body::Joint;
use nalgebra::{UnitQuaternion, Vector3};

/// A sequence of skeleton frames, frame-major: joint `j` of frame `t` is element `t * joints.len() + j`.
///
/// Time stamps are strictly increasing nanoseconds. A joint that the sensor lost has confidence 0 and a position of
/// NaN; every other number is finite.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SkeletonRecording {
    /// The joints of every frame, without repetition.
    pub joints: Vec<Joint>,
    /// Time of each frame, nanoseconds from the recording's own zero.
    pub time_ns: Vec<i64>,
    /// Positions in `world` (right-handed, y up), metres.
    pub positions: Vec<Vector3<f64>>,
    /// The sensor's confidence in each joint, 0 (lost) to 1.
    pub confidence: Vec<f32>,
    /// `world_from_joint` of each joint where the middleware gave one; empty when it gave none at all.
    pub orientations: Vec<Option<UnitQuaternion<f64>>>,
}

impl SkeletonRecording {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.time_ns.len()
    }

    /// True without any frame.
    pub fn is_empty(&self) -> bool {
        self.time_ns.is_empty()
    }

    /// Column of a joint in every frame.
    pub fn column(&self, joint: Joint) -> Option<usize> {
        self.joints.iter().position(|&j| j == joint)
    }

    /// Positions of frame `t` in `world`, metres, in the order of `joints`.
    pub fn frame(&self, t: usize) -> &[Vector3<f64>] {
        let n = self.joints.len();
        &self.positions[t * n..(t + 1) * n]
    }

    /// Confidence of frame `t`, in the order of `joints`.
    pub fn frame_confidence(&self, t: usize) -> &[f32] {
        let n = self.joints.len();
        &self.confidence[t * n..(t + 1) * n]
    }

    /// Time between the first and the last frame, seconds.
    pub fn duration_s(&self) -> f64 {
        match (self.time_ns.first(), self.time_ns.last()) {
            (Some(first), Some(last)) => (last - first) as f64 * 1e-9,
            _ => 0.0,
        }
    }
}

/// A gold-standard series that came with a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReferenceSeries {
    /// What it measures, named as the assessment's channel is, for example `right_knee_flexion_deg`.
    pub channel: String,
    /// The reference system, for example `vicon-plug-in-gait`.
    pub source: String,
    /// To be added to `time_ns` to reach the skeleton's clock, nanoseconds.
    pub clock_offset_ns: i64,
    /// Time on the reference's own clock, nanoseconds, strictly increasing.
    pub time_ns: Vec<i64>,
    /// Values in the unit that ends the channel's name; NaN where the reference has none.
    pub values: Vec<f64>,
}
