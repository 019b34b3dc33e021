//! Walks as a depth camera sees them: at its rate, from its side, with its errors.

use crate::body::pose::{PoseVector, attitude_offset, hinge_offset};
use crate::body::{Joint, Limb};
use crate::recording::SkeletonRecording;
use crate::synthetic::sensor::{posture_offset, white_noise};
use crate::synthetic::walker::WalkerSimulation;
use nalgebra::{UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Jitter of a Kinect v2 from frame to frame, millimetres.
const JITTER_MM: f64 = 1.0;

/// Every `stride`-th frame from the frame `first` on.
pub fn thinned(skeleton: &SkeletonRecording, stride: usize, first: usize) -> SkeletonRecording {
    let n = skeleton.joints.len();
    let mut thin = SkeletonRecording { joints: skeleton.joints.clone(), ..SkeletonRecording::default() };
    for t in (first..skeleton.len()).step_by(stride.max(1)) {
        thin.time_ns.push(skeleton.time_ns[t]);
        thin.positions.extend_from_slice(skeleton.frame(t));
        thin.confidence.extend_from_slice(&skeleton.confidence[t * n..(t + 1) * n]);
    }
    thin
}

/// The same motion in another direction before the camera: turned about the vertical.
pub fn turned(mut skeleton: SkeletonRecording, angle: f64) -> SkeletonRecording {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
    skeleton.positions.iter_mut().for_each(|position| *position = turn * *position);
    skeleton
}

/// Adds the error of a Kinect v2: an offset of every joint of which 30 to 45 mm stay and 20 to 30 mm follow the posture, and
/// jitter.
pub fn add_kinect_error(skeleton: &mut SkeletonRecording, seed: u64) {
    let postures = postures(skeleton);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    posture_offset::add(skeleton, &postures, posture_offset::every_joint_size, &mut rng);
    white_noise::add(skeleton, |_| Vector3::repeat(JITTER_MM), &mut rng);
}

/// What of the posture moves the error of the legs: where both thighs point and how far both knees bend. The trunk of a
/// walk hardly turns.
fn postures(skeleton: &SkeletonRecording) -> Vec<PoseVector> {
    let columns = [Limb::LeftLeg, Limb::RightLeg].map(|leg| {
        let [hip, knee, end] = leg.joints();
        let column = |(kinect, nite): (Joint, Joint)| skeleton.column(kinect).or_else(|| skeleton.column(nite));
        (leg, column(hip), column(knee), column(end))
    });
    (0..skeleton.len())
        .map(|t| {
            let mut theta = PoseVector::zeros();
            let frame = skeleton.frame(t);
            for (leg, hip, knee, end) in columns {
                let (Some(hip), Some(knee), Some(end)) = (hip, knee, end) else { continue };
                let (thigh, shank) = (frame[knee] - frame[hip], frame[end] - frame[knee]);
                let attitude = UnitQuaternion::rotation_between(&-Vector3::y(), &thigh).unwrap_or_default();
                theta.fixed_rows_mut::<3>(attitude_offset(leg.index())).copy_from(&attitude.scaled_axis());
                theta[hinge_offset(leg.index())] = thigh.angle(&shank);
            }
            theta
        })
        .collect()
}

/// The legs of a simulated walk in `world` as a camera that stands would report them.
pub fn simulated_skeleton(simulation: &WalkerSimulation) -> SkeletonRecording {
    let joints = vec![
        Joint::LeftHip,
        Joint::LeftKnee,
        Joint::LeftAnkle,
        Joint::LeftFoot,
        Joint::RightHip,
        Joint::RightKnee,
        Joint::RightAnkle,
        Joint::RightFoot,
    ];
    let mut skeleton = SkeletonRecording { joints, ..SkeletonRecording::default() };
    for k in 0..simulation.len() {
        let truth = simulation.truth(k);
        skeleton.time_ns.push(truth.time_ns);
        for leg in &truth.legs {
            for point in [leg.hip, leg.knee, leg.ankle, leg.toe] {
                // The simulation looks along z with the left at +x, which is right-handed with y up, as `world` is.
                skeleton.positions.push((truth.world_from_sensor * point).coords);
                skeleton.confidence.push(1.0);
            }
        }
    }
    skeleton
}
