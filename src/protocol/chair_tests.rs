//! Timed tests on motions made by hand: every instant is known.

use super::find;
use super::motion::{INTERVAL_S, Motion};
use super::repetitions::Found;
use crate::assessment::{PerformanceMeasure, Repetition};
use crate::body::Side;
use std::f64::consts::PI;

/// Time of one rise, and of sitting down, seconds.
const WAY_S: f64 = 1.0;
/// Rest on the seat and in standing, seconds.
const REST_S: f64 = 0.5;
/// Seconds before the first rise.
const BEFORE_S: f64 = 1.0;

/// Flexion at `t` seconds of somebody who rises and sits down `n` times and stays standing after the last rise.
fn flexion(n: usize, t: f64) -> f64 {
    let period_s = 2.0 * (WAY_S + REST_S);
    let turn = ((t - BEFORE_S) / period_s).max(-1.0);
    let within = t - BEFORE_S - turn.floor() * period_s;
    let half = |s: f64| 0.5 * (1.0 - (PI * s.clamp(0.0, 1.0)).cos());
    let stands = if turn < 0.0 {
        0.0
    } else if turn >= n as f64 {
        1.0
    } else {
        let last = turn.floor() as usize + 1 == n;
        half(within / WAY_S) - if last { 0.0 } else { half((within - WAY_S - REST_S) / WAY_S) }
    };
    90.0 * (1.0 - stands)
}

fn motion(n_rises: usize, seconds: f64) -> Motion {
    let len = (seconds / INTERVAL_S) as usize + 1;
    let knee: Vec<f64> = (0..len).map(|i| flexion(n_rises, i as f64 * INTERVAL_S)).collect();
    let rest = vec![0.0; len];
    let pair = |values: &Vec<f64>| [values.clone(), values.clone()];
    Motion {
        len,
        knee: pair(&knee),
        hip: pair(&knee),
        abduction: pair(&rest),
        thigh: pair(&knee),
        trunk_flexion: rest.clone(),
        trunk_lateral: rest,
        is_seen: [vec![true; len], vec![true; len]],
        places: None,
    }
}

fn measured(id: &str, motion: &Motion, found: &Found) -> PerformanceMeasure {
    let protocol = find(id).expect("in the catalogue");
    (protocol.measure)(motion, found).swap_remove(0)
}

fn of_chair(id: &str, motion: &Motion) -> PerformanceMeasure {
    let found = (find(id).expect("in the catalogue").find)(motion);
    measured(id, motion, &found)
}

#[test]
fn five_rises_are_timed_from_the_first_start_to_the_fifth_standing() {
    for n in [5, 7] {
        let time = of_chair("sts5", &motion(n, 25.0));
        // Four whole periods and a rise; a cosine exceeds a quarter of its largest speed 0.08 s from either end.
        assert!(time.value.is_some_and(|seconds| (seconds - (4.0 * 3.0 + 1.0 - 0.16)).abs() < 0.06), "{time:?}");
        assert!(time.standard_error.is_some() && time.reason.contains("arms"));
    }
}

#[test]
fn the_lean_that_prepares_the_first_rise_belongs_to_the_time() {
    let mut leaning = motion(5, 25.0);
    // Twenty degrees from 0.4 s to 1.0 s.
    for (i, lean) in leaning.trunk_flexion.iter_mut().enumerate() {
        let share = ((i as f64 * INTERVAL_S - 0.4) / 0.6).clamp(0.0, 1.0);
        *lean = 20.0 * 0.5 * (1.0 - (PI * share).cos());
    }
    let (plain, with_lean) = (of_chair("sts5", &motion(5, 25.0)), of_chair("sts5", &leaning));
    let longer_s = with_lean.value.expect("a time") - plain.value.expect("a time");
    assert!((0.55..0.75).contains(&longer_s), "{longer_s}");
}

#[test]
fn four_rises_or_a_gap_within_the_test_give_no_time() {
    let four = of_chair("sts5", &motion(4, 20.0));
    assert!(four.value.is_none() && four.reason.contains("4 complete rises"), "{four:?}");
    let mut hidden = motion(5, 25.0);
    for seen in &mut hidden.is_seen {
        seen[300..340].fill(false);
    }
    let hidden = of_chair("sts5", &hidden);
    assert!(hidden.value.is_none() && hidden.reason.contains("out of sight"), "{hidden:?}");
}

#[test]
fn rises_in_thirty_seconds_are_counted_with_one_that_is_more_than_halfway_up() {
    // Rises begin at 1, 4, …, 31 s; the test ends at 31.1 s, before the eleventh is halfway up at 31.5 s.
    assert_eq!(of_chair("chair30", &motion(20, 40.0)).value, Some(10.0));
    // Somebody who begins 0.6 s earlier, by a lean, is no farther up then.
    let short = of_chair("chair30", &motion(20, 25.0));
    assert!(short.value.is_none() && short.reason.contains("record longer"), "{short:?}");
}

#[test]
fn a_rise_that_turns_back_before_standing_spoils_the_timed_test() {
    let mut turned = motion(6, 25.0);
    // The second rise, from 4 to 5 s, ends half-way and goes back.
    for knee in turned.knee.iter_mut().chain(turned.thigh.iter_mut()) {
        for flexion in &mut knee[200..325] {
            *flexion = flexion.max(40.0);
        }
    }
    let time = of_chair("sts5", &turned);
    assert!(time.value.is_none() && time.reason.contains("repeat"), "{time:?}");
}

fn steps(sides: &[Side]) -> Found {
    let step = |(i, side): (usize, &Side)| Repetition {
        side: Some(*side),
        start_s: 1.0 + i as f64,
        peak_s: 1.4 + i as f64,
        end_s: 1.9 + i as f64,
        channel: format!("{}_knee_flexion_deg", side.name()),
        extremes_deg: [5.0, 65.0],
        peak_velocity_deg_s: 200.0,
        trunk_lean_deg: Some(3.0),
        coverage: 1.0,
        is_complete: true,
    };
    Found { repetitions: sides.iter().enumerate().map(step).collect(), ..Found::default() }
}

#[test]
fn eight_alternate_steps_are_timed_and_fewer_or_the_same_foot_twice_are_not() {
    use Side::{Left, Right};
    let motion = motion(1, 12.0);
    let time = measured("alternate_step", &motion, &steps(&[Left, Right, Left, Right, Left, Right, Left, Right]));
    assert!(time.value.is_some_and(|seconds| (seconds - 7.9).abs() < 1e-9), "{time:?}");
    let seven = measured("alternate_step", &motion, &steps(&[Left, Right, Left, Right, Left, Right, Left]));
    let twice = measured("alternate_step", &motion, &steps(&[Left, Right, Left, Right, Right, Left, Right, Left]));
    assert!(seven.value.is_none() && twice.value.is_none() && seven.reason.contains("in turn"));
}
