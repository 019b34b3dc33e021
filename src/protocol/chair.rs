//! Rising from a chair: rises, repetitions, and the two timed tests.
//!
//! A rise is a way down of the mean knee flexion from a part in which the body sits: both knees and thighs bent and the body's
//! weight behind the feet, where only a seat can hold it. Kinect v1 shows a sitting thigh at 43° where it is at 78°, so no
//! angle of sitting is asked for, only a change.

use super::look::Look;
use super::motion::{INTERVAL_S, Motion};
use super::repetitions::{Angle, Found, repetition};
use super::transition::{EDGE_SPEED, Excursion, Least, Transition, derivative, transitions};

/// Least change of mean knee flexion in a rise, degrees.
const LEAST: Least = Least::of(30.0);

/// Least change of each thigh, degrees.
const THIGH_DEG: f64 = 20.0;

/// Least change of each knee, degrees.
const KNEE_DEG: f64 = 20.0;

/// Least ratio of the two knees' changes.
const KNEE_RATIO: f64 = 0.4;

/// Where the body's weight is at least for the seat to be needed, leg lengths ahead of the ankles: a squat keeps it above the
/// feet. Between this and [`SQUAT_BALANCE`] both are possible.
pub const SEAT_BALANCE: f64 = -0.045;

/// Where the body's weight is at least when no seat holds it.
pub const SQUAT_BALANCE: f64 = -0.085;

/// Share of the recording's range of knee flexion below which the body stands.
const STANDING: f64 = 0.3;

/// Longest time that the trunk may lean forwards before the knees extend, seconds.
const LONGEST_LEAN_S: f64 = 1.5;

/// Share of its largest speed in the rise at which the trunk is said to begin to lean.
const LEAN_EDGE: f64 = 0.15;

/// Least lean that belongs to a rise, degrees.
const LEAN_DEG: f64 = 4.0;

/// One rise from the chair; nodes of the motion's grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rise {
    /// The way of the knees.
    pub way: Transition,
    /// Where the trunk began to lean forwards, or the knees to extend when it did not.
    pub onset: usize,
    /// Where the knees are half extended.
    pub halfway: usize,
    /// True when the recording shows it from the seat to full standing.
    pub is_complete: bool,
    lowering_before: Option<Transition>,
    lowering_after: Option<Transition>,
}

/// Every rise, by time.
pub fn rises(motion: &Motion) -> Vec<Rise> {
    let knee = motion.mean_knee();
    let ways = transitions(&knee, INTERVAL_S, LEAST);
    let speed = derivative(&knee, INTERVAL_S);
    let finite = || knee.iter().copied().filter(|value| value.is_finite());
    let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    let mut rises = Vec::new();
    for (k, way) in ways.iter().enumerate().filter(|(_, way)| way.change < 0.0) {
        let before = k.checked_sub(1).map(|k| ways[k]);
        let seated = Excursion {
            start: before.map_or(way.from, |before| before.start),
            peak: way.from,
            end: way.end,
            is_complete: before.is_some(),
        };
        if !sits(&Look::at(motion, seated)) {
            continue;
        }
        let moves = |i: usize| -speed[i] > EDGE_SPEED * way.peak_speed;
        let begins_within = before.is_none() && way.start <= 1 && moves(way.start);
        let stands = knee[way.end] <= low + STANDING * (high - low);
        let half = 0.5 * (knee[way.from] + knee[way.to]);
        rises.push(Rise {
            way: *way,
            onset: onset(motion, way, before.map_or(0, |before| before.end)),
            halfway: (way.from..=way.to).find(|&i| knee[i] <= half).unwrap_or(way.to),
            is_complete: !begins_within && stands,
            lowering_before: before,
            lowering_after: ways.get(k + 1).copied(),
        });
    }
    rises
}

/// Whether the bent part of an excursion is sitting.
fn sits(look: &Look) -> bool {
    bends_both(look) && look.places.is_none_or(|places| places.balance <= SEAT_BALANCE)
}

