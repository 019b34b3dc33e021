use super::angles::{AngleErrors, Estimate, compare, speed};
use super::clocks::errors_of_unit;
use super::simulated::{Outcome, Plan, run};
use super::summary::{Means, totals};
use super::thigh::{angle_from_start_deg, scatter_mm, tilt_change_deg};
use super::*;
use crate::assessment::{FusionMethod, SkeletonFusionSettings};
use crate::body::{Joint, Side};
use crate::pipeline::skeleton_fusion;
use crate::progress::Monitor;
use crate::recording::{ReferenceSeries, SkeletonRecording};
use crate::synthetic::{FusionSimulation, Movement, simulate_fusion};
use nalgebra::Vector3;

const STEP_NS: i64 = 10_000_000;

/// A knee that bends by 20° about 30°, once a second, for four seconds.
fn bending() -> ReferenceSeries {
    let time_ns: Vec<i64> = (0..400).map(|i| i * STEP_NS).collect();
    let values = time_ns.iter().map(|t| 30.0 + 20.0 * (std::f64::consts::TAU * *t as f64 * 1e-9).sin()).collect();
    ReferenceSeries {
        channel: "left_knee_flexion_deg".into(),
        source: "test".into(),
        clock_offset_ns: 0,
        time_ns,
        values,
    }
}

fn of(value: &[f64], from_ns: i64) -> AngleErrors {
    let reference = bending();
    compare(&Estimate { time_ns: &reference.time_ns, value, interval: None }, &reference, from_ns).unwrap()
}

#[test]
fn a_constant_offset_is_in_the_error_and_in_nothing_else() {
    let shifted: Vec<f64> = bending().values.iter().map(|value| value + 7.0).collect();
    let errors = of(&shifted, 0);
    assert!((errors.rmse_deg - 7.0).abs() < 1e-9 && errors.offset_free_deg < 1e-6, "{errors:?}");
    assert!((errors.ncc.unwrap() - 1.0).abs() < 1e-9 && errors.speed_rmse_deg_s.unwrap() < 1e-6, "{errors:?}");
    assert_eq!((errors.coverage, errors.held), (1.0, None));
}

#[test]
fn the_correlation_is_of_both_less_their_means() {
    let mirrored: Vec<f64> = bending().values.iter().map(|value| 60.0 - value).collect();
    assert!((of(&mirrored, 0).ncc.unwrap() + 1.0).abs() < 1e-9);
}

#[test]
fn a_full_turn_is_no_error_and_what_is_before_the_start_does_not_count() {
    let mut turned: Vec<f64> = bending().values.iter().map(|value| value + 360.0).collect();
    turned[..100].fill(0.0);
    let errors = of(&turned, 100 * STEP_NS);
    assert!(errors.rmse_deg < 1e-9, "{errors:?}");
}

#[test]
fn missing_values_are_told_as_coverage() {
    let mut half = bending().values;
    half[..200].fill(f64::NAN);
    assert_eq!(of(&half, 0).coverage, 0.5);
    let nothing = [f64::NAN; 400];
    let reference = bending();
    let estimate = Estimate { time_ns: &reference.time_ns, value: &nothing, interval: None };
    assert_eq!(compare(&estimate, &reference, 0), None);
}

#[test]
fn intervals_hold_the_truth_by_count() {
    let reference = bending();
    let low: Vec<f32> = reference.values.iter().map(|value| (*value - 1.0) as f32).collect();
    // Three of four intervals end above the truth.
    let end = |(i, value): (usize, &f64)| if i % 4 == 0 { *value - 0.5 } else { *value + 1.0 } as f32;
    let high: Vec<f32> = reference.values.iter().enumerate().map(end).collect();
    let interval = Some([&low[..], &high[..]]);
    let estimate = Estimate { time_ns: &reference.time_ns, value: &reference.values, interval };
    assert_eq!(compare(&estimate, &reference, 0).unwrap().held, Some(0.75));
}

#[test]
fn speed_is_a_central_difference_over_uneven_times() {
    let found = speed(&[0, 1_000_000_000, 4_000_000_000, 5_000_000_000], &[0.0, 2.0, 8.0, f64::NAN]);
    assert!(found[0].is_nan() && found[2].is_nan() && found[3].is_nan());
    assert_eq!(found[1], 2.0);
}

#[test]
fn totals_name_the_worst_recording_and_count_failures() {
    let error = |channel: &str, rmse_deg: f64, ncc| AngleErrors {
        channel: channel.into(),
        coverage: 1.0,
        rmse_deg,
        offset_free_deg: 1.0,
        ncc,
        speed_rmse_deg_s: None,
        held: None,
    };
    let outcome = |seed, angles, failure| Outcome {
        movement: "kick".into(),
        seed,
        contender: Contender::Raw,
        angles,
        units: Vec::new(),
        failure,
    };
    let left = |rmse_deg, ncc| error("left_knee_flexion_deg", rmse_deg, ncc);
    let outcomes = [
        outcome(1, vec![left(2.0, Some(0.5)), error("right_knee_flexion_deg", 3.0, Some(1.0))], None),
        outcome(2, vec![left(7.0, None), error("right_hip_flexion_deg", 90.0, None)], None),
        outcome(3, Vec::new(), Some("refused".into())),
    ];
    let found = totals(&outcomes, &["knee_flexion"]);
    assert_eq!((found.len(), found[0].n_failed, found[0].worst_deg), (1, 1, 7.0));
    assert_eq!(found[0].worst, "kick 2 left");
    let means = found[0].means;
    assert_eq!((means.n, means.rmse_deg, means.ncc, means.lowest_ncc), (3, 4.0, Some(0.75), Some(0.5)));
    assert_eq!(Means::of([]), None);
}

