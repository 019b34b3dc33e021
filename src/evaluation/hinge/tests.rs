use super::*;
use crate::pipeline::skeleton_fusion::hinge::StandingZero;
use crate::recording::{InertialSensor, Segment};

/// A knee that stands for 10 samples at 5° and then bends; the reference is at 100 per second.
fn trial() -> HingeTrial {
    let reference = (0..100).map(|i: i32| (5.0 + f64::from((i - 10).max(0))).to_radians()).collect();
    HingeTrial {
        set: "set".into(),
        name: "knee".into(),
        units: [Segment::LeftThigh, Segment::LeftShank].map(InertialSensor::new),
        reference_time_ns: (0..100).map(|i| i * 10_000_000).collect(),
        reference,
        has_sense: true,
    }
}

fn estimate(of: impl Fn(f64) -> f64) -> HingeAngles {
    let trial = trial();
    let n = trial.reference.len();
    HingeAngles {
        time_ns: trial.reference_time_ns.clone(),
        flexion: trial.reference.iter().map(|angle| of(*angle)).collect(),
        flexion_sd: vec![0.01; n],
        heading: vec![0.0; n],
        heading_sd: vec![0.0; n],
        standing: Some(StandingZero { stretches: std::iter::once(0..10).collect(), sd: 0.1 }),
    }
}

#[test]
fn a_constant_offset_counts_only_in_the_absolute_error() {
    let found = errors(&trial(), &estimate(|angle| angle - 5.0_f64.to_radians())).unwrap();
    assert!(found.offset_free_deg < 1e-9 && found.from_standing_deg.unwrap() < 1e-9, "{found:?}");
    assert!((found.absolute_deg.unwrap() - 5.0).abs() < 1e-9 && (found.correlation - 1.0).abs() < 1e-9);
    assert_eq!((found.n_samples, found.held), (100, 1.0));
}

#[test]
fn a_gain_counts_from_standing_more_than_without_an_offset() {
    let found = errors(&trial(), &estimate(|angle| 1.1 * angle)).unwrap();
    assert!(found.from_standing_deg.unwrap() > 1.5 * found.offset_free_deg, "{found:?}");
}

#[test]
fn the_wrong_sense_is_an_error_of_a_knee_and_none_of_a_link() {
    let estimate = estimate(|angle| -angle);
    assert!(errors(&trial(), &estimate).unwrap().correlation < -0.99);
    let link = HingeTrial { has_sense: false, ..trial() };
    assert!(errors(&link, &estimate).unwrap().offset_free_deg < 1e-9);
}

#[test]
fn without_a_common_instant_there_are_no_errors() {
    let mut trial = trial();
    trial.reference.fill(f64::NAN);
    assert_eq!(errors(&trial, &estimate(|angle| angle)), None);
}
