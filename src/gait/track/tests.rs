//! Footfalls of figures whose contacts are known: feet that stand, and go in between along a smooth curve.

use super::*;
use crate::body::{Joint, Side};
use crate::gait::{StepExclusion, measures_of_track};
use std::f64::consts::PI;

const STEP_S: f64 = 0.55;
const STEP_M: f64 = 0.62;
const WIDTH_M: f64 = 0.14;
/// Share of a stride in which a foot is in the air.
const SWING: f64 = 0.4;
const FRAME_NS: i64 = 33_333_333;

/// Way of a foot in strides, and its height in metres, at a time in strides since one of its contacts: it stands, and goes on
/// by one in the last part of every stride.
fn foot(phase: f64) -> (f64, f64) {
    let (whole, part) = (phase.floor(), phase.rem_euclid(1.0));
    let x = ((part - (1.0 - SWING)) / SWING).max(0.0);
    (whole + x - (2.0 * PI * x).sin() / (2.0 * PI), 0.12 * (PI * x).sin().powi(2))
}

/// Joints of somebody at a time, subject looking along x with the right at +z.
fn figure(pelvis: Vector3<f64>, ankles: [Vector3<f64>; 2]) -> [Vector3<f64>; 6] {
    let hip = |side: f64| pelvis + Vector3::new(0.0, 0.0, 0.09 * side);
    let toe = |ankle: Vector3<f64>| ankle + Vector3::new(0.13, -0.06, 0.0);
    [hip(-1.0), hip(1.0), ankles[0], ankles[1], toe(ankles[0]), toe(ankles[1])]
}

fn track(seconds: f64, at: impl Fn(f64) -> [Vector3<f64>; 6], turn: f64) -> JointTrack {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn);
    let n = (seconds * 30.0) as usize;
    let time_ns: Vec<i64> = (0..n as i64).map(|t| 5_000_000_000 + t * FRAME_NS).collect();
    let joints =
        vec![Joint::LeftHip, Joint::RightHip, Joint::LeftAnkle, Joint::RightAnkle, Joint::LeftFoot, Joint::RightFoot];
    let positions_m = (0..n)
        .flat_map(|t| at(t as f64 * FRAME_NS as f64 * 1e-9))
        .map(|point| (turn * point).map(|value| value as f32).into())
        .collect();
    JointTrack { joints, time_ns, positions_m }
}

/// A walk along x whose left contacts are at whole strides, whose right ones are between them.
fn walker(time: f64) -> [Vector3<f64>; 6] {
    let phase = time / (2.0 * STEP_S);
    let ankle = |phase: f64, z: f64, ahead: f64| {
        let (way, height) = foot(phase);
        Vector3::new(2.0 * STEP_M * way + ahead, 0.09 + height, z)
    };
    // A foot stands half a step before where the pelvis is at its contact.
    let pelvis = Vector3::new(2.0 * STEP_M * phase, 0.9, 0.0);
    let half = 0.5 * STEP_M;
    let left = ankle(phase, -0.5 * WIDTH_M, half);
    let right = ankle(phase - 0.5, 0.5 * WIDTH_M, half + STEP_M);
    figure(pelvis, [left, right])
}

fn value(track: &JointTrack, name: &str) -> Option<f64> {
    let found = measures_of_track(track).measures_of_all_steps;
    found.iter().find(|m| m.name == name && m.side.is_none()).and_then(|m| m.value)
}

fn near(found: Option<f64>, expected: f64, within: f64) {
    assert!(found.is_some_and(|found| (found - expected).abs() <= within), "{found:?} instead of {expected}");
}

#[test]
fn a_walk_has_its_steps_in_every_direction_before_the_camera() {
    for turn in [0.0, 0.5 * PI, 1.1, PI, -2.0] {
        let walk = track(8.0, walker, turn);
        let found = measures_of_track(&walk);
        assert!(found.contacts.len() >= 12 && found.reason.is_empty(), "{turn}: {found:?}");
        assert!(found.contacts.windows(2).all(|pair| pair[0].side != pair[1].side));
        near(value(&walk, "step_length_m"), STEP_M, 0.002);
        near(value(&walk, "step_width_m"), WIDTH_M, 0.002);
        near(value(&walk, "step_time_s"), STEP_S, 0.002);
        near(value(&walk, "usual_speed_mps"), STEP_M / STEP_S, 0.01);
        for contact in &found.contacts {
            // Left feet land at whole strides of 1.1 s, right ones half-way.
            let strides = contact.contact_s / (2.0 * STEP_S) - if contact.side == Side::Left { 0.0 } else { 0.5 };
            assert!((strides - strides.round()).abs() < 0.05, "{contact:?}");
        }
    }
}

