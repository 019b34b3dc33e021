//! Noise that is independent from frame to frame.

use super::standard_normals;
use crate::body::Joint;
use crate::recording::SkeletonRecording;
use nalgebra::Vector3;
use rand::Rng;

/// Standard deviation of each coordinate of a joint relative to the torso joint, millimetres: right, up and depth of
/// the sensor (\[angles\] Table 1). Points that the table does not have (neck, head) get those of the shoulder.
pub fn table1_sd_mm(joint: Joint) -> Vector3<f64> {
    match joint {
        Joint::Torso => Vector3::zeros(),
        Joint::LeftElbow | Joint::RightElbow => Vector3::new(29.8, 25.2, 20.3),
        Joint::LeftHand | Joint::RightHand | Joint::LeftWrist | Joint::RightWrist => Vector3::new(151.5, 181.7, 14.5),
        Joint::LeftHip | Joint::RightHip | Joint::Pelvis => Vector3::new(6.0, 6.5, 10.1),
        Joint::LeftKnee | Joint::RightKnee => Vector3::new(8.8, 16.8, 35.1),
        Joint::LeftFoot | Joint::RightFoot | Joint::LeftAnkle | Joint::RightAnkle => Vector3::new(19.8, 25.2, 38.1),
        _ => Vector3::new(9.1, 6.7, 12.7),
    }
}

/// Adds noise of a standard deviation (millimetres, in the axes of `world`) to each joint of each frame.
pub fn add(skeleton: &mut SkeletonRecording, sd_mm: impl Fn(Joint) -> Vector3<f64>, rng: &mut impl Rng) {
    let sds: Vec<Vector3<f64>> = skeleton.joints.iter().map(|joint| sd_mm(*joint) / 1000.0).collect();
    for frame in skeleton.positions.chunks_exact_mut(sds.len()) {
        for (position, sd) in frame.iter_mut().zip(&sds) {
            *position += standard_normals(rng).component_mul(sd);
        }
    }
}
