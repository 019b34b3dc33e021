//! Recovery of known clocks from a figure that jumps and exercises.

mod figure;

use super::*;
use crate::body::Joint;
use figure::{Clock, Figure, Moves};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const LIMBS: [Segment; 3] = [Segment::LeftForearm, Segment::RightThigh, Segment::RightShank];

/// Largest error of a unit's map from its first to its last sample, milliseconds.
fn error_ms(found: &UnitClock, figure: &Figure, unit: &InertialSensor) -> f64 {
    let clock = found.clock().unwrap_or_else(|| panic!("{}: {:?}", unit.segment, found.alignment));
    let truth = figure.clock(unit.segment);
    let error = |time: i64| ((clock.camera_ns(time) - truth.camera_ns(time)) as f64 * 1e-6).abs();
    error(unit.time_ns[0]).max(error(unit.time_ns[unit.len() - 1]))
}

#[test]
fn five_jumps_give_every_clock_to_less_than_five_milliseconds_but_not_its_drift() {
    let figure = Figure::new(Moves::JumpsOnly, 15.0, 3);
    let segments: Vec<Segment> = figure.clocks.iter().map(|(segment, _)| *segment).collect();
    let (skeleton, units) = figure.record(&segments);
    for (found, unit) in synchronize(&skeleton, &units).units.iter().zip(&units) {
        let error_ms = error_ms(found, &figure, unit);
        let alignment = found.alignment.expect("aligned");
        assert!(error_ms < 5.0, "{}: {error_ms} ms", unit.segment);
        assert_eq!((found.evidence(), alignment.drift_is_measured), (Evidence::Jumps, false));
        assert!(alignment.clock.drift_sd_ppm > 50.0 && alignment.clock.offset_sd_s < 0.003);
    }
}

#[test]
fn movement_after_the_jumps_gives_the_drift() {
    let figure = Figure::new(Moves::JumpsThenKicks, 150.0, 4);
    let (skeleton, units) = figure.record(&LIMBS[..2]);
    for (found, unit) in synchronize(&skeleton, &units).units.iter().zip(&units) {
        let error_ms = error_ms(found, &figure, unit);
        assert!(error_ms < 3.0, "{}: {error_ms} ms", unit.segment);
        let alignment = found.alignment.expect("aligned");
        assert!(alignment.drift_is_measured && alignment.has_jumps && alignment.residual_s < 0.005);
        let drift_error = alignment.clock.drift_ppm - figure.clock(unit.segment).drift * 1e6;
        assert!(drift_error.abs() < 3.0 * alignment.clock.drift_sd_ppm, "{drift_error} ppm");
    }
}

#[test]
fn uneven_kicks_serve_without_jumps() {
    let figure = Figure::new(Moves::Kicks, 40.0, 5);
    let (skeleton, units) = figure.record(&LIMBS);
    for (found, unit) in synchronize(&skeleton, &units).units.iter().zip(&units) {
        let error_ms = error_ms(found, &figure, unit);
        assert!(error_ms < 8.0, "{}: {error_ms} ms", unit.segment);
        assert_eq!(found.evidence(), Evidence::Movement);
    }
}

#[test]
fn kicks_that_are_all_alike_are_refused_as_ambiguous() {
    let (skeleton, units) = Figure::new(Moves::EvenKicks, 30.0, 6).record(&LIMBS);
    for found in synchronize(&skeleton, &units).units {
        assert!(matches!(found.alignment, Err(Refusal::Ambiguous { .. })), "{:?}", found.alignment);
        assert_eq!(found.evidence(), Evidence::None);
    }
}

#[test]
fn nobody_who_moves_is_a_refusal() {
    let (skeleton, units) = Figure::new(Moves::Still, 20.0, 6).record(&LIMBS[..1]);
    assert_eq!(synchronize(&skeleton, &units).units[0].alignment, Err(Refusal::UnitStill));
}

#[test]
fn a_clock_that_counts_from_its_own_start_is_found_by_jumps_and_refused_without() {
    for (moves, is_found) in [(Moves::JumpsThenKicks, true), (Moves::Kicks, false)] {
        let mut figure = Figure::new(moves, 30.0, 8);
        for (_, clock) in &mut figure.clocks {
            *clock = Clock { offset_s: -86_400.0, drift: 50e-6, origin_s: 86_400.0 };
        }
        let (skeleton, units) = figure.record(&LIMBS[1..2]);
        let found = &synchronize(&skeleton, &units).units[0];
        if is_found {
            assert!(error_ms(found, &figure, &units[0]) < 5.0);
        } else {
            assert_eq!(found.alignment, Err(Refusal::NoOverlap));
        }
    }
}