#[test]
fn a_long_walk_has_measures_of_the_steps_that_count_with_their_number() {
    let found = measures_of_track(&track(9.0, walker, 0.3));
    let length = found.measures.iter().find(|m| m.name == "step_length_m").unwrap();
    let n_steps = found.contacts.len() as u64 - 1;
    assert_eq!(length.n_observations, Some(n_steps - 4));
    assert_eq!(length.definition.as_deref(), Some("footprint_to_footprint_flat_foot"));
    assert_eq!(found.exclusions.len(), 1);
    assert_eq!(found.flags, []);
}

#[test]
fn a_camera_that_looks_down_and_does_not_know_it_changes_no_length() {
    let level = track(8.0, walker, 0.5 * PI);
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 15f64.to_radians());
    let mut tilted = level.clone();
    for position in &mut tilted.positions_m {
        *position = (tilt * Vector3::from(*position).map(f64::from)).map(|value| value as f32).into();
    }
    for name in ["step_length_m", "stride_length_m", "usual_speed_mps"] {
        // Half a percent; the tilt alone would take away 3.4 %.
        let level = value(&level, name).unwrap();
        near(value(&tilted, name), level, 0.005 * level);
    }
}

#[test]
fn lost_frames_lower_the_coverage_of_their_steps_and_those_do_not_count() {
    let mut walk = track(9.0, walker, 0.0);
    let n = walk.joints.len();
    // Every third frame of 1.5 s without the right ankle; what is left can be bridged.
    for t in (120..165).step_by(3) {
        walk.positions_m[t * n + 3] = [f32::NAN; 3];
    }
    let found = measures_of_track(&walk);
    let low = found.exclusions.iter().find(|e| e.reason == StepExclusion::LowCoverage);
    assert!(low.is_some_and(|low| (1..=3).contains(&low.n_steps)), "{:?}", found.exclusions);
}

#[test]
fn steps_on_the_spot_have_times_but_no_lengths() {
    let march = |time: f64| {
        let ankle = |phase: f64, z: f64| Vector3::new(0.0, 0.09 + foot(phase).1, z);
        let phase = time / (2.0 * STEP_S);
        figure(Vector3::new(0.0, 0.9, 0.0), [ankle(phase, -0.1), ankle(phase - 0.5, 0.1)])
    };
    let march = track(8.0, march, 0.4);
    let found = measures_of_track(&march);
    near(value(&march, "step_time_s"), STEP_S, 0.005);
    near(value(&march, "cadence_spm"), 60.0 / STEP_S, 1.0);
    assert!(found.contacts.iter().all(|contact| contact.place_m.is_none()));
    let is_length = |name: &str| name.ends_with("_m") || name.ends_with("_mps") || name.ends_with("length_cv_pct");
    assert!(found.measures_of_all_steps.iter().all(|m| !is_length(&m.name)));
    assert!(found.reason.contains("on the spot"), "{}", found.reason);
}

#[test]
fn standing_squatting_and_rising_have_no_footfalls() {
    let sway = |time: f64| 0.02 * (2.0 * time).sin();
    let feet = [Vector3::new(0.0, 0.09, -0.1), Vector3::new(0.0, 0.09, 0.1)];
    let depth = |time: f64| 0.2 * (1.0 - (2.0 * PI * time / 3.0).cos());
    let standing = track(10.0, |time| figure(Vector3::new(sway(time), 0.9, sway(1.3 * time)), feet), 0.0);
    let squatting = track(10.0, |time| figure(Vector3::new(-0.5 * depth(time), 0.9 - depth(time), 0.0), feet), 0.0);
    let rising = track(10.0, |time| figure(Vector3::new(-depth(time), 0.9 - depth(time), 0.0), feet), 1.0);
    for still in [standing, squatting, rising] {
        let found = measures_of_track(&still);
        assert_eq!((found.contacts.len(), found.measures.len()), (0, 0));
        assert!(found.reason.contains("no walking"));
    }
}

#[test]
fn a_walk_backwards_is_not_measured_and_said() {
    let back = track(8.0, |time| walker(20.0 - time), 0.7);
    let found = measures_of_track(&back);
    assert!(found.contacts.is_empty() && found.reason.contains("backwards"), "{}", found.reason);
}

#[test]
fn a_track_without_feet_says_so() {
    let nothing = JointTrack { joints: vec![Joint::Head], time_ns: vec![0, 1], positions_m: vec![[0.0; 3]; 2] };
    for track in [nothing, JointTrack::default()] {
        let found = measures_of_track(&track);
        assert!(found.contacts.is_empty() && found.reason.contains("lacks"), "{}", found.reason);
    }
}