#[test]
fn the_change_of_tilt_counts_from_the_start_in_both_directions() {
    let time_ns: Vec<i64> = (0..10).map(|i| i * 100_000_000).collect();
    let tilted = |degrees: f64| Vector3::new(degrees.to_radians().sin(), -degrees.to_radians().cos(), 0.0);
    let bone: Vec<Vector3<f64>> = (0..10).map(|i| tilted(if i < 2 { 10.0 } else { 8.0 * i as f64 })).collect();
    let tilt = tilt_change_deg(&time_ns, &bone);
    assert!(tilt[0] < 1e-9 && (tilt[9] - 62.0).abs() < 1e-9, "{tilt:?}");
    // A bone that swings through the vertical has turned by more than its tilt has changed.
    let through: Vec<Vector3<f64>> = (0..10).map(|i| tilted(if i < 2 { -10.0 } else { 50.0 })).collect();
    assert!((tilt_change_deg(&time_ns, &through)[9] - 40.0).abs() < 1e-9);
    assert!((angle_from_start_deg(&time_ns, &through)[9] - 60.0).abs() < 1e-6);
}

#[test]
fn a_thigh_that_is_not_known_has_no_turn() {
    let nowhere = [Vector3::repeat(f64::NAN); 3];
    let time_ns = [0, 300_000_000, 600_000_000];
    assert!(angle_from_start_deg(&time_ns, &nowhere).iter().all(|turn| turn.is_nan()));
    assert!(tilt_change_deg(&time_ns, &nowhere).iter().all(|tilt| tilt.is_nan()));
}

#[test]
fn the_scatter_of_a_knee_is_its_jumps_and_what_stretches_the_thigh() {
    let skeleton = |knee: &dyn Fn(usize) -> [f64; 3]| SkeletonRecording {
        joints: vec![Joint::RightHip, Joint::RightKnee],
        time_ns: (0..60).map(|i| i * 33_333_333).collect(),
        positions: (0..60).flat_map(|i| [Vector3::zeros(), Vector3::from(knee(i))]).collect(),
        confidence: vec![1.0; 120],
        orientations: Vec::new(),
    };
    let still = scatter_mm(&skeleton(&|_| [0.0, -0.4, 0.0]));
    assert!(still.iter().all(|mm| *mm < 1e-9), "{still:?}");
    let stretched = scatter_mm(&skeleton(&|i| [0.0, if i < 20 { -0.37 } else { -0.4 }, 0.0]));
    assert!((stretched[5] - 30.0).abs() < 1e-9 && stretched[50] < 1e-9, "{stretched:?}");
    let jumping = scatter_mm(&skeleton(&|i| [0.0, -0.4, if i == 30 { 0.01 } else { 0.0 }]));
    assert!((8.0..10.0).contains(&jumping[30]), "{}", jumping[30]);
}

#[test]
fn clocks_are_judged_at_their_worst_and_the_true_ones_are_faultless() {
    let settings = FusionSimulation { movement_s: 5.0, ..FusionSimulation::new(Movement::Kick(Side::Right), 2) };
    let truth = simulate_fusion(&settings).unwrap();
    let found =
        skeleton_fusion::assess(&truth.recording, &SkeletonFusionSettings::default(), &Monitor::default()).unwrap();
    let mut unit = found.quality.fusion.unwrap().units[0].clone();
    let own = truth.units.iter().find(|own| own.bone == unit.segment.bone().unwrap()).unwrap();
    unit.clock.reference_s = 10.0;
    unit.clock.drift_ppm = own.clock.drift_ppm;
    unit.clock.offset_s = own.clock.offset_s + own.clock.drift_ppm * 1e-5;
    assert!(errors_of_unit(&truth.recording, &unit).unwrap().clock_ms < 1e-6);
    unit.clock.offset_s += 0.004;
    assert!((errors_of_unit(&truth.recording, &unit).unwrap().clock_ms - 4.0).abs() < 1e-6);
}

#[test]
fn names_parse_back_and_others_are_refused_with_the_choices() {
    for contender in Contender::ALL {
        assert_eq!(contender.name().parse(), Ok(contender));
    }
    assert!("kinect".parse::<Contender>().unwrap_err().to_string().contains("hierarchy"));
}

#[test]
fn the_default_keeps_its_accuracy_on_a_kick_that_the_camera_half_sees() {
    let contenders = vec![Contender::Raw, Contender::Method(FusionMethod::Fused)];
    let plan =
        Plan { movements: vec![Movement::Kick(Side::Right)], movement_s: 12.0, ..Plan::new(vec![3], contenders) };
    let outcomes = run(&plan, || ());
    let totals = totals(&outcomes, &["knee_flexion", "elbow_flexion"]);
    let of = |contender: Contender, joint: &str| {
        totals.iter().find(|total| total.contender == contender && total.joint == joint).unwrap()
    };
    let fused = Contender::Method(FusionMethod::Fused);
    // Degrees: one person, so twice the bars over persons, 2.5 and 3.5.
    let (knee, elbow) = (of(fused, "knee_flexion"), of(fused, "elbow_flexion"));
    assert!(knee.worst_deg < 5.0 && elbow.worst_deg < 7.0, "{knee:?}, {elbow:?}");
    assert!(knee.means.rmse_deg < 0.5 * of(Contender::Raw, "knee_flexion").means.rmse_deg);
    assert!(knee.means.held.unwrap() > 0.9, "{knee:?}");
}
