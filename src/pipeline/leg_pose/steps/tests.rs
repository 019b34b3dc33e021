//! Steps of feet whose way is made by hand.

use super::*;

const RATE_HZ: f64 = 30.0;
const STEP_M: f64 = 0.42;
const STEP_S: f64 = 0.7;
/// Share of a step in which both feet are down.
const DOUBLE: f64 = 0.3;
/// Standing before and after the walk, seconds.
const REST_S: f64 = 1.0;

/// Place along the walk and height of both feet, and place of the camera, metres.
fn walking(time: f64, n_steps: usize, step_m: f64) -> ([f64; 2], [f64; 2], f64) {
    let (mut along, mut height) = ([0.0; 2], [0.08; 2]);
    for k in 0..n_steps {
        let begin = REST_S + (k as f64 + DOUBLE) * STEP_S;
        let share = ((time - begin) / ((1.0 - DOUBLE) * STEP_S)).clamp(0.0, 1.0);
        let (foot, target) = (k % 2, (k + 1) as f64 * step_m);
        let smooth = share * share * (3.0 - 2.0 * share);
        along[foot] += (target - along[foot]) * smooth;
        height[foot] += 0.05 * (std::f64::consts::PI * share).sin();
    }
    let camera = step_m / STEP_S * (time - REST_S).clamp(0.0, n_steps as f64 * STEP_S);
    (along, height, camera)
}

/// Both feet as a camera sees them a metre ahead of where the walk began; the left foot steps first.
fn seen_walk(n_steps: usize, step_m: f64) -> Vec<FeetFrame> {
    let place = |time: f64| {
        let (along, height, camera) = walking(time, n_steps, step_m);
        ([0, 1].map(|foot| Vector2::new([0.07, -0.07][foot], along[foot] - camera - 1.0)), height)
    };
    let n_frames = ((2.0 * REST_S + n_steps as f64 * STEP_S) * RATE_HZ) as usize;
    (0..n_frames)
        .map(|k| {
            let time = k as f64 / RATE_HZ;
            let ((ankle, height), (after, _), (before, _)) = (place(time), place(time + 0.01), place(time - 0.01));
            FeetFrame {
                time,
                ankle,
                ankle_sd: [Vector2::repeat(0.01); 2],
                velocity: [0, 1].map(|foot| (after[foot] - before[foot]) / 0.02),
                height,
                seen: true,
            }
        })
        .collect()
}

fn reasons(gait: &Gait) -> Vec<(&str, u64)> {
    gait.excluded.iter().map(|excluded| (excluded.reason.as_str(), excluded.n_steps)).collect()
}

#[test]
fn every_step_of_a_walk_is_found_once_with_its_side_length_and_time() {
    let gait = gait(&seen_walk(10, STEP_M));
    assert_eq!(gait.steps.len(), 10);
    for (k, step) in gait.steps.iter().enumerate() {
        assert_eq!(step.side, Side::BOTH[k % 2]);
        assert!(!step.backward);
        let strike = REST_S + (k + 1) as f64 * STEP_S;
        assert!((step.heel_strike_s - strike).abs() < 0.1, "{} for {strike}", step.heel_strike_s);
        for measure in &step.measures {
            assert!((measure.width_m - 0.14).abs() < 0.005, "{measure:?}");
            assert!((measure.length_m - STEP_M).abs() < 0.02, "{k}: {measure:?}");
        }
    }
    assert_eq!((gait.n_steps_used, reasons(&gait)), (6, vec![("first_or_last", 4)]));
    assert!((gait.cadence_per_min.unwrap() - 60.0 / STEP_S).abs() < 2.0);
    assert!((gait.double_support_share.unwrap() - DOUBLE).abs() < 0.12, "{:?}", gait.double_support_share);
    assert_eq!(gait.summary.len(), 2);
}

