//! What the searches look at and repair.

use crate::assessment::JointAngleSettings;
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, POINT_COUNT};
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::observation::{Observations, PointColumns, SeenMask, is_trusted};
use crate::pipeline::joint_angles::sensor_noise::white_noise;
use crate::recording::SkeletonRecording;
use nalgebra::Vector3;

/// What was done to the points of each frame, by frame.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Repairs {
    /// Points whose observation was removed although the sensor gave one.
    pub rejected: Vec<SeenMask>,
    /// Points that left and right limbs had exchanged and that were exchanged back.
    pub exchanged: Vec<SeenMask>,
}

/// A recording under inspection.
#[derive(Debug, Clone)]
pub struct Scene<'a> {
    /// The recording as it came.
    pub(super) skeleton: &'a SkeletonRecording,
    /// Confidence from which the sensor is believed.
    pub(super) min_confidence: f32,
    /// Columns of the twelve points in the recording.
    pub(super) columns: [usize; POINT_COUNT],
    /// The points as they are after the repairs so far, relative to the torso joint, axes of `world`.
    pub(super) observations: Observations,
    /// Standard deviation of each point's white noise, metres.
    pub(super) white: [Vector3<f64>; POINT_COUNT],
    repairs: Repairs,
}

impl<'a> Scene<'a> {
    /// The scene before any repair.
    ///
    /// # Errors
    /// `joints_missing` when the recording lacks a joint that the model needs.
    pub fn new(
        skeleton: &'a SkeletonRecording,
        observations: &Observations,
        settings: &JointAngleSettings,
    ) -> Result<Self, PipelineError> {
        let none = vec![0; observations.len()];
        Ok(Self {
            skeleton,
            min_confidence: settings.min_confidence,
            columns: PointColumns::of(&skeleton.joints)?.points,
            white: white_noise(observations),
            observations: observations.clone(),
            repairs: Repairs { rejected: none.clone(), exchanged: none },
        })
    }

    /// Number of frames.
    pub(super) fn len(&self) -> usize {
        self.observations.len()
    }

    /// Seconds since the first frame.
    pub(super) fn seconds(&self, t: usize) -> f64 {
        (self.observations.time_ns[t] - self.observations.time_ns[0]) as f64 * 1e-9
    }

    /// Median time between frames, seconds; 0 without two frames.
    pub(super) fn median_interval_s(&self) -> f64 {
        let mut intervals: Vec<f64> = (1..self.len()).map(|t| self.observations.interval_s(t)).collect();
        intervals.sort_by(f64::total_cmp);
        intervals.get(intervals.len() / 2).copied().unwrap_or(0.0)
    }

    /// The recording's own name of a point, for example `left_hand` or `left_wrist`.
    pub(super) fn joint(&self, point: usize) -> Joint {
        self.skeleton.joints[self.columns[point]]
    }

    /// True when the sensor gave a column's place in a frame and may be believed.
    pub(super) fn gives(&self, t: usize, column: usize) -> bool {
        is_trusted(self.skeleton.frame_confidence(t)[column], self.min_confidence)
    }

    /// Number of the twelve points that the sensor gave in a frame.
    pub(super) fn points_given(&self, t: usize) -> usize {
        self.columns.iter().filter(|column| self.gives(t, **column)).count()
    }

    /// Takes a point out of a frame.
    pub(super) fn reject(&mut self, t: usize, point: usize) {
        self.observations.points[t][point] = Vector3::repeat(f64::NAN);
        self.repairs.rejected[t] |= 1 << point;
    }

    /// Exchanges the hinges and ends of two limbs in a frame.
    pub(super) fn exchange(&mut self, t: usize, limbs: [Limb; 2]) {
        for level in 1..3 {
            let [left, right] = limbs.map(|limb| point_index(limb, level));
            self.observations.points[t].swap(left, right);
            self.repairs.exchanged[t] |= 1 << left | 1 << right;
        }
    }

    /// The repaired observations and what was done to them.
    pub(super) fn finish(self) -> (Observations, Repairs) {
        (self.observations, self.repairs)
    }
}