/// Whether both legs bend together, feet side by side and on the floor.
pub fn bends_both(look: &Look) -> bool {
    let [left, right] = look.knee_change;
    let both = left.min(right) >= KNEE_RATIO * left.max(right) && left.min(right) >= KNEE_DEG;
    let thighs = look.thigh_change.iter().all(|change| *change >= THIGH_DEG);
    let together = (look.thigh[0] - look.thigh[1]).abs() < 25.0;
    let feet = look.places.is_none_or(|places| {
        // A camera in front sees ankles wander while the knees bend before them; a step is longer than this.
        let stay = places.foot_rise.iter().all(|rise| *rise < 0.2) && places.foot_forward.iter().all(|way| *way < 0.45);
        stay && places.feet_apart[0].abs() < 0.3 && places.pelvis_forward < 0.25
    });
    both && thighs && together && feet && look.knee_alternation < 0.8 * 0.5 * (left + right)
}

/// Where a rise begins, the lean of the trunk that prepares it included.
fn onset(motion: &Motion, way: &Transition, seated_from: usize) -> usize {
    let speed = derivative(&motion.trunk_flexion, INTERVAL_S);
    let reach = (LONGEST_LEAN_S / INTERVAL_S) as usize;
    // The lean of sitting down is another one.
    let first = way.start.saturating_sub(reach).max(seated_from.min(way.start));
    let around = first..=way.start;
    let fastest = around.clone().map(|i| speed[i]).filter(|v| v.is_finite()).fold(0.0, f64::max);
    // Back from the last node at which the trunk still leans at speed.
    let Some(last) = around.clone().rev().find(|&i| speed[i] > LEAN_EDGE * fastest) else { return way.start };
    let start =
        (first..last).rev().find(|&i| speed[i].is_nan() || speed[i] <= LEAN_EDGE * fastest).map_or(first, |i| i + 1);
    let leans = motion.trunk_flexion[last] - motion.trunk_flexion[start] >= LEAN_DEG;
    if leans && (way.start - last) as f64 * INTERVAL_S < 0.5 { start } else { way.start }
}

/// Rises as repetitions.
///
/// A recording that begins on the chair has repetitions of rising and sitting down; one that begins standing has repetitions
/// of sitting down and rising. Sitting down without a rise after it is an incomplete one.
pub fn find(motion: &Motion) -> Found {
    let rises = rises(motion);
    let knee = motion.mean_knee();
    let begins_seated = rises.first().is_some_and(|rise| rise.lowering_before.is_none());
    let mut found = Found::default();
    let mut push = |excursion: Excursion| {
        let repetition = repetition(motion, Angle::BothKnees, None, &knee, excursion);
        if repetition.coverage < 0.5 { found.n_unseen += 1 } else { found.repetitions.push(repetition) }
    };
    for rise in &rises {
        let (way, is_complete) = (rise.way, rise.is_complete);
        push(match (begins_seated, rise.lowering_before, rise.lowering_after) {
            (true, _, Some(after)) => Excursion { start: way.start, peak: way.end, end: after.end, is_complete },
            (true, _, None) => Excursion { start: way.start, peak: way.end, end: way.end, is_complete },
            (false, before, _) => {
                let start = before.map_or(0, |before| before.start);
                let middle =
                    before.map_or(way.from, |before| before.end + (way.start.max(before.end) - before.end) / 2);
                Excursion { start, peak: middle, end: way.end, is_complete }
            }
        });
    }
    if !begins_seated && let Some(excursion) = last_sitting_down(motion, &knee) {
        push(excursion);
    }
    found
}

/// Sitting down at the end of the recording.
fn last_sitting_down(motion: &Motion, knee: &[f64]) -> Option<Excursion> {
    let last = transitions(knee, INTERVAL_S, LEAST).last().copied().filter(|way| way.change > 0.0)?;
    let excursion = Excursion { start: last.start, peak: last.to, end: motion.len - 1, is_complete: false };
    sits(&Look::at(motion, excursion)).then_some(excursion)
}
