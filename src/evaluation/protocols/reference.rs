//! Repetitions in reference angles, by the rule that finds them in the camera's.

use crate::protocol::motion::{INTERVAL_S, smoothed_on_grid};
use crate::protocol::transition::{Excursion, Least, Transition, excursions, transitions};
use crate::recording::Recording;

/// Least excursion of a reference knee, and of a hip's abduction, degrees; those of the protocols and a little less.
const KNEE: Least = Least::of(25.0);
const ABDUCTION: Least = Least::of(12.0);

/// A repetition in a reference, seconds from the recording's first frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceRepetition {
    /// When the movement began.
    pub start_s: f64,
    /// When it was farthest.
    pub peak_s: f64,
    /// When it had come back.
    pub end_s: f64,
}

impl ReferenceRepetition {
    /// Middle of its time, seconds.
    pub fn middle_s(&self) -> f64 {
        0.5 * (self.start_s + self.end_s)
    }
}

/// Complete excursions of a channel in a recording's reference; `downwards` for angles that shrink in a repetition.
pub fn reference_repetitions(
    recording: &Recording,
    channel: &str,
    downwards: bool,
    first_ns: i64,
) -> Vec<ReferenceRepetition> {
    let Some(values) = on_grid(recording, channel, first_ns) else { return Vec::new() };
    let sign = if downwards { -1.0 } else { 1.0 };
    let upwards: Vec<f64> = values.iter().map(|value| sign * value).collect();
    let least = if channel.ends_with("abduction_deg") { ABDUCTION } else { KNEE };
    let seconds = |node: usize| node as f64 * INTERVAL_S - MARGIN_S;
    let found = excursions(&upwards, INTERVAL_S, least).into_iter().filter(|excursion| excursion.is_complete);
    found
        .map(|Excursion { start, peak, end, .. }| ReferenceRepetition {
            start_s: seconds(start),
            peak_s: seconds(peak),
            end_s: seconds(end),
        })
        .collect()
}

/// Starts and ends of rises in the reference's mean knee flexion, seconds from the first frame.
pub fn reference_rises(recording: &Recording, first_ns: i64) -> Vec<[f64; 2]> {
    let Some(values) = on_grid(recording, "mean_knee_flexion_deg", first_ns) else { return Vec::new() };
    let seconds = |node: usize| node as f64 * INTERVAL_S - MARGIN_S;
    let rises = transitions(&values, INTERVAL_S, KNEE).into_iter().filter(|way| way.change < 0.0);
    rises.map(|Transition { start, end, .. }| [seconds(start), seconds(end)]).collect()
}

/// How far a reference may begin before the recording, seconds: data sets cut each device on its own.
const MARGIN_S: f64 = 1.0;

/// A reference channel on the grid that begins a margin before the first frame; the mean of both knees where it is asked for.
fn on_grid(recording: &Recording, channel: &str, first_ns: i64) -> Option<Vec<f64>> {
    if channel == "mean_knee_flexion_deg" {
        let left = on_grid(recording, "left_knee_flexion_deg", first_ns)?;
        let right = on_grid(recording, "right_knee_flexion_deg", first_ns)?;
        return Some(left.iter().zip(&right).map(|(left, right)| 0.5 * (left + right)).collect());
    }
    let reference = recording.references.iter().find(|reference| reference.channel == channel)?;
    let times: Vec<i64> = reference.time_ns.iter().map(|time| time + reference.clock_offset_ns).collect();
    let start_ns = first_ns - (MARGIN_S * 1e9) as i64;
    let duration_s = (times.last()? - start_ns) as f64 * 1e-9;
    let len = (duration_s / INTERVAL_S).max(0.0) as usize + 1;
    Some(smoothed_on_grid(&times, &reference.values, start_ns, len))
}
