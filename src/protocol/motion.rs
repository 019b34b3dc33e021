//! What recognition looks at: angles and places of an assessment, smoothed, on one regular grid.
//!
//! Angles come from the assessment's series, places from its joint track. Places are told in leg lengths (thigh and shank), so
//! that nothing depends on the person's size; lengths of a few centimetres are below what a camera's ankle can tell.

use super::places::Places;
use crate::assessment::series::{FLAG_BRIDGED, FLAG_NOT_OBSERVABLE};
use crate::assessment::{AngleChannel, Assessment};
use crate::body::Side;

/// Time between nodes of the grid, seconds.
pub const INTERVAL_S: f64 = 0.02;

/// Standard deviation of the Gaussian that smooths everything, seconds: symmetric, so it moves no instant, and half of the
/// shortest time in which a leg changes its direction.
const SMOOTHING_S: f64 = 0.05;

/// Longest time between two samples that is bridged by a line, seconds.
const LONGEST_BRIDGE_S: f64 = 0.6;

/// Longest recording that is looked at, seconds: two hours.
const LONGEST_S: f64 = 7200.0;

/// Angles and places over time, on a regular grid from the assessment's first sample.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Nodes of the grid.
    pub len: usize,
    /// Flexion of each knee, degrees; NaN where there is none.
    pub knee: [Vec<f64>; 2],
    /// Flexion of each hip, degrees.
    pub hip: [Vec<f64>; 2],
    /// Abduction of each hip, degrees.
    pub abduction: [Vec<f64>; 2],
    /// How far each thigh points forwards from hanging, in space and not against the trunk, degrees.
    pub thigh: [Vec<f64>; 2],
    /// Forward bending of the trunk, degrees.
    pub trunk_flexion: Vec<f64>,
    /// Bending of the trunk to the right, degrees.
    pub trunk_lateral: Vec<f64>,
    /// Whether each knee's angle was observed.
    pub is_seen: [Vec<bool>; 2],
    /// Where feet, pelvis and trunk were; none without a joint track.
    pub places: Option<Places>,
}

impl Motion {
    /// The motion of an assessment; none when it has no legs' angles or is shorter than a movement.
    pub fn of(assessment: &Assessment) -> Option<Self> {
        let (first, last) = (*assessment.time_ns.first()?, *assessment.time_ns.last()?);
        let duration_s = (last.saturating_sub(first)) as f64 * 1e-9;
        if !(0.5..=LONGEST_S).contains(&duration_s) {
            return None;
        }
        let len = (duration_s / INTERVAL_S) as usize + 1;
        let column = |channel: AngleChannel| {
            let name = channel.name();
            let series = assessment.series.iter().find(|series| series.channel == name)?;
            let values: Vec<f64> = series.value.iter().map(|v| f64::from(*v)).collect();
            Some(smoothed_on_grid(&assessment.time_ns, &values, first, len))
        };
        let both = |of: fn(Side) -> AngleChannel| Some([column(of(Side::Left))?, column(of(Side::Right))?]);
        let knee = both(AngleChannel::KneeFlexion)?;
        let hip = both(AngleChannel::HipFlexion)?;
        let abduction = both(AngleChannel::HipAbduction)?;
        let trunk_flexion = column(AngleChannel::TrunkFlexion)?;
        let trunk_lateral = column(AngleChannel::TrunkLateralBending)?;
        let thigh = hip.each_ref().map(|hip| hip.iter().zip(&trunk_flexion).map(|(hip, trunk)| hip - trunk).collect());
        let is_seen = Side::BOTH.map(|side| seen_on_grid(assessment, AngleChannel::KneeFlexion(side), first, len));
        let places = assessment.joints.as_ref().and_then(|track| Places::of(track, first, len));
        Some(Self { len, knee, hip, abduction, thigh, trunk_flexion, trunk_lateral, is_seen, places })
    }

    /// Mean flexion of both knees, degrees.
    pub fn mean_knee(&self) -> Vec<f64> {
        self.knee[0].iter().zip(&self.knee[1]).map(|(left, right)| 0.5 * (left + right)).collect()
    }

    /// Time of a node, seconds from the first frame.
    pub fn seconds(&self, node: usize) -> f64 {
        node as f64 * INTERVAL_S
    }

    /// Share of the nodes of a stretch in which the knees of the given sides were observed, 0 to 1.
    pub fn coverage(&self, start: usize, end: usize, sides: &[Side]) -> f64 {
        let nodes = start..=end.min(self.len - 1);
        let n = nodes.clone().count().max(1);
        let seen = nodes.filter(|&i| sides.iter().all(|side| self.is_seen[*side as usize][i])).count();
        seen as f64 / n as f64
    }

