//! Where joints were: for replay, for export, and for measures that need places and not angles.

use crate::body::Joint;
use crate::recording::SkeletonRecording;

/// Frames per second that are kept at most: none of a camera's thirty is lost, and a faster system is thinned.
const HIGHEST_RATE_HZ: f64 = 60.0;

/// Positions of joints over time, frame-major: joint `j` of frame `t` is element `t * joints.len() + j`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointTrack {
    /// The joints of every frame, without repetition.
    pub joints: Vec<Joint>,
    /// Time of each frame on the recording's clock, nanoseconds, strictly increasing.
    pub time_ns: Vec<i64>,
    /// Positions in the sensor's `world` (right-handed, y up), metres; NaN where the sensor had lost the joint.
    pub positions_m: Vec<[f32; 3]>,
}

impl JointTrack {
    /// The positions that the camera gave, at most sixty frames a second. A joint without any confidence counts as lost.
    pub fn of_skeleton(skeleton: &SkeletonRecording) -> Self {
        let least_gap_ns = (0.999e9 / HIGHEST_RATE_HZ) as i64;
        let mut track = Self { joints: skeleton.joints.clone(), ..Self::default() };
        let mut last_ns = None;
        for (t, &time_ns) in skeleton.time_ns.iter().enumerate() {
            if last_ns.is_some_and(|last: i64| time_ns.saturating_sub(last) < least_gap_ns) {
                continue;
            }
            last_ns = Some(time_ns);
            track.time_ns.push(time_ns);
            let seen = skeleton.frame(t).iter().zip(skeleton.frame_confidence(t));
            track.positions_m.extend(seen.map(|(position, confidence)| match *confidence > 0.0 {
                true => [position.x as f32, position.y as f32, position.z as f32],
                false => [f32::NAN; 3],
            }));
        }
        track
    }

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

    /// Positions of frame `t`, metres, in the order of `joints`.
    pub fn frame(&self, t: usize) -> &[[f32; 3]] {
        let n = self.joints.len();
        &self.positions_m[t * n..(t + 1) * n]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn skeleton(interval_ns: i64) -> SkeletonRecording {
        let n = 240;
        SkeletonRecording {
            joints: vec![Joint::Head, Joint::Pelvis],
            time_ns: (0..n).map(|t| t * interval_ns).collect(),
            positions: (0..2 * n).map(|i| Vector3::new(i as f64, 1.0, 2.0)).collect(),
            confidence: (0..2 * n).map(|i| if i == 5 { 0.0 } else { 1.0 }).collect(),
            orientations: Vec::new(),
        }
    }

    #[test]
    fn a_camera_loses_no_frame_and_a_lost_joint_is_no_place() {
        let track = JointTrack::of_skeleton(&skeleton(33_333_333));
        assert_eq!((track.len(), track.column(Joint::Pelvis)), (240, Some(1)));
        assert!(track.frame(2)[1][0].is_nan());
        assert_eq!(track.frame(3)[0], [6.0, 1.0, 2.0]);
    }

    #[test]
    fn a_faster_system_is_thinned_to_sixty_frames_a_second() {
        assert_eq!(JointTrack::of_skeleton(&skeleton(8_333_333)).len(), 120);
        assert_eq!(JointTrack::of_skeleton(&skeleton(16_666_666)).len(), 240);
    }
}
