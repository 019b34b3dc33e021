//! The posture at the camera's frames by the default method of joint angles, with what the units know in it. It is what
//! bones follow that wear no unit, or whose unit has dropped out.

use super::alignment::Alignment;
use super::camera::CameraBody;
use super::motion::UnitMotion;
use super::posture::BoneRotations;
use crate::body::bones::bone_rotations;
use crate::body::pose::{POSE_DIMENSION, PoseVector, attitude_offset, hinge_offset};
use crate::body::{BONE_COUNT, Bone, Pose};
use crate::estimation::rate_smoother::{RateFilter, RateHistory, RateModel};
use crate::geometry::attitude::attitude_from_rotation;
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::observation::Frame;
use crate::pipeline::joint_angles::posterior::{PoseCovariance, Posterior};
use crate::pipeline::joint_angles::state_space::{StateSpace, Tuning};
use crate::progress::{Monitor, Step};
use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};
use std::ops::Range;

/// Standard deviation with which a unit knows the attitude of its bone in one frame, radians (2°).
const UNIT_SD: f64 = 2.0 * std::f64::consts::PI / 180.0;
/// The same for the turn of a forearm about itself, which the elbow's hinge does not carry on: pronation (30°).
const PRONATION_SD: f64 = 30.0 * std::f64::consts::PI / 180.0;

/// What is seen in one frame: the camera's points, and the rotation of each bone that a unit is on.
#[derive(Debug, Clone)]
struct AidedFrame {
    frame: Frame,
    bones: [Option<Rotation3<f64>>; BONE_COUNT],
}

/// The skeleton seen by a camera, its bones by units.
struct AidedModel {
    camera: StateSpace,
}

type Information = SMatrix<f64, POSE_DIMENSION, POSE_DIMENSION>;

impl RateModel<POSE_DIMENSION> for AidedModel {
    type Posture = Pose;
    type Observation = AidedFrame;

    fn moved(&self, posture: &Pose, step: &PoseVector) -> Pose {
        posture.perturbed(step)
    }

    fn step_between(&self, from: &Pose, to: &Pose) -> PoseVector {
        to.error_from(from)
    }

    fn information(&self, seen: &AidedFrame, pose: &Pose) -> (Information, PoseVector) {
        let (mut information, mut gradient) = self.camera.information(&seen.frame, pose);
        let rotations = bone_rotations(pose);
        for (bone, observed) in Bone::ALL.into_iter().zip(&seen.bones) {
            if let Some(observed) = observed {
                add_unit(&mut information, &mut gradient, pose, bone, &rotations[bone.index()], observed);
            }
        }
        (information, gradient)
    }

    fn acceleration_density(&self) -> PoseVector {
        self.camera.acceleration_density()
    }
}

/// Adds that a bone was seen in a rotation. A turn of the trunk turns every bone, one of a limb (in the trunk's axes) both
/// of its bones, one of a hinge the distal bone.
fn add_unit(
    information: &mut Information,
    gradient: &mut PoseVector,
    pose: &Pose,
    bone: Bone,
    predicted: &Rotation3<f64>,
    observed: &Rotation3<f64>,
) {
    let error = attitude_from_rotation(&(observed * predicted.inverse()));
    let precision = precision_of(bone, predicted);
    let mut columns: Vec<(usize, Vector3<f64>)> = (0..3).map(|axis| (axis, Vector3::ith(axis, 1.0))).collect();
    if let Some(limb) = bone.limb() {
        let a = attitude_offset(limb.index());
        columns.extend((0..3).map(|axis| (a + axis, pose.trunk.matrix().column(axis).into_owned())));
        if bone == Bone::Distal(limb) {
            columns.push((hinge_offset(limb.index()), predicted * limb.hinge_axis()));
        }
    }
    for (row, a) in &columns {
        let weighted = precision * a;
        gradient[*row] += weighted.dot(&error);
        for (column, b) in &columns {
            information[(*row, *column)] += weighted.dot(b);
        }
    }
}

/// Inverse covariance of a unit's attitude, in `subject`, rad⁻².
fn precision_of(bone: Bone, rotation: &Rotation3<f64>) -> Matrix3<f64> {
    let all = Matrix3::identity() / UNIT_SD.powi(2);
    match bone {
        Bone::Distal(limb) if limb.is_arm() => {
            let along = rotation * bone.direction();
            all + along * along.transpose() * (PRONATION_SD.powi(-2) - UNIT_SD.powi(-2))
        }
        _ => all,
    }
}

/// Time before and after a part in which a bone needs the camera, seconds: the filter finds its way within it.
const LEAD_S: f64 = 1.0;

/// Posture and its covariance at the frames of the camera in which some bone needs it.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraTrack {
    /// Parts without a frame in common, by time.
    parts: Vec<Part>,
}

/// Frames that follow each other.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    time_ns: Vec<i64>,
    frames: Vec<Posterior>,
}

