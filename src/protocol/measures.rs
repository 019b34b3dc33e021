//! Measures that several protocols share, and how a measure is written when the recording does not support it.

use super::info::MeasureSpec;
use super::motion::{INTERVAL_S, Motion};
use super::repetitions::Found;
use crate::assessment::{PerformanceMeasure, Repetition};
use crate::body::Side;

/// What is measured of repetitions of one leg after the other.
pub const OF_EACH_SIDE: &[MeasureSpec] =
    &[COUNT, RANGE, SPEED, DURATION, TEMPO, RANGE_SYMMETRY, DURATION_SYMMETRY, LEAN];
/// What is measured of repetitions of both legs together.
pub const OF_BOTH_SIDES: &[MeasureSpec] = &[COUNT, RANGE, SPEED, DURATION, TEMPO, LEAN];

const COUNT: MeasureSpec = ("repetitions_count", "1", "repetitions that the recording shows from start to end");
const RANGE: MeasureSpec =
    ("range_of_motion_deg", "deg", "largest minus smallest angle of a repetition, mean over repetitions");
const SPEED: MeasureSpec =
    ("peak_velocity_deg_s", "deg/s", "largest speed of the angle in a repetition, mean over repetitions");
const DURATION: MeasureSpec =
    ("repetition_duration_s", "s", "time from start to end of a repetition, mean over repetitions");
const TEMPO: MeasureSpec = ("tempo_per_min", "1/min", "repetitions per minute, from the first start to the last");
const RANGE_SYMMETRY: MeasureSpec =
    ("range_of_motion_symmetry_ratio", "1", "right mean range of motion divided by the left one");
const DURATION_SYMMETRY: MeasureSpec =
    ("repetition_duration_symmetry_ratio", "1", "right mean duration divided by the left one");
const LEAN: MeasureSpec =
    ("trunk_lean_deg", "deg", "farthest that the trunk leans in a repetition, mean over repetitions");

/// A measure with a value.
pub fn measured(spec: MeasureSpec, value: f64) -> PerformanceMeasure {
    PerformanceMeasure { value: Some(value), ..missing(spec, "") }
}

/// A measure that the recording does not support, and why.
pub fn missing(spec: MeasureSpec, reason: impl Into<String>) -> PerformanceMeasure {
    PerformanceMeasure {
        name: spec.0.to_owned(),
        side: None,
        value: None,
        standard_error: None,
        error_sd: None,
        definition: None,
        n_observations: None,
        reason: reason.into(),
    }
}

/// Measures of complete repetitions: for each side that moved, then for the whole.
pub fn of_repetitions(found: &Found) -> Vec<PerformanceMeasure> {
    let complete: Vec<&Repetition> = found.complete().collect();
    let mut measures = Vec::new();
    let is_sided = complete.iter().any(|repetition| repetition.side.is_some());
    let sides: Vec<Option<Side>> = if is_sided { Side::BOTH.map(Some).to_vec() } else { vec![None] };
    for &side in &sides {
        let own: Vec<&Repetition> = complete.iter().copied().filter(|r| r.side == side).collect();
        let mut count = measured(COUNT, own.len() as f64);
        count.n_observations = Some(own.len() as u64);
        measures.push(PerformanceMeasure { side, ..count });
        if own.is_empty() {
            continue;
        }
        for (spec, of) in [(RANGE, range as fn(&Repetition) -> f64), (SPEED, speed), (DURATION, duration)] {
            let Some(mean) = Mean::of(&own, of) else { continue };
            measures.push(PerformanceMeasure { side, ..mean.measure(spec) });
        }
    }
    measures.push(tempo(&complete));
    if is_sided {
        let of_side = |side: Side| -> Vec<&Repetition> {
            complete.iter().copied().filter(|repetition| repetition.side == Some(side)).collect()
        };
        let (left, right) = (of_side(Side::Left), of_side(Side::Right));
        measures.push(symmetry(RANGE_SYMMETRY, &left, &right, range));
        measures.push(symmetry(DURATION_SYMMETRY, &left, &right, duration));
    }
    let leans: Vec<&Repetition> = complete.iter().copied().filter(|r| r.trunk_lean_deg.is_some()).collect();
    measures.push(match Mean::of(&leans, |repetition| repetition.trunk_lean_deg.unwrap_or(f64::NAN)) {
        Some(mean) => mean.measure(LEAN),
        None => missing(LEAN, "the trunk was not seen"),
    });
    measures
}

