//! A recording that all tests of the service can take.

use nalgebra::Vector3;
use surefoot::body::Joint;
use surefoot::recording::{Header, Recording, SkeletonRecording};

/// Time between two frames, nanoseconds: 30 Hz.
pub const FRAME_NS: i64 = 33_333_333;

/// A standing person of `n` frames who sways a little sideways, by `rate` radians a frame.
pub fn standing(n: usize, rate: f64) -> Recording {
    let at = |x: f64, y: f64| Vector3::new(x, y, 2.0);
    let posture = [
        (Joint::Head, at(0.0, 0.75)),
        (Joint::Torso, at(0.0, 0.25)),
        (Joint::LeftShoulder, at(0.2, 0.5)),
        (Joint::RightShoulder, at(-0.2, 0.5)),
        (Joint::LeftElbow, at(0.45, 0.5)),
        (Joint::RightElbow, at(-0.45, 0.5)),
        (Joint::LeftHand, at(0.7, 0.5)),
        (Joint::RightHand, at(-0.7, 0.5)),
        (Joint::LeftHip, at(0.1, 0.0)),
        (Joint::RightHip, at(-0.1, 0.0)),
        (Joint::LeftKnee, at(0.1, -0.4)),
        (Joint::RightKnee, at(-0.1, -0.4)),
        (Joint::LeftFoot, at(0.1, -0.8)),
        (Joint::RightFoot, at(-0.1, -0.8)),
    ];
    let sway = |t: usize| Vector3::new(0.005 * (t as f64 * rate).sin(), 0.0, 0.0);
    Recording {
        header: Header { protocol: Some("standing".into()), ..Header::default() },
        skeleton: Some(SkeletonRecording {
            joints: posture.iter().map(|(joint, _)| *joint).collect(),
            time_ns: (0..n as i64).map(|t| t * FRAME_NS).collect(),
            positions: (0..n).flat_map(|t| posture.map(|(_, position)| position + sway(t))).collect(),
            confidence: vec![1.0; n * posture.len()],
            orientations: Vec::new(),
        }),
        inertial: None,
        references: Vec::new(),
    }
}