impl CameraTrack {
    /// Runs forwards and back over the frames of the camera around those in which a bone needs it.
    ///
    /// # Errors
    /// [`PipelineError::Cancelled`].
    pub fn of(
        camera: &CameraBody,
        alignment: &Alignment,
        motions: &[UnitMotion],
        from_ns: i64,
        monitor: &Monitor,
    ) -> Result<Self, PipelineError> {
        let followed = || motions.iter().zip(&alignment.units).filter(|(_, unit)| unit.is_determined);
        let times = &camera.observations.time_ns;
        let is_followed = |bone: Bone, time_ns: i64| followed().any(|(m, _)| m.bone == bone && m.at(time_ns).is_some());
        let needs = |time_ns: i64| Bone::ALL.iter().any(|bone| !is_followed(*bone, time_ns));
        let lead_ns = (LEAD_S * 1e9) as i64;
        let mut ranges: Vec<Range<usize>> = Vec::new();
        // A frame between two that need nothing may still lie in a gap: its neighbours lie within the lead.
        for time_ns in times.iter().filter(|time| **time >= from_ns && needs(**time)) {
            let start = times.partition_point(|t| *t < time_ns - lead_ns);
            let end = times.partition_point(|t| *t <= time_ns + lead_ns);
            match ranges.last_mut() {
                Some(last) if start <= last.end => last.end = end,
                _ => ranges.push(start..end),
            }
        }
        monitor.begin(Step::Estimating, ranges.iter().map(|range| range.len() as u64).sum())?;
        let mut parts = Vec::with_capacity(ranges.len());
        for range in ranges {
            parts.push(Part::of(camera, alignment, motions, from_ns, range, monitor)?);
        }
        Ok(Self { parts })
    }

    /// The part that holds a time; outside all the nearest one. None when no frame needed the camera.
    fn part(&self, time_ns: i64) -> Option<&Part> {
        let after = self.parts.partition_point(|part| part.time_ns.last().is_some_and(|last| *last < time_ns));
        self.parts.get(after).or_else(|| self.parts.last())
    }

    /// Rotations of all bones at a time, and the flexion of the hinges.
    pub fn at(&self, time_ns: i64) -> Option<(BoneRotations, [f64; 4])> {
        let part = self.part(time_ns)?;
        let (before, after, share) = part.around(time_ns);
        let (a, b) = (&part.frames[before].pose, &part.frames[after].pose);
        let (from, to) = (bone_rotations(a), bone_rotations(b));
        let bones = std::array::from_fn(|i| {
            let turn = attitude_from_rotation(&(to[i] * from[i].inverse()));
            Rotation3::new(turn * share) * from[i]
        });
        Some((bones, std::array::from_fn(|i| a.hinges[i] + share * (b.hinges[i] - a.hinges[i]))))
    }

    /// The posterior of the frame nearest to a time.
    pub fn nearest(&self, time_ns: i64) -> Option<&Posterior> {
        let part = self.part(time_ns)?;
        let (before, after, share) = part.around(time_ns);
        Some(&part.frames[if share < 0.5 { before } else { after }])
    }

    /// Covariance of the posture's error at the frame nearest to a time.
    pub fn covariance(&self, time_ns: i64) -> Option<PoseCovariance> {
        self.nearest(time_ns)?.covariance
    }
}

impl Part {
    fn of(
        camera: &CameraBody,
        alignment: &Alignment,
        motions: &[UnitMotion],
        from_ns: i64,
        range: Range<usize>,
        monitor: &Monitor,
    ) -> Result<Self, PipelineError> {
        let observations = &camera.observations;
        let state_space = StateSpace::new(camera.skeleton(), &camera.noise, &Tuning::default());
        let (initial, rates) = (state_space.initial_pose(observations), state_space.rate_settings());
        let model = AidedModel { camera: state_space };
        let mut filter = RateFilter::new(initial, rates);
        let mut history = RateHistory::with_capacity(range.len());
        for t in range.clone() {
            let time_ns = observations.time_ns[t];
            let mut bones = [None; BONE_COUNT];
            for (u, motion) in motions.iter().enumerate().filter(|(u, _)| alignment.units[*u].is_determined) {
                if let Some((stretch, earth)) = motion.at(time_ns).filter(|_| time_ns >= from_ns) {
                    bones[motion.bone.index()] = Some(alignment.subject_from_bone(u, time_ns, stretch, &earth));
                }
            }
            let mut frame = observations.frame(t);
            frame.interval_s = if t == range.start { 0.0 } else { frame.interval_s };
            filter.step(&model, &AidedFrame { frame, bones }, frame.interval_s);
            history.push(&filter);
            monitor.advance(1)?;
        }
        let mut frames = Vec::with_capacity(range.len());
        history.smooth(&model, |frame| {
            let points = &observations.points[range.end - 1 - frames.len()];
            frames.push(model.camera.posterior(points, frame.posture, &frame.covariance));
        });
        frames.reverse();
        Ok(Self { time_ns: observations.time_ns[range].to_vec(), frames })
    }

    /// The frames around a time and the share of the later one; before the first and after the last frame, those.
    fn around(&self, time_ns: i64) -> (usize, usize, f64) {
        let after = self.time_ns.partition_point(|t| *t < time_ns).min(self.time_ns.len() - 1);
        let before = after.saturating_sub(1);
        let length = (self.time_ns[after] - self.time_ns[before]).max(1) as f64;
        (before, after, ((time_ns - self.time_ns[before]) as f64 / length).clamp(0.0, 1.0))
    }
}
