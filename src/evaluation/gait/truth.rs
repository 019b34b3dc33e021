//! Contacts of a walk as its own motion has them, by rules that the detector under test does not use.
//!
//! Of a motion that was captured at 120 Hz (after Hreljac and Marshall 2000, J Biomech 33:783): a foot lands when the fall of
//! its heel is braked hardest, within a tenth of a second around the instant at which the heel's way forward comes to an
//! end, and leaves when its ball is accelerated hardest forwards. It stands where the heel is slowest in between. Of a
//! simulated walk everything is planned.

use crate::body::{Joint, Side};
use crate::recording::SkeletonRecording;
use crate::synthetic::walker::WalkerSimulation;
use nalgebra::Vector3;

/// A true contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueContact {
    /// The foot.
    pub side: Side,
    /// Initial contact, seconds from the first frame.
    pub contact_s: f64,
    /// The terminal contact of the same foot that follows; none when the recording ends before.
    pub release_s: Option<f64>,
    /// Where the foot stands on the floor, `x` and `z` of `world`, metres; none when the recording ends before.
    pub place_m: Option<[f64; 2]>,
}

/// Standard deviation of the Gaussian that smooths the motion before its second derivative, seconds.
const SMOOTH_S: f64 = 0.012;
/// The heel behind the ankle when the foot is flat, metres.
const HEEL_BEHIND_ANKLE_M: f64 = 0.045;

/// The contacts of a captured motion along a straight way, by time.
pub fn captured_contacts(skeleton: &SkeletonRecording) -> Vec<TrueContact> {
    let mut found: Vec<TrueContact> = Side::BOTH.iter().flat_map(|side| of_foot(skeleton, *side)).collect();
    found.sort_by(|a, b| a.contact_s.total_cmp(&b.contact_s));
    found
}

fn of_foot(skeleton: &SkeletonRecording, side: Side) -> Vec<TrueContact> {
    let [ankle_joint, ball_joint] = match side {
        Side::Left => [Joint::LeftAnkle, Joint::LeftFoot],
        Side::Right => [Joint::RightAnkle, Joint::RightFoot],
    };
    let path = |joint: Joint| -> Option<Vec<Vector3<f64>>> {
        let column = skeleton.column(joint)?;
        Some((0..skeleton.len()).map(|t| skeleton.frame(t)[column]).collect())
    };
    let (Some(ankle), Some(ball), Some(pelvis)) = (path(ankle_joint), path(ball_joint), path(Joint::Pelvis)) else {
        return Vec::new();
    };
    let n = skeleton.len();
    if n < 4 {
        return Vec::new();
    }
    let step_s = skeleton.duration_s() / (n - 1) as f64;
    let mut way = pelvis[n - 1] - pelvis[0];
    way.y = 0.0;
    let forward = way.normalize();
    let heel = smoothed(&heel_path(&ankle, &ball, &forward), SMOOTH_S / step_s);
    let ball = smoothed(&ball, SMOOTH_S / step_s);
    let second = |path: &[Vector3<f64>], axis: &Vector3<f64>| -> Vec<f64> {
        let value = |t: usize| (path[t + 1] - 2.0 * path[t] + path[t - 1]).dot(axis) / (step_s * step_s);
        (0..n).map(|t| if t == 0 || t + 1 == n { 0.0 } else { value(t) }).collect()
    };
    let speed: Vec<f64> = (0..n)
        .map(|t| {
            let (a, b) = (t.saturating_sub(1), (t + 1).min(n - 1));
            let mut velocity = (heel[b] - heel[a]) / ((b - a) as f64 * step_s);
            velocity.y = 0.0;
            velocity.norm()
        })
        .collect();
    let (up, ahead) = (second(&heel, &Vector3::y()), second(&ball, &forward));
    let mut found = Vec::new();
    for stance in stances(&speed) {
        // The swing before has its own brake, 0.1 s and more before the heel lands.
        let frames = |seconds: f64| (seconds / step_s).round() as usize;
        let (before, after) = (frames(0.04), frames(0.06));
        let start = (stance.start > before).then(|| peak(&up, stance.start - before..stance.start + after));
        let Some(Some(start)) = start else { continue };
        // From the rise of the heel to the swing; in the last frames it may not have come yet.
        let is_seen = stance.end + frames(0.25) < n;
        let release = is_seen.then(|| peak(&ahead, stance.end..stance.end + frames(0.25))).flatten();
        let slowest = stance.clone().min_by(|a, b| speed[*a].total_cmp(&speed[*b]));
        let is_whole = stance.len() > frames(0.25);
        found.push(TrueContact {
            side,
            contact_s: start * step_s,
            release_s: release.map(|t| t * step_s),
            place_m: slowest.filter(|_| is_whole).map(|t| [heel[t].x, heel[t].z]),
        });
    }
    found
}

