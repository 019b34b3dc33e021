//! The baseline: frames in which the feet are farthest apart, as they come, without interpolation.

use crate::assessment::JointTrack;
use crate::body::{Joint, Side};
use crate::gait::GaitContact;
use nalgebra::Vector3;

/// Feet that are less far apart do not count, metres.
const LEAST_APART_M: f64 = 0.15;
/// Frames before and after that must not have the feet farther apart, seconds.
const REACH_S: f64 = 0.2;

/// Contacts at the frames in which the ankles are farthest apart on the floor; the foot that is ahead on the whole way of the
/// pelvis has landed, where its ankle is in that frame.
pub fn contacts(track: &JointTrack) -> Vec<GaitContact> {
    let column = |joint| track.column(joint);
    let (Some(left), Some(right), Some(hip)) =
        (column(Joint::LeftAnkle), column(Joint::RightAnkle), column(Joint::LeftHip))
    else {
        return Vec::new();
    };
    let point = |t: usize, column: usize| {
        let mut point = Vector3::from(track.frame(t)[column]).map(f64::from);
        point.y = 0.0;
        point
    };
    let n = track.len();
    if n < 2 {
        return Vec::new();
    }
    let way = point(n - 1, hip) - point(0, hip);
    let apart: Vec<f64> = (0..n).map(|t| (point(t, left) - point(t, right)).norm()).collect();
    let seconds = |t: usize| (track.time_ns[t] - track.time_ns[0]) as f64 * 1e-9;
    let is_top = |t: usize| {
        let near = (0..n).filter(|&k| k != t && (seconds(k) - seconds(t)).abs() <= REACH_S);
        apart[t] >= LEAST_APART_M && near.into_iter().all(|k| apart[k] < apart[t])
    };
    (1..n.saturating_sub(1))
        .filter(|&t| is_top(t))
        .map(|t| {
            let is_left = (point(t, left) - point(t, right)).dot(&way) > 0.0;
            let (side, column) = if is_left { (Side::Left, left) } else { (Side::Right, right) };
            let place = point(t, column);
            GaitContact::new(side, seconds(t), [place.x, place.z])
        })
        .collect()
}