#[test]
fn feet_that_sway_or_shift_by_centimetres_do_not_step() {
    let mut frames = seen_walk(0, STEP_M);
    for frame in &mut frames {
        let phase = std::f64::consts::TAU * 0.5 * frame.time;
        frame.ankle[0].y += 0.02 * phase.sin();
        frame.velocity[0].y += 0.02 * std::f64::consts::TAU * 0.5 * phase.cos();
    }
    let standing = gait(&frames);
    assert!(standing.steps.is_empty() && standing.summary.is_empty() && standing.cadence_per_min.is_none());
    assert!((standing.standing_s - frames.last().unwrap().time).abs() < 1e-9);
    assert!(gait(&seen_walk(1, 0.04)).steps.is_empty());
}

#[test]
fn feet_that_are_not_seen_do_not_step() {
    let mut frames = seen_walk(10, STEP_M);
    frames.iter_mut().for_each(|frame| frame.seen = false);
    assert!(gait(&frames).steps.is_empty());
    assert_eq!(gait(&[]), Gait::default());
}

#[test]
fn a_step_that_is_seen_in_part_is_left_out_of_the_means() {
    let mut frames = seen_walk(10, STEP_M);
    let hidden = REST_S + 5.0 * STEP_S..REST_S + 5.6 * STEP_S;
    frames.iter_mut().filter(|f| hidden.contains(&f.time)).for_each(|frame| frame.seen = false);
    let gait = gait(&frames);
    assert!(gait.steps.len() <= 10 && gait.n_steps_used < 6, "{:?}", reasons(&gait));
    let is_hidden = |step: &Step| step.toe_off_s < hidden.end && step.heel_strike_s > hidden.start;
    assert!(gait.steps.iter().filter(|s| is_hidden(s)).all(|s| !s.excluded_because.is_empty()));
}

#[test]
fn a_walk_backwards_is_said_to_go_backwards() {
    let mut frames = seen_walk(10, STEP_M);
    for frame in &mut frames {
        for foot in 0..2 {
            frame.ankle[foot].y = -2.0 - frame.ankle[foot].y;
            frame.velocity[foot].y *= -1.0;
        }
    }
    let gait = gait(&frames);
    assert_eq!(gait.steps.len(), 10);
    assert!(gait.steps.iter().all(|step| step.backward));
}

#[test]
fn a_foot_that_steps_twice_running_gives_no_measures() {
    let mut frames = seen_walk(10, STEP_M);
    // The other foot's swing is not seen to move: it jumps.
    let swing = REST_S + (5.0 + DOUBLE) * STEP_S - 0.05..REST_S + 6.0 * STEP_S + 0.05;
    for frame in frames.iter_mut().filter(|f| swing.contains(&f.time)) {
        frame.velocity[1] = frame.velocity[0];
    }
    let gait = gait(&frames);
    assert!(gait.steps.len() <= 10);
    for pair in gait.steps.windows(2).filter(|pair| pair[0].side == pair[1].side) {
        assert!(pair.iter().all(|step| step.measures.is_empty() && !step.excluded_because.is_empty()));
    }
}

#[test]
fn a_recording_that_ends_soon_after_a_contact_has_that_step_and_one_that_ends_in_the_air_has_not() {
    let frames = seen_walk(5, STEP_M);
    let contact = ((REST_S + 5.0 * STEP_S) * RATE_HZ) as usize;
    assert_eq!(gait(&frames[..contact + 6]).steps.len(), 5);
    let in_the_air = contact - (0.4 * STEP_S * RATE_HZ) as usize;
    assert_eq!(gait(&frames[..in_the_air]).steps.len(), 4);
}

#[test]
fn paths_that_bend_each_to_its_own_side_are_no_turn_and_paths_that_bend_to_one_side_are() {
    let bent = |curvature: [f64; 2]| {
        let mut frames = seen_walk(9, STEP_M);
        for frame in &mut frames {
            for (foot, curvature) in curvature.into_iter().enumerate() {
                frame.ankle[foot].x += curvature * (frame.ankle[foot].y + 1.0).powi(2);
            }
        }
        reasons(&gait(&frames)).iter().filter(|(reason, _)| *reason == "turning").map(|(_, n)| *n).sum::<u64>()
    };
    assert_eq!(bent([0.2, -0.2]), 0);
    assert!(bent([0.2, 0.2]) >= 5, "{}", bent([0.2, 0.2]));
}