/// Frames in which the heel stands.
fn stances(speed: &[f64]) -> Vec<std::ops::Range<usize>> {
    const STANDING_MPS: f64 = 0.5;
    let mut found = Vec::new();
    let mut t = 0;
    while t < speed.len() {
        let begin = t;
        while t < speed.len() && (speed[t] < STANDING_MPS) == (speed[begin] < STANDING_MPS) {
            t += 1;
        }
        if speed[begin] < STANDING_MPS && t - begin > 10 {
            found.push(begin..t);
        }
    }
    found
}

/// Place of the largest value in a range, between frames.
fn peak(values: &[f64], range: std::ops::Range<usize>) -> Option<f64> {
    let top = range.filter(|&t| t > 0 && t + 1 < values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    let [before, here, after] = [values[top - 1], values[top], values[top + 1]];
    let bend = before - 2.0 * here + after;
    let shift = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
    Some(top as f64 + shift.clamp(-0.5, 0.5))
}

/// The heel as a point fixed in the foot: behind the ankle, at the height of the ball when the foot is flat.
fn heel_path(ankle: &[Vector3<f64>], ball: &[Vector3<f64>], forward: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let axes = |t: usize| {
        let along = (ball[t] - ankle[t]).normalize();
        let across = Vector3::y().cross(&along).try_normalize(1e-6).unwrap_or(Vector3::y().cross(forward));
        (along, along.cross(&across))
    };
    // The foot is flat while its ball is lowest on average: where both ends move least.
    let motion = |t: usize| (ball[t + 1] - ball[t - 1]).norm() + (ankle[t + 1] - ankle[t - 1]).norm();
    let flat = (1..ankle.len() - 1).min_by(|a, b| motion(*a).total_cmp(&motion(*b))).unwrap_or(0);
    let mut ahead = ball[flat] - ankle[flat];
    let drop = ahead.y;
    ahead.y = 0.0;
    let offset = -HEEL_BEHIND_ANKLE_M * ahead.normalize() + drop * Vector3::y();
    let (along, above) = axes(flat);
    let (a, b) = (offset.dot(&along), offset.dot(&above));
    (0..ankle.len())
        .map(|t| {
            let (along, above) = axes(t);
            ankle[t] + a * along + b * above
        })
        .collect()
}

/// A Gaussian of `sd` frames over a path, the ends being held.
fn smoothed(path: &[Vector3<f64>], sd: f64) -> Vec<Vector3<f64>> {
    let reach = (4.0 * sd).ceil() as i64;
    let weight = |d: i64| (-0.5 * (d as f64 / sd).powi(2)).exp();
    let last = path.len() as i64 - 1;
    (0..=last)
        .map(|t| {
            let near = (-reach..=reach).map(|d| (weight(d), path[(t + d).clamp(0, last) as usize]));
            let (sum, total) = near.fold((Vector3::zeros(), 0.0), |(sum, total), (w, p)| (sum + p * w, total + w));
            sum / total
        })
        .collect()
}

/// The contacts of a simulated walk that lie within it, by time.
pub fn planned_contacts(simulation: &WalkerSimulation) -> Vec<TrueContact> {
    let end = simulation.settings().duration_s;
    let prints = simulation.footprints().iter().filter(|print| print.contact_s > 0.0 && print.contact_s < end);
    prints
        .map(|print| TrueContact {
            side: Side::BOTH[print.side],
            contact_s: print.contact_s,
            release_s: (print.release_s < end).then_some(print.release_s),
            place_m: Some([print.place.x, print.place.z]),
        })
        .collect()
}
