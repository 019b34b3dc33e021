//! Where feet, pelvis and trunk are, in leg lengths along and across the way that the subject faces.

use super::motion::smoothed_on_grid;
use crate::assessment::JointTrack;
use crate::body::{Joint, Side};
use nalgebra::Vector3;

/// Shares of the body's weight that hang from shoulders and hips together (head, arms, trunk), from hips and knees, and from
/// knees and ankles (Winter 2009, Table 4.1: 0.678, 0.200, 0.122).
const TRUNK_WEIGHT: f64 = 0.678;
const THIGHS_WEIGHT: f64 = 0.2;
const SHANKS_WEIGHT: f64 = 0.122;

/// Places on the grid of a [`Motion`](super::motion::Motion).
#[derive(Debug, Clone)]
pub struct Places {
    /// Length of thigh and shank together, metres.
    pub leg_length_m: f64,
    /// Each ankle, metres in the sensor's `world`.
    pub ankle: [Vec<Vector3<f64>>; 2],
    /// Middle of the hips, metres.
    pub pelvis: Vec<Vector3<f64>>,
    /// Upper end of the trunk, metres.
    pub chest: Vec<Vector3<f64>>,
    /// Horizontal unit vector to the subject's front.
    pub forward: Vec<Vector3<f64>>,
    /// How far the weight of the body is ahead of the middle of the ankles, leg lengths.
    pub balance: Vec<f64>,
}

impl Places {
    /// Places of a track; none when it lacks hips, knees, ankles or shoulders, or never shows a whole leg.
    pub fn of(track: &JointTrack, first_ns: i64, len: usize) -> Option<Self> {
        let joint = |joint: Joint| {
            let column = track.column(joint)?;
            let axis = |axis: usize| {
                let values: Vec<f64> = (0..track.len()).map(|t| f64::from(track.frame(t)[column][axis])).collect();
                smoothed_on_grid(&track.time_ns, &values, first_ns, len)
            };
            let [x, y, z] = [axis(0), axis(1), axis(2)];
            Some((0..len).map(|i| Vector3::new(x[i], y[i], z[i])).collect::<Vec<_>>())
        };
        let both = |left: Joint, right: Joint| Some([joint(left)?, joint(right)?]);
        // NITE calls the end of the leg a foot.
        let ends = || both(Joint::LeftAnkle, Joint::RightAnkle).or_else(|| both(Joint::LeftFoot, Joint::RightFoot));
        let hip = both(Joint::LeftHip, Joint::RightHip)?;
        let knee = both(Joint::LeftKnee, Joint::RightKnee)?;
        let ankle = ends()?;
        let shoulder = both(Joint::LeftShoulder, Joint::RightShoulder)?;
        let leg_length_m = leg_length(&hip, &knee, &ankle)?;
        let middle = |pair: &[Vec<Vector3<f64>>; 2]| -> Vec<Vector3<f64>> {
            pair[0].iter().zip(&pair[1]).map(|(left, right)| 0.5 * (left + right)).collect()
        };
        let (pelvis, knees, ankles, chest) = (middle(&hip), middle(&knee), middle(&ankle), middle(&shoulder));
        let mut forward = Vec::with_capacity(len);
        let mut last = Vector3::repeat(f64::NAN);
        for (left, right) in hip[0].iter().zip(&hip[1]) {
            let across = right - left;
            let ahead = Vector3::new(across.z, 0.0, -across.x);
            if ahead.norm() > 0.01 {
                last = ahead.normalize();
            }
            forward.push(last);
        }
        let balance = (0..len).map(|i| {
            let ahead = |point: &Vector3<f64>| (point - ankles[i]).dot(&forward[i]) / leg_length_m;
            let (shoulders, hips, knees) = (ahead(&chest[i]), ahead(&pelvis[i]), ahead(&knees[i]));
            0.5 * (TRUNK_WEIGHT * (shoulders + hips) + THIGHS_WEIGHT * (hips + knees) + SHANKS_WEIGHT * knees)
        });
        let balance = balance.collect();
        Some(Self { leg_length_m, ankle, pelvis, chest, forward, balance })
    }

    /// How far the left foot is ahead of and to the left of the right one at a node, leg lengths.
    pub fn feet_apart(&self, node: usize) -> [f64; 2] {
        let between = (self.ankle[0][node] - self.ankle[1][node]) / self.leg_length_m;
        let forward = self.forward[node];
        [between.dot(&forward), between.dot(&Vector3::new(forward.z, 0.0, -forward.x))]
    }

    /// Way of a foot from one node to another: forwards, upwards, and its horizontal length; leg lengths.
    pub fn foot_way(&self, side: Side, from: usize, to: usize) -> [f64; 3] {
        let way = (self.ankle[side as usize][to] - self.ankle[side as usize][from]) / self.leg_length_m;
        [way.dot(&self.forward[from]), way.y, way.x.hypot(way.z)]
    }

    /// Height of the hips above the lower ankle at a node, leg lengths.
    pub fn hip_height(&self, node: usize) -> f64 {
        let floor = self.ankle[0][node].y.min(self.ankle[1][node].y);
        (self.pelvis[node].y - floor) / self.leg_length_m
    }
}

/// Median length of thigh and shank over both legs, metres.
fn leg_length(
    hip: &[Vec<Vector3<f64>>; 2],
    knee: &[Vec<Vector3<f64>>; 2],
    ankle: &[Vec<Vector3<f64>>; 2],
) -> Option<f64> {
    let mut lengths: Vec<f64> = Side::BOTH
        .into_iter()
        .flat_map(|side| {
            let side = side as usize;
            let legs = hip[side].iter().zip(&knee[side]).zip(&ankle[side]);
            legs.map(|((hip, knee), ankle)| (hip - knee).norm() + (knee - ankle).norm())
        })
        .filter(|length| length.is_finite() && *length > 0.0)
        .collect();
    let middle = lengths.len() / 2;
    (!lengths.is_empty()).then(|| *lengths.select_nth_unstable_by(middle, f64::total_cmp).1)
}
