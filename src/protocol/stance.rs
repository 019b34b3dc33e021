//! Quiet stands: how long somebody stood with the feet in one place, how the feet stood, and how the trunk swayed.
//!
//! A stand holds while both ankles stay within a radius of where they were for its last second, and the hips stay high. It is
//! the longest such stretch; feet that a camera sees tremble do not end it, since what is compared are means over a quarter of
//! a second.

use super::motion::{INTERVAL_S, Motion};
use nalgebra::Vector3;

/// How far an ankle may be from its place in the stand, leg lengths: about three centimetres. A foot that is lifted to step
/// beside the other one goes farther.
const FOOT_RADIUS: f64 = 0.04;

/// How far a knee may bend from its value at the middle of the stand, degrees: a lifted foot bends it farther.
const KNEE_CHANGE_DEG: f64 = 25.0;

/// Least height of the hips above the ankles, share of the greatest in the recording.
const STANDING: f64 = 0.85;

/// Shortest stand that is one, seconds.
const SHORTEST_S: f64 = 2.0;

/// Time over which places are averaged before they are compared, seconds.
const AVERAGE_S: f64 = 0.25;

/// χ² with two degrees of freedom at 95 %.
const CHI_SQUARED_95: f64 = 5.991;

/// A stretch of quiet standing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// First node.
    pub start: usize,
    /// Last node.
    pub end: usize,
    /// Median distance of the feet along the facing direction, leg lengths, positive.
    pub apart_forward: f64,
    /// Median distance of the feet across it, leg lengths, positive.
    pub apart_sideways: f64,
    /// True when the recording ends while it holds.
    pub is_to_the_end: bool,
}

impl Hold {
    /// How long it holds, seconds.
    pub fn seconds(&self) -> f64 {
        (self.end - self.start) as f64 * INTERVAL_S
    }
}

/// How the trunk's upper end moved in the plane of the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sway {
    /// Length of its path, metres.
    pub path_m: f64,
    /// Area of the ellipse that holds 95 % of a normal distribution with its covariance, square metres.
    pub area_m2: f64,
    /// Mean speed along the path, metres per second.
    pub mean_speed_mps: f64,
}

/// The longest stand whose feet are as asked (distances forward and sideways, leg lengths); none without places.
pub fn longest(motion: &Motion, is_right: impl Fn(f64, f64) -> bool) -> Option<Hold> {
    let holds = all(motion).into_iter().filter(|hold| is_right(hold.apart_forward, hold.apart_sideways));
    holds.max_by(|a, b| a.seconds().total_cmp(&b.seconds()).then(b.start.cmp(&a.start)))
}

/// Every stand, by time.
pub fn all(motion: &Motion) -> Vec<Hold> {
    let Some(places) = &motion.places else { return Vec::new() };
    let feet = places.ankle.each_ref().map(|ankle| averaged(ankle));
    let highest = (0..motion.len).map(|i| places.hip_height(i)).filter(|h| h.is_finite()).fold(0.0, f64::max);
    let is_seen =
        |i: usize| feet.iter().all(|foot| foot[i].x.is_finite()) && motion.knee.iter().all(|k| k[i].is_finite());
    let stands = |i: usize| is_seen(i) && places.hip_height(i) >= STANDING * highest;
    let radius_m = FOOT_RADIUS * places.leg_length_m;
    let mut holds = Vec::new();
    let mut start = 0;
    while start < motion.len {
        if !stands(start) {
            start += 1;
            continue;
        }
        // Grown from its first node: each further one must agree with the mean of the last second.
        let mut anchor = feet.each_ref().map(|foot| foot[start]);
        let mut knee = motion.knee.each_ref().map(|knee| knee[start]);
        let mut end = start;
        while end + 1 < motion.len && stands(end + 1) {
            let i = end + 1;
            let is_still = (0..2).all(|side| {
                (feet[side][i] - anchor[side]).norm() <= radius_m
                    && (motion.knee[side][i] - knee[side]).abs() <= KNEE_CHANGE_DEG
            });
            if !is_still {
                break;
            }
            // A mean that forgets within a second.
            for (anchor, foot) in anchor.iter_mut().zip(&feet) {
                *anchor += INTERVAL_S * (foot[i] - *anchor);
            }
            for (knee, flexion) in knee.iter_mut().zip(&motion.knee) {
                *knee += INTERVAL_S * (flexion[i] - *knee);
            }
            end = i;
        }
        if let Some(hold) = hold(motion, start, end).filter(|hold| hold.seconds() >= SHORTEST_S) {
            holds.push(hold);
        }
        start = end + 1;
    }
    holds
}

fn hold(motion: &Motion, start: usize, end: usize) -> Option<Hold> {
    let places = motion.places.as_ref()?;
    let median = |axis: usize| {
        let mut apart: Vec<f64> =
            (start..=end).map(|i| places.feet_apart(i)[axis].abs()).filter(|apart| apart.is_finite()).collect();
        let middle = apart.len() / 2;
        (!apart.is_empty()).then(|| *apart.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    Some(Hold {
        start,
        end,
        apart_forward: median(0)?,
        apart_sideways: median(1)?,
        is_to_the_end: end + 2 >= motion.len,
    })
}

/// Running means of places over a quarter of a second.
fn averaged(places: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let half = (0.5 * AVERAGE_S / INTERVAL_S) as usize;
    let mean = |i: usize| {
        let near = &places[i.saturating_sub(half)..(i + half + 1).min(places.len())];
        near.iter().sum::<Vector3<f64>>() / near.len() as f64
    };
    (0..places.len()).map(mean).collect()
}

/// Sway of the trunk's upper end during a stand; none when it was not seen throughout.
pub fn sway(motion: &Motion, hold: &Hold) -> Option<Sway> {
    let places = motion.places.as_ref()?;
    let path = averaged(&places.chest[hold.start..=hold.end]);
    let n = path.len() as f64;
    let horizontal = |v: Vector3<f64>| [v.x, v.z];
    let mut length = 0.0;
    for pair in path.windows(2) {
        let [x, z] = horizontal(pair[1] - pair[0]);
        length += x.hypot(z);
    }
    let mean = path.iter().sum::<Vector3<f64>>() / n;
    let (mut xx, mut xz, mut zz) = (0.0, 0.0, 0.0);
    for point in &path {
        let [x, z] = horizontal(point - mean);
        (xx, xz, zz) = (xx + x * x, xz + x * z, zz + z * z);
    }
    let determinant = (xx * zz - xz * xz).max(0.0) / ((n - 1.0) * (n - 1.0));
    let sway = Sway {
        path_m: length,
        area_m2: std::f64::consts::PI * CHI_SQUARED_95 * determinant.sqrt(),
        mean_speed_mps: length / hold.seconds(),
    };
    (sway.path_m.is_finite() && sway.area_m2.is_finite()).then_some(sway)
}
