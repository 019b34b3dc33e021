//! A motion that somebody did before a sensor, as a smooth function of time.
//!
//! The default joint-angle method fits a rigid skeleton to the recording; splines through its angles and through the
//! place of the torso joint are the motion. They follow the recording closely, not exactly: the motion is a truth of its
//! own, with the variety of a real one.

use super::spline::Spline;
use crate::assessment::{AngleChannel, JointAngleSettings};
use crate::body::anatomical_angles::{ANGLE_COUNT, arm_offset, leg_offset};
use crate::body::kinematics::forward_kinematics;
use crate::body::pose::{PoseVector, hinge_offset};
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, POSE_DIMENSION, Pose, Skeleton};
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::assess;
use crate::pipeline::joint_angles::calibration::calibrate;
use crate::pipeline::joint_angles::observation::Observations;
use crate::progress::Monitor;
use crate::recording::{Recording, SkeletonRecording};
use crate::synthetic::posture::{ANKLE_HEIGHT_SHARE, Stance};
use nalgebra::{SVector, Vector3};

/// Time between knots, seconds. Movement of a body has little above 4 Hz, and knots of 0.12 s carry that.
const KNOT_S: f64 = 0.12;

/// Time in which a motion comes from rest to the speed at which it was recorded, seconds.
const RAMP_S: f64 = 0.8;

/// Length of both leg segments as a share of stature (Winter 2009, Figure 4.1).
const LEG_SHARE: f64 = 0.491;

/// Elements of θ and the three coordinates of the torso joint.
const DIMENSION: usize = POSE_DIMENSION + 3;

/// A fitted motion, in `subject`: X forward at the start, Y up, the floor at 0.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedMotion {
    skeleton: Skeleton,
    curve: Spline<DIMENSION>,
    duration_s: f64,
}

impl RecordedMotion {
    /// Fits the motion of a recording.
    ///
    /// # Errors
    /// Those of the joint-angle pipeline; also `too_few_frames` when fewer than two frames show the body.
    pub fn fit(recording: &Recording) -> Result<Self, PipelineError> {
        let settings = JointAngleSettings::default();
        let assessment = assess(recording, &settings, &Monitor::default())?;
        let Some(recorded) = &recording.skeleton else { return Err(too_few_frames()) };
        let mut observations = Observations::from_recording(recorded, &settings)?;
        let skeleton = calibrate(&mut observations)?.skeleton;
        let channels = state_channels();
        let first_ns = assessment.time_ns.first().copied().unwrap_or(0);
        let (mut times, mut samples) = (Vec::new(), Vec::new());
        for (t, time_ns) in assessment.time_ns.iter().enumerate() {
            let theta = PoseVector::from_fn(|i, _| f64::from(assessment.series[channels[i]].value[t]).to_radians());
            let Some(world) = torso_in_world(recorded, t) else { continue };
            let torso = observations.subject_from_world * world;
            if theta.iter().chain(&torso).all(|value| value.is_finite()) {
                let mut sample = SVector::<f64, DIMENSION>::zeros();
                sample.fixed_rows_mut::<POSE_DIMENSION>(0).copy_from(&theta);
                sample.fixed_rows_mut::<3>(POSE_DIMENSION).copy_from(&torso);
                times.push((time_ns - first_ns) as f64 * 1e-9);
                samples.push(sample);
            }
        }
        if times.len() < 2 {
            return Err(too_few_frames());
        }
        unwrap_attitudes(&mut samples);
        let start = samples[0].fixed_rows::<3>(POSE_DIMENSION).into_owned();
        let floor = floor_height(&skeleton, &samples) - ANKLE_HEIGHT_SHARE * stature_of(&skeleton);
        for sample in &mut samples {
            sample[POSE_DIMENSION] -= start.x;
            sample[POSE_DIMENSION + 1] -= floor;
            sample[POSE_DIMENSION + 2] -= start.z;
        }
        let duration_s = times[times.len() - 1] - times[0];
        let offset = times[0];
        times.iter_mut().for_each(|time| *time -= offset);
        Ok(Self { skeleton, curve: Spline::fit(&times, &samples, KNOT_S), duration_s })
    }

    /// Segment lengths of the person who was recorded.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// The stature that an average adult with these legs has, metres.
    pub fn stature_m(&self) -> f64 {
        stature_of(&self.skeleton)
    }

    /// Length of the motion, seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The body at `t` seconds from the motion's start.
    pub fn stance(&self, t: f64) -> Stance {
        stance_of(&self.curve.at(t))
    }