    /// Longest time without an observation of either knee between two nodes, seconds.
    pub fn longest_unseen_s(&self, start: usize, end: usize) -> f64 {
        let (mut longest, mut run) = (0, 0);
        for i in start..=end.min(self.len - 1) {
            run = if self.is_seen.iter().all(|seen| !seen[i]) { run + 1 } else { 0 };
            longest = longest.max(run);
        }
        longest as f64 * INTERVAL_S
    }
}

/// A series on the grid, smoothed; NaN where its samples are too far apart.
pub fn smoothed_on_grid(time_ns: &[i64], values: &[f64], first_ns: i64, len: usize) -> Vec<f64> {
    let mut on_grid = vec![f64::NAN; len];
    let known: Vec<(f64, f64)> = time_ns
        .iter()
        .zip(values)
        .filter(|(_, value)| value.is_finite())
        .map(|(&time, &value)| ((time - first_ns) as f64 * 1e-9, value))
        .collect();
    let mut next = 0;
    for (i, node) in on_grid.iter_mut().enumerate() {
        let at = i as f64 * INTERVAL_S;
        while next < known.len() && known[next].0 < at {
            next += 1;
        }
        let Some(&(t1, v1)) = known.get(next) else {
            // The grid ends less than an interval before the last sample; a series may end earlier.
            break;
        };
        *node = match next.checked_sub(1).map(|before| known[before]) {
            Some((t0, v0)) if t1 - t0 <= LONGEST_BRIDGE_S => v0 + (v1 - v0) * (at - t0) / (t1 - t0),
            _ if t1 - at < 1e-9 => v1,
            _ => f64::NAN,
        };
    }
    smooth(&on_grid)
}

/// A series smoothed by a Gaussian; what is missing stays missing and weighs nothing.
fn smooth(values: &[f64]) -> Vec<f64> {
    let sd = SMOOTHING_S / INTERVAL_S;
    let reach = (3.0 * sd).ceil() as usize;
    let kernel: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / sd).powi(2)).exp()).collect();
    let at = |i: usize| {
        if values[i].is_nan() {
            return f64::NAN;
        }
        // As far to one side as to the other, so that an edge does not pull the value back.
        let reach = reach.min(i).min(values.len() - 1 - i);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (j, value) in values.iter().enumerate().take(i + reach + 1).skip(i - reach) {
            if value.is_finite() {
                let w = kernel[i.abs_diff(j)];
                (sum, weight) = (sum + w * value, weight + w);
            }
        }
        sum / weight
    };
    (0..values.len()).map(at).collect()
}

/// Whether a channel's nearest sample was observed, at each node.
fn seen_on_grid(assessment: &Assessment, channel: AngleChannel, first_ns: i64, len: usize) -> Vec<bool> {
    const UNSEEN: u8 = FLAG_BRIDGED | FLAG_NOT_OBSERVABLE;
    let name = channel.name();
    let Some(series) = assessment.series.iter().find(|series| series.channel == name) else { return vec![false; len] };
    let times = &assessment.time_ns;
    let near_ns = (0.5e9 * LONGEST_BRIDGE_S) as i64;
    let is_seen = |i: usize| {
        let at = first_ns + (i as f64 * INTERVAL_S * 1e9) as i64;
        let after = times.partition_point(|&time| time < at).min(times.len() - 1);
        let before = after.saturating_sub(1);
        let nearest = if times[after] - at <= at - times[before] { after } else { before };
        let flags = series.flags.get(nearest).copied().unwrap_or(0);
        series.value[nearest].is_finite() && flags & UNSEEN == 0 && (times[nearest] - at).abs() <= near_ns
    };
    (0..len).map(is_seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_a_line_and_a_long_gap_stays_a_gap() {
        let times: Vec<i64> = (0..60).chain(120..180).map(|i| i * 33_333_333).collect();
        let values: Vec<f64> = times.iter().map(|t| *t as f64 * 1e-9 * 10.0).collect();
        let grid = smoothed_on_grid(&times, &values, 0, 290);
        for (i, value) in grid.iter().enumerate() {
            let at = i as f64 * INTERVAL_S;
            match at {
                _ if (1.98..3.99).contains(&at) => assert!(value.is_nan(), "{at}: {value}"),
                // Beside the gap the Gaussian has samples on one side only: half of its reach off at most.
                _ => assert!((value - 10.0 * at).abs() < 0.5, "{at}: {value}"),
            }
        }
    }
}