#[test]
fn damaged_units_are_refused_or_named() {
    let figure = Figure::new(Moves::JumpsThenKicks, 30.0, 9);
    let (skeleton, units) = figure.record(&LIMBS[1..2]);
    let mut backwards = units[0].clone();
    backwards.time_ns.reverse();
    let mut short = InertialSensor::new(Segment::LeftThigh);
    short.time_ns = vec![0];
    let mut constant = units[0].clone();
    let reading = constant.acceleration[0];
    constant.acceleration.fill(reading);
    let found = synchronize(&skeleton, &[backwards, short, constant.clone()]).units;
    assert_eq!(found[0].alignment, Err(Refusal::ClockRunsBackwards));
    assert_eq!(found[1].alignment, Err(Refusal::TooShort));
    assert!(found[2].accelerometer_is_constant && error_ms(&found[2], &figure, &constant) < 8.0);
    let nothing = synchronize(&SkeletonRecording::default(), &units).units;
    assert_eq!(nothing[0].alignment, Err(Refusal::TooShort));
}

#[test]
fn a_unit_whose_segment_the_camera_does_not_see_is_aligned_by_another_unit() {
    let figure = Figure::new(Moves::JumpsThenKicks, 30.0, 10);
    let (mut skeleton, units) = figure.record(&[Segment::RightThigh, Segment::RightShank]);
    let ankle = skeleton.column(Joint::RightAnkle).expect("a column");
    let n = skeleton.joints.len();
    for t in 0..skeleton.len() {
        skeleton.positions[t * n + ankle] = Vector3::repeat(f64::NAN);
        skeleton.confidence[t * n + ankle] = 0.0;
    }
    let found = &synchronize(&skeleton, &units).units[1];
    assert_eq!(found.alignment.expect("aligned").by, Some(Segment::RightThigh));
    // Force alone, and that of another segment: a frame of the camera.
    assert!(error_ms(found, &figure, &units[1]) < 33.0);
}

#[test]
fn exchanged_units_are_named_and_right_ones_are_not() {
    let figure = Figure::new(Moves::JumpsThenKicks, 60.0, 11);
    let (skeleton, mut units) = figure.record(&[Segment::LeftThigh, Segment::RightThigh, Segment::LeftForearm]);
    assert_eq!(assignment_doubts(&skeleton, &units, &synchronize(&skeleton, &units)), []);
    units[0].segment = Segment::RightThigh;
    units[1].segment = Segment::LeftThigh;
    let doubts = assignment_doubts(&skeleton, &units, &synchronize(&skeleton, &units));
    assert_eq!(doubts.len(), 1);
    assert_eq!(doubts[0].segments, [Segment::RightThigh, Segment::LeftThigh]);
    assert!((0..2).all(|i| doubts[0].exchanged[i] > doubts[0].as_declared[i]));
}

/// Four seconds of a unit at rest, of which the gyroscope shows a sway of so many °/s.
fn resting(segment: Segment, up: Vector3<f64>, sway_deg_s: f64) -> InertialSensor {
    let mut rng = ChaCha8Rng::seed_from_u64(segment as u64);
    let mut noise = |sd: f64| Vector3::from_fn(|_, _| sd * rng.sample::<f64, _>(StandardNormal));
    let mut unit = InertialSensor::new(segment);
    for i in 0..1024 {
        let t = f64::from(i) / 256.0;
        unit.time_ns.push((t * 1e9) as i64);
        unit.acceleration.push(up * 9.81 + noise(0.05));
        let sway = Vector3::x() * (sway_deg_s.to_radians() * (2.0 * t).sin());
        unit.angular_rate.push(Vector3::new(0.01, -0.02, 0.005) + sway + noise(0.005));
    }
    unit
}

#[test]
fn a_plank_is_told_from_a_person_who_stands() {
    let clock = ClockMap { reference_ns: 0, offset_s: 1.0, drift_ppm: 0.0, offset_sd_s: 0.0, drift_sd_ppm: 0.0 };
    let alignment =
        Alignment { clock, residual_s: 0.0, n_windows: 1, has_jumps: true, drift_is_measured: false, by: None };
    let found = |ups: [Vector3<f64>; 2], sway: f64| {
        let units = [resting(Segment::LeftThigh, ups[0], sway), resting(Segment::LeftShank, ups[1], sway)];
        let of_unit = |unit: &InertialSensor| UnitClock {
            segment: unit.segment,
            alignment: Ok(alignment),
            accelerometer_is_constant: false,
        };
        common_rest(&units, &Synchronization { units: units.iter().map(of_unit).collect() }).expect("a rest")
    };
    let (up, tilted) = (Vector3::z(), Vector3::new(0.0, 0.3, 1.0).normalize());
    let plank = found([up, up], 0.0);
    assert_eq!(plank.support, Support::Plank);
    assert!(plank.camera_ns.start >= 1_000_000_000 && plank.camera_ns.end <= 5_000_000_000);
    assert!((plank.units[0].angular_rate - Vector3::new(0.01, -0.02, 0.005)).norm() < 0.001);
    assert_eq!(found([up, tilted], 0.0).support, Support::Apart);
    assert_eq!(found([up, up], 0.3).support, Support::Apart);
    assert_eq!(found([up, up], 0.11).support, Support::Undecidable);
}
