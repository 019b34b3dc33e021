//! Where an angle goes from one level to another, and excursions made of two such ways.
//!
//! Nothing here knows a body: a signal on a regular grid comes in, instants come out. Sizes are relative to the signal's own
//! extremes with a floor on the absolute change, so that a sensor which sees a movement too small still shows it.
//!
//! ```text
//! least change that counts      P = max(floor, share (max − min))
//! core of a way a → b           from the last 20 % level before the first 80 % level
//! its start and end             outwards from the core while the speed exceeds 25 % of the way's largest
//! ```
//!
//! The rule on speed, and not on level, keeps the start of a rise where it is although the angle drifts while somebody sits.

use std::ops::Range;

/// Smallest change that is a way of its own: the larger of the two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Least {
    /// In the signal's unit.
    pub floor: f64,
    /// Share of the signal's range.
    pub share: f64,
}

impl Least {
    /// A floor, and a third of the range: repetitions of one exercise are alike.
    pub const fn of(floor: f64) -> Self {
        Self { floor, share: 0.35 }
    }
}

/// Levels between which a way has its core, shares of its change.
const CORE: [f64; 2] = [0.2, 0.8];

/// Share of the largest speed that a way has at its start and end.
pub const EDGE_SPEED: f64 = 0.25;

/// Share of the way out from which on an excursion is nearly as far as it gets.
const NEARLY: f64 = 0.8;

/// Share of an excursion that must be seen on both sides of its peak: one that begins or ends nearer to the peak, at the
/// signal's edge, is cut off.
const CUT_OFF: f64 = 0.3;

/// One way of a signal between two turning points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    /// Sample of the turning point before it.
    pub from: usize,
    /// First sample of the movement.
    pub start: usize,
    /// Last sample of the movement.
    pub end: usize,
    /// Sample of the turning point after it.
    pub to: usize,
    /// Value after minus value before.
    pub change: f64,
    /// Largest speed, the signal's unit per second, positive.
    pub peak_speed: f64,
}

/// A way from a base and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excursion {
    /// First sample of the way out; the signal's first sample when it began before.
    pub start: usize,
    /// Middle of the samples that are nearly farthest from the base.
    pub peak: usize,
    /// Last sample of the way back; the signal's last sample when it ends after.
    pub end: usize,
    /// False when the signal begins or ends within it.
    pub is_complete: bool,
}

/// Derivative per second by central differences; NaN beside what is missing.
pub fn derivative(values: &[f64], interval_s: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    let at = |i: usize| {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
        (values[after] - values[before]) / ((after - before).max(1) as f64 * interval_s)
    };
    (0..values.len()).map(at).collect()
}

/// Ways of a signal that are at least so high, by time. Missing samples (NaN) are passed over.
pub fn transitions(values: &[f64], interval_s: f64, least: Least) -> Vec<Transition> {
    let range = values
        .iter()
        .filter(|v| v.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)]);
    let least = least.floor.max(least.share * (range[1] - range[0]));
    let speed = derivative(values, interval_s);
    let points = turning_points(values, least);
    points.windows(2).map(|pair| way(values, &speed, pair[0]..pair[1])).collect()
}

/// Extremes in turn, each at least `least` from the one before it.
fn turning_points(values: &[f64], least: f64) -> Vec<usize> {
    let mut points = Vec::new();
    let Some(first) = values.iter().position(|v| v.is_finite()) else { return points };
    let (mut low, mut high) = (first, first);
    // +1 while the signal rises to its next maximum, −1 while it falls, 0 before the first change.
    let mut direction = 0;
    for (i, &value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        if direction >= 0 && value > values[high] || direction == 0 && value >= values[high] {
            high = i;
        }
        if direction <= 0 && value < values[low] || direction == 0 && value <= values[low] {
            low = i;
        }
        if direction >= 0 && values[high] - value >= least {
            points.push(high);
            (direction, low) = (-1, i);
        } else if direction <= 0 && value - values[low] >= least {
            points.push(low);
            (direction, high) = (1, i);
        }
    }
    match direction {
        1 => points.push(high),
        -1 => points.push(low),
        _ => {}
    }
    points
}

/// The way between two turning points.
fn way(values: &[f64], speed: &[f64], points: Range<usize>) -> Transition {
    let (from, to) = (points.start, points.end);
    let change = values[to] - values[from];
    let sign = change.signum();
    let is_past = |i: usize, share: f64| sign * (values[i] - values[from]) >= share * change.abs();
    let core_end = (from..=to).find(|&i| is_past(i, CORE[1])).unwrap_or(to);
    let core_start = (from..=core_end).rev().find(|&i| !is_past(i, CORE[0])).unwrap_or(from);
    let peak_speed = (core_start..=core_end).map(|i| sign * speed[i]).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let moves = |i: usize| sign * speed[i] > EDGE_SPEED * peak_speed;
    let start = (from..core_start).rev().find(|&i| !moves(i)).map_or(from, |i| i + 1).min(core_start);
    let end = (core_end + 1..=to).find(|&i| !moves(i)).map_or(to, |i| i - 1).max(core_end);
    Transition { from, start, end, to, change, peak_speed }
}