fn range(repetition: &Repetition) -> f64 {
    repetition.extremes_deg[1] - repetition.extremes_deg[0]
}

fn speed(repetition: &Repetition) -> f64 {
    repetition.peak_velocity_deg_s
}

fn duration(repetition: &Repetition) -> f64 {
    repetition.end_s - repetition.start_s
}

/// Mean over repetitions and its standard error.
struct Mean {
    value: f64,
    /// From the spread between repetitions; none with one of them.
    standard_error: Option<f64>,
    n: usize,
}

impl Mean {
    fn of(repetitions: &[&Repetition], of: impl Fn(&Repetition) -> f64) -> Option<Self> {
        let n = repetitions.len();
        if n == 0 {
            return None;
        }
        let values: Vec<f64> = repetitions.iter().map(|repetition| of(repetition)).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n as f64 - 1.0);
        let standard_error = (n > 1).then(|| (variance / n as f64).sqrt());
        Some(Self { value: mean, standard_error, n })
    }

    fn measure(&self, spec: MeasureSpec) -> PerformanceMeasure {
        let reason = if self.n == 1 { "one repetition tells no standard error" } else { "" };
        PerformanceMeasure {
            standard_error: self.standard_error,
            n_observations: Some(self.n as u64),
            reason: reason.to_owned(),
            ..measured(spec, self.value)
        }
    }
}

fn tempo(complete: &[&Repetition]) -> PerformanceMeasure {
    let (Some(first), Some(last)) = (complete.first(), complete.last()) else {
        return missing(TEMPO, "there is no complete repetition");
    };
    let seconds = last.start_s - first.start_s;
    if complete.len() < 2 || seconds < INTERVAL_S {
        return missing(TEMPO, "one repetition has no tempo; record at least two");
    }
    let per_min = 60.0 * (complete.len() - 1) as f64 / seconds;
    PerformanceMeasure { n_observations: Some(complete.len() as u64), ..measured(TEMPO, per_min) }
}

fn symmetry(
    spec: MeasureSpec,
    left: &[&Repetition],
    right: &[&Repetition],
    of: fn(&Repetition) -> f64,
) -> PerformanceMeasure {
    let (Some(l), Some(r)) = (Mean::of(left, of), Mean::of(right, of)) else {
        return missing(spec, "only one side moved");
    };
    let ratio = r.value / l.value;
    if !ratio.is_finite() {
        return missing(spec, "the left side did not move");
    }
    // First order: relative variances add up.
    let standard_error = l
        .standard_error
        .zip(r.standard_error)
        .map(|(left_error, right_error)| ratio * (left_error / l.value).hypot(right_error / r.value));
    let reason = if standard_error.is_none() { "a side with one repetition tells no standard error" } else { "" };
    PerformanceMeasure {
        standard_error,
        n_observations: Some((l.n + r.n) as u64),
        reason: reason.to_owned(),
        ..measured(spec, ratio)
    }
}

/// Standard deviation of the time of one start or end, seconds: root mean square of both against optical knee angles on sit to
/// stand (UI-PRMD, ten repetitions: starts 0.09, ends 0.13).
pub const EVENT_SD_S: f64 = 0.11;

/// Longest time without an observation in which nothing that matters can be missed, seconds.
const LONGEST_UNSEEN_S: f64 = 0.5;

/// The time between two instants, with the error of both; none when the legs were out of sight between them.
pub fn timed(motion: &Motion, spec: MeasureSpec, at_s: [f64; 2], n: usize, remark: &str) -> PerformanceMeasure {
    let node = |seconds: f64| (seconds / INTERVAL_S).round() as usize;
    if motion.longest_unseen_s(node(at_s[0]), node(at_s[1])) > LONGEST_UNSEEN_S {
        return missing(spec, "the legs were out of sight for more than 0.5 s within the test; repeat it");
    }
    PerformanceMeasure {
        standard_error: Some(EVENT_SD_S * 2f64.sqrt()),
        n_observations: Some(n as u64),
        reason: remark.to_owned(),
        ..measured(spec, at_s[1] - at_s[0])
    }
}