    /// Time that one way through the motion takes in [`RecordedMotion::forth_and_back`], seconds.
    pub fn pass_s(&self) -> f64 {
        self.duration_s + self.ramp_s()
    }

    /// The body at `t` seconds when it goes through the motion forth and back for ever, from rest to rest each way. In
    /// between it is as fast as it was recorded.
    pub fn forth_and_back(&self, t: f64) -> Stance {
        let (pass_s, ramp_s) = (self.pass_s(), self.ramp_s());
        let pass = (t / pass_s).max(0.0);
        let u = pass.fract() * pass_s;
        // Integral of the minimum-jerk course: the way while the speed goes from 0 to 1.
        let ramp = |u: f64| {
            let x = (u / ramp_s).clamp(0.0, 1.0);
            ramp_s * x.powi(4) * (2.5 + x * (x - 3.0))
        };
        let forth = if 2.0 * u < pass_s {
            ramp(u) + (u - ramp_s).max(0.0)
        } else {
            self.duration_s - ramp(pass_s - u) - (pass_s - u - ramp_s).max(0.0)
        };
        let is_back = pass as u64 % 2 == 1;
        self.stance(if is_back { self.duration_s - forth } else { forth })
    }

    fn ramp_s(&self) -> f64 {
        RAMP_S.min(self.duration_s)
    }
}

fn stance_of(sample: &SVector<f64, DIMENSION>) -> Stance {
    Stance {
        pose: Pose::from_vector(&sample.fixed_rows::<POSE_DIMENSION>(0).into_owned()),
        torso: sample.fixed_rows::<3>(POSE_DIMENSION).into_owned(),
    }
}

fn too_few_frames() -> PipelineError {
    PipelineError::unsuitable("too_few_frames", "fewer than two frames show the body; choose another recording")
}

fn stature_of(skeleton: &Skeleton) -> f64 {
    let leg = |limb: Limb| skeleton.proximal[limb.index()] + skeleton.distal[limb.index()];
    (leg(Limb::LeftLeg) + leg(Limb::RightLeg)) / (2.0 * LEG_SHARE)
}

/// For each element of θ, the number of its series in an assessment.
fn state_channels() -> [usize; POSE_DIMENSION] {
    let mut channels = [0; POSE_DIMENSION];
    for (i, channel) in channels.iter_mut().enumerate().take(15) {
        *channel = ANGLE_COUNT + i;
    }
    for limb in Limb::ALL {
        let first = if limb.is_arm() { arm_offset(limb.side()) } else { leg_offset(limb.side()) };
        channels[hinge_offset(limb.index())] = first + 3;
    }
    debug_assert_eq!(AngleChannel::all().len(), ANGLE_COUNT + 15);
    channels
}

/// The torso joint of a frame, or the middle of shoulders and hips of a sensor without one.
fn torso_in_world(recorded: &SkeletonRecording, t: usize) -> Option<Vector3<f64>> {
    let seen = |joint: Joint| {
        let column = recorded.column(joint)?;
        (recorded.frame_confidence(t)[column] > 0.0).then(|| recorded.frame(t)[column])
    };
    if recorded.column(Joint::Torso).is_some() {
        return seen(Joint::Torso);
    }
    let roots = [Joint::LeftShoulder, Joint::RightShoulder, Joint::LeftHip, Joint::RightHip].map(seen);
    roots.into_iter().sum::<Option<Vector3<f64>>>().map(|sum| sum / 4.0)
}

/// Brings each attitude vector onto the branch nearest to the one before.
fn unwrap_attitudes(samples: &mut [SVector<f64, DIMENSION>]) {
    let mut previous = PoseVector::zeros();
    for sample in samples {
        previous = stance_of(sample).pose.to_vector(&previous);
        sample.fixed_rows_mut::<POSE_DIMENSION>(0).copy_from(&previous);
    }
}

/// Height on which the lower ankle is most of the time: in standing and walking one foot is on the floor.
fn floor_height(skeleton: &Skeleton, samples: &[SVector<f64, DIMENSION>]) -> f64 {
    let lower = |sample: &SVector<f64, DIMENSION>| {
        let stance = stance_of(sample);
        let points = forward_kinematics(skeleton, &stance.pose);
        let height = |limb| stance.torso.y + points[point_index(limb, 2)].y;
        height(Limb::LeftLeg).min(height(Limb::RightLeg))
    };
    let mut heights: Vec<f64> = samples.iter().map(lower).collect();
    let middle = heights.len() / 2;
    *heights.select_nth_unstable_by(middle, f64::total_cmp).1
}