/// Excursions upwards of at least that size, by time; those that the signal's ends cut off come along, marked.
pub fn excursions(values: &[f64], interval_s: f64, least: Least) -> Vec<Excursion> {
    let ways = transitions(values, interval_s, least);
    let mut found = Vec::new();
    let mut i = 0;
    if let Some(back) = ways.first().filter(|way| way.change < 0.0) {
        found.push(Excursion { start: 0, peak: back.from, end: back.end, is_complete: false });
        i = 1;
    }
    while let Some(out) = ways.get(i) {
        found.push(match ways.get(i + 1) {
            Some(back) => {
                let mut whole =
                    Excursion { start: out.start, peak: highest(values, out, back), end: back.end, is_complete: true };
                whole.is_complete = !is_cut_off(values, &whole, ways.len() == i + 2);
                whole
            }
            None => Excursion { start: out.start, peak: out.to, end: values.len() - 1, is_complete: false },
        });
        i += 2;
    }
    found
}

/// Middle of the time in which the signal is nearly as high as it gets: a plateau with two bumps has no highest sample that
/// means anything.
fn highest(values: &[f64], out: &Transition, back: &Transition) -> usize {
    let near = values[out.to] - (1.0 - NEARLY) * out.change;
    let is_high = |i: &usize| values[*i] >= near;
    let first = (out.start..=back.end).find(is_high).unwrap_or(out.to);
    let last = (out.start..=back.end).rev().find(is_high).unwrap_or(out.to);
    let middle = first + (last - first) / 2;
    if is_high(&middle) { middle } else { out.to }
}

/// Whether the signal's edge takes away part of an excursion: one of its ends is much higher than the other, and lies at the
/// edge.
fn is_cut_off(values: &[f64], excursion: &Excursion, is_last: bool) -> bool {
    let (first, last) = (values[excursion.start], values[excursion.end]);
    let base = first.min(last);
    let missing = |value: f64| value - base > CUT_OFF * (values[excursion.peak] - base);
    let first_seen = values.iter().position(|v| v.is_finite()).unwrap_or(0);
    excursion.start <= first_seen + 1 && missing(first) || is_last && excursion.end + 2 >= values.len() && missing(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const INTERVAL_S: f64 = 0.02;

    /// Rises from `low` to `high` and back along a cosine, `period_s` each, `n` times, with rests of one second.
    fn waves(low: f64, high: f64, period_s: f64, n: usize) -> Vec<f64> {
        let steps = (period_s / INTERVAL_S) as usize;
        let rest = (1.0 / INTERVAL_S) as usize;
        let mut values = vec![low; rest];
        for _ in 0..n {
            values.extend((0..steps).map(|i| {
                let phase = i as f64 / steps as f64;
                low + (high - low) * 0.5 * (1.0 - (2.0 * PI * phase).cos())
            }));
            values.extend(vec![low; rest]);
        }
        values
    }

    #[test]
    fn each_wave_is_one_excursion_whatever_its_size_and_offset() {
        for (low, high) in [(0.0, 90.0), (-20.0, 20.0), (400.0, 430.0)] {
            let found = excursions(&waves(low, high, 2.0, 4), INTERVAL_S, Least::of(20.0));
            assert_eq!(found.len(), 4);
            for (i, excursion) in found.iter().enumerate() {
                assert!(excursion.is_complete);
                let start_s = 1.0 + 3.0 * i as f64;
                // A cosine has 25 % of its largest speed a twenty-fifth of its period after it began.
                assert!((excursion.start as f64 * INTERVAL_S - start_s - 0.08).abs() < 0.05, "{excursion:?}");
                assert!((excursion.peak as f64 * INTERVAL_S - start_s - 1.0).abs() < 0.03, "{excursion:?}");
                assert!((excursion.end as f64 * INTERVAL_S - start_s - 1.92).abs() < 0.05, "{excursion:?}");
            }
        }
    }

    #[test]
    fn changes_below_the_floor_or_a_third_of_the_range_are_none() {
        assert_eq!(excursions(&waves(0.0, 15.0, 2.0, 3), INTERVAL_S, Least::of(20.0)), []);
        let mut values = waves(0.0, 90.0, 2.0, 1);
        values.extend(waves(0.0, 25.0, 2.0, 1));
        assert_eq!(excursions(&values, INTERVAL_S, Least::of(20.0)).len(), 1);
    }

    #[test]
    fn a_signal_that_begins_or_ends_within_a_wave_gives_an_incomplete_excursion() {
        let values = waves(0.0, 90.0, 2.0, 2);
        let cut = &values[100..230];
        let complete: Vec<bool> = excursions(cut, INTERVAL_S, Least::of(20.0)).iter().map(|e| e.is_complete).collect();
        assert_eq!(complete, [false, false]);
    }

    #[test]
    fn a_drift_on_the_plateau_moves_neither_start_nor_end_of_a_way() {
        let mut values = waves(0.0, 60.0, 2.0, 1)[..100].to_vec();
        let top = values.len();
        values.extend((0..200).map(|i| 60.0 - 12.0 * f64::from(i) / 200.0));
        values.extend((0..50).map(|i| 48.0 * 0.5 * (1.0 + (PI * f64::from(i) / 50.0).cos())));
        let ways = transitions(&values, INTERVAL_S, Least::of(20.0));
        assert_eq!(ways.len(), 2);
        assert!(ways[0].end < top + 5 && ways[1].start > 290, "{ways:?}");
    }

    #[test]
    fn a_signal_without_a_number_has_no_way() {
        assert_eq!(transitions(&[f64::NAN; 40], INTERVAL_S, Least::of(20.0)), []);
        assert_eq!(transitions(&[], INTERVAL_S, Least::of(20.0)), []);
    }
}
