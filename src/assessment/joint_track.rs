//! Where joints were: for replay, for export, and for measures that need places and not angles.

use super::series::Series;
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
    /// Positions in the sensor's `world` (right-handed, y up), metres; NaN where the joint was lost.
    pub positions_m: Vec<[f32; 3]>,
}

impl JointTrack {
    /// The positions that the camera gave, at most sixty frames a second. A joint without any confidence counts as lost.
    pub fn of_skeleton(skeleton: &SkeletonRecording) -> Self {
        let mut track = Self { joints: skeleton.joints.clone(), ..Self::default() };
        for (t, time_ns) in thinned(&skeleton.time_ns) {
            track.time_ns.push(time_ns);
            let seen = skeleton.frame(t).iter().zip(skeleton.frame_confidence(t));
            track.positions_m.extend(seen.map(|(position, confidence)| match *confidence > 0.0 {
                true => [position.x as f32, position.y as f32, position.z as f32],
                false => [f32::NAN; 3],
            }));
        }
        track
    }

    /// The places that an assessment itself estimates, its channels `{joint}_x_m`, `_y_m` and `_z_m`, at most sixty frames a
    /// second; none without any. `axes` turn them into the sensor's `world`, by the sign of each coordinate.
    pub fn of_series(time_ns: &[i64], series: &[Series], axes: [f32; 3]) -> Option<Self> {
        let channel = |joint: Joint, axis: &str| {
            let name = format!("{}_{axis}_m", joint.name());
            series.iter().find(|series| series.channel == name)
        };
        let places =
            |joint: &Joint| Some((*joint, [channel(*joint, "x")?, channel(*joint, "y")?, channel(*joint, "z")?]));
        let found: Vec<(Joint, [&Series; 3])> = Joint::ALL.iter().filter_map(places).collect();
        if found.is_empty() {
            return None;
        }
        let mut track = Self { joints: found.iter().map(|(joint, _)| *joint).collect(), ..Self::default() };
        for (t, time_ns) in thinned(time_ns) {
            track.time_ns.push(time_ns);
            let place = |columns: &[&Series; 3]| std::array::from_fn(|axis| axes[axis] * columns[axis].value[t]);
            track.positions_m.extend(found.iter().map(|(_, columns)| place(columns)));
        }
        Some(track)
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

/// Places in a series of times, and the times, so that no more than [`HIGHEST_RATE_HZ`] are left of a second.
fn thinned(time_ns: &[i64]) -> impl Iterator<Item = (usize, i64)> {
    let least_gap_ns = (0.999e9 / HIGHEST_RATE_HZ) as i64;
    let mut last_ns: Option<i64> = None;
    time_ns.iter().copied().enumerate().filter(move |(_, time_ns)| {
        let is_kept = last_ns.is_none_or(|last| time_ns.saturating_sub(last) >= least_gap_ns);
        if is_kept {
            last_ns = Some(*time_ns);
        }
        is_kept
    })
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

    #[test]
    fn places_that_an_assessment_estimates_are_taken_with_the_signs_of_their_axes() {
        let column = |name: &str, value: f32| Series { value: vec![value; 3], ..Series::empty(name, 3) };
        let series = [column("left_knee_x_m", 1.0), column("left_knee_y_m", 2.0), column("left_knee_z_m", 3.0)];
        let times = [0, 5_000_000, 20_000_000];
        let track = JointTrack::of_series(&times, &series, [1.0, -1.0, -1.0]).unwrap();
        assert_eq!((track.time_ns.as_slice(), track.frame(1)), (&[0, 20_000_000][..], &[[1.0, -2.0, -3.0]][..]));
        assert_eq!(JointTrack::of_series(&times, &series[..2], [1.0; 3]), None);
    }
}
