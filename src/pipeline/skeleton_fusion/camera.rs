//! What the camera says of the body: repaired observations, the calibrated skeleton, the vectors between joints.

use crate::assessment::quality::{Event, EventCount};
use crate::assessment::{JointAngleSettings, SkeletonFusionSettings};
use crate::body::kinematics::Points;
use crate::body::skeleton::point_index;
use crate::body::{Bone, Limb, Skeleton};
use crate::pipeline::Inputs;
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::body_knowledge::BodyKnowledge;
use crate::pipeline::joint_angles::calibration::{Calibration, calibrate_with};
use crate::pipeline::joint_angles::events::{Inspection, Repairs, inspect};
use crate::pipeline::joint_angles::observation::{Observations, PointColumns};
use crate::pipeline::joint_angles::sensor_noise::SensorNoise;
use crate::recording::{Header, SkeletonRecording};
use nalgebra::Vector3;

/// The camera's part of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraBody {
    /// Twelve points of each frame in `subject`, relative to the torso joint, metres; NaN where not seen.
    pub observations: Observations,
    /// The torso joint of each frame, turned into the axes of `subject`, metres; NaN where not seen.
    pub torso: Vec<Vector3<f64>>,
    /// Segment lengths and trunk offsets.
    pub calibration: Calibration,
    /// White noise and slow offset of the camera's points.
    pub noise: SensorNoise,
    /// What was done to the observations.
    pub repairs: Repairs,
    /// What went wrong in the camera's recording.
    pub events: Vec<Event>,
    /// How often each kind of it happened.
    pub event_counts: Vec<EventCount>,
}

impl CameraBody {
    /// Reads and calibrates the skeleton of a recording, as the joint-angle pipeline does.
    ///
    /// # Errors
    /// As [`crate::pipeline::joint_angles::assess_with`].
    pub fn of(
        header: &Header,
        skeleton: &SkeletonRecording,
        settings: &SkeletonFusionSettings,
    ) -> Result<Self, PipelineError> {
        let settings = JointAngleSettings { min_confidence: settings.min_confidence, ..JointAngleSettings::default() };
        let recorded = Observations::from_recording(skeleton, &settings)?;
        let Inspection { mut repaired, repairs, events, counts } = inspect(skeleton, &recorded, &settings)?;
        let inputs = Inputs::default();
        let knowledge = BodyKnowledge::of(header, &settings, &inputs);
        let calibration = calibrate_with(&mut repaired, &knowledge)?;
        let noise = SensorNoise::adaptive(&repaired);
        let columns = PointColumns::of(&skeleton.joints)?;
        let torso = (0..skeleton.len()).map(|t| {
            let in_world = columns.torso(skeleton.frame(t), skeleton.frame_confidence(t), settings.min_confidence);
            repaired.subject_from_world * in_world
        });
        Ok(Self {
            torso: torso.collect(),
            observations: repaired,
            calibration,
            noise,
            repairs,
            events,
            event_counts: counts,
        })
    }

    /// The skeleton that was measured.
    pub fn skeleton(&self) -> &Skeleton {
        &self.calibration.skeleton
    }
}

/// A vector between points of the body that is rigid on one bone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoneVector {
    /// The bone.
    pub bone: Bone,
    /// Which of the bone's vectors: a limb's bone has one, along itself; the trunk has two, upwards and to the right.
    pub kind: VectorKind,
}

/// What a [`BoneVector`] joins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorKind {
    /// From the proximal to the distal joint of a limb's bone.
    Along,
    /// From the middle of the hips to the middle of the shoulders.
    Up,
    /// From left to right, shoulders and hips averaged.
    Across,
}

impl BoneVector {
    /// Every vector, in the order of the bones.
    pub fn all() -> Vec<BoneVector> {
        let of_bone = |bone: Bone| match bone.limb() {
            None => vec![VectorKind::Up, VectorKind::Across],
            Some(_) => vec![VectorKind::Along],
        };
        let vectors = |bone| of_bone(bone).into_iter().map(move |kind| BoneVector { bone, kind });
        Bone::ALL.into_iter().flat_map(vectors).collect()
    }

    /// The vector between the points of a frame, in their axes; NaN when one was not seen.
    pub fn of_points(self, points: &Points) -> Vector3<f64> {
        let root = |limb| points[point_index(limb, 0)];
        match (self.kind, self.bone) {
            (VectorKind::Along, Bone::Proximal(limb)) => points[point_index(limb, 1)] - root(limb),
            (VectorKind::Along, Bone::Distal(limb)) => points[point_index(limb, 2)] - points[point_index(limb, 1)],
            (VectorKind::Up, _) => {
                (root(Limb::LeftArm) + root(Limb::RightArm) - root(Limb::LeftLeg) - root(Limb::RightLeg)) / 2.0
            }
            _ => (root(Limb::RightArm) - root(Limb::LeftArm) + root(Limb::RightLeg) - root(Limb::LeftLeg)) / 2.0,
        }
    }

    /// Its direction in the bone's axes, as on a body whose hips and shoulders are level.
    pub fn direction(self) -> Vector3<f64> {
        match self.kind {
            VectorKind::Along => self.bone.direction(),
            VectorKind::Up => Vector3::y(),
            VectorKind::Across => Vector3::z(),
        }
    }

    /// The vector on the calibrated skeleton, in the bone's axes, metres.
    pub fn of_skeleton(self, skeleton: &Skeleton) -> Vector3<f64> {
        let offset = |limb: Limb| skeleton.offsets[limb.index()];
        match (self.kind, self.bone) {
            (VectorKind::Along, Bone::Proximal(limb)) => self.bone.direction() * skeleton.proximal[limb.index()],
            (VectorKind::Along, Bone::Distal(limb)) => self.bone.direction() * skeleton.distal[limb.index()],
            (VectorKind::Up, _) => {
                (offset(Limb::LeftArm) + offset(Limb::RightArm) - offset(Limb::LeftLeg) - offset(Limb::RightLeg)) / 2.0
            }
            _ => {
                (offset(Limb::RightArm) - offset(Limb::LeftArm) + offset(Limb::RightLeg) - offset(Limb::LeftLeg)) / 2.0
            }
        }
    }
}
