//! The catalogue on simulated exercises, whose truth is known, and on recordings that are none of it.

use crate::assessment::{Assessment, Performance, PerformanceStatus, Series, Settings};
use crate::pipeline::assess;
use crate::progress::Monitor;
use crate::protocol::{PROTOCOLS, ProtocolKind, ProtocolSensor, find, perform, recognize};
use crate::recording::Recording;
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};
use std::collections::HashSet;

fn assessment(recording: &Recording) -> Assessment {
    let settings = Settings::JointAngles(Default::default());
    assess(recording, &settings, &Monitor::default()).expect("an assessment")
}

fn exercise(kind: Exercise, preset: Preset, seed: u64) -> Assessment {
    assessment(&simulate(&SimulationSettings::new(kind, preset, seed)).expect("settings in range").recording)
}

fn measure<'a>(performance: &'a Performance, name: &str) -> &'a crate::assessment::PerformanceMeasure {
    performance.measures.iter().find(|measure| measure.name == name).expect("the measure")
}

#[test]
fn every_protocol_has_a_name_of_its_own_and_says_what_to_do_and_what_is_measured() {
    let mut names = HashSet::new();
    for protocol in PROTOCOLS {
        for name in [&[protocol.id], protocol.aliases].concat() {
            assert!(names.insert(name), "{name} is there twice");
            assert_eq!(find(name).map(|found| found.id), Some(protocol.id));
        }
        assert!(!protocol.instructions.is_empty() && !protocol.method.is_empty() && !protocol.title.is_empty());
        let of_tests = protocol.kind == ProtocolKind::Test && protocol.sensor == ProtocolSensor::Skeleton;
        assert!(!of_tests || !protocol.source.is_empty() || protocol.id == "walk", "{} has no source", protocol.id);
    }
    assert!(find("no_such_thing").is_none());
}

/// Whole repetitions that fit between the arms' coming down (3.4 s; sitting down takes 2.8 s more) and 0.3 s before the end.
fn expected_repetitions(kind: Exercise, slowness: f64) -> usize {
    let (period_s, prelude_s) = match kind {
        Exercise::BackKnee => (3.4, 0.0),
        Exercise::SitFrontKnee => (3.2, 2.4 * slowness + 0.4),
        Exercise::SideHip => (3.6, 0.0),
        _ => (3.8, 0.0),
    };
    ((16.3 - prelude_s) / (period_s * slowness)) as usize
}

#[test]
fn simulated_exercises_are_recognised_and_their_repetitions_counted() {
    for kind in [Exercise::BackKnee, Exercise::SitFrontKnee, Exercise::SideHip, Exercise::Step] {
        for seed in 1..=2 {
            let settings = SimulationSettings::new(kind, Preset::KinectV2, seed);
            let simulation = simulate(&settings).expect("settings in range");
            let found = perform(Some(kind.name()), &assessment(&simulation.recording));
            assert_eq!(found.status, PerformanceStatus::Measured, "{kind} {seed}: {}", found.reason);
            let complete = found.repetitions.iter().filter(|repetition| repetition.is_complete).count();
            // The subject's own tempo fills the 16.3 s after the arms came down.
            let expected = expected_repetitions(kind, simulation.subject.slowness);
            assert_eq!(complete, expected, "{kind} {seed}");
            // The sides take turns.
            assert!(found.repetitions.windows(2).all(|pair| pair[0].side != pair[1].side), "{kind} {seed}");
        }
    }
}

#[test]
fn a_near_tandem_stand_is_held_from_the_second_step_to_the_end() {
    let found = perform(Some("near_tandem"), &exercise(Exercise::NearTandem, Preset::KinectV2, 1));
    assert_eq!(found.status, PerformanceStatus::Measured, "{}", found.reason);
    let hold = measure(&found, "near_tandem_hold_s");
    // Both steps last 1.3 s at normal tempo and end about 6.6 s after the start, ± 12 % with the subject's tempo.
    assert!(hold.value.is_some_and(|seconds| (12.0..15.2).contains(&seconds)), "{hold:?}");
    assert!(hold.reason.contains("may have been longer") && hold.reason.contains("closed eyes"), "{}", hold.reason);
    assert!(measure(&found, "trunk_sway_path_m").value.is_some_and(|path| path > 0.0));
}

#[test]
fn an_exercise_declared_as_another_one_gets_no_numbers() {
    for kind in Exercise::ALL {
        let assessment = exercise(kind, Preset::KinectV2, 2);
        let recognized = recognize(&assessment);
        assert!(recognized.contains(&kind.name()), "{kind}: {recognized:?}");
        for protocol in PROTOCOLS.iter().filter(|protocol| !recognized.contains(&protocol.id)) {
            let found = perform(Some(protocol.id), &assessment);
            assert_ne!(found.status, PerformanceStatus::Measured, "{kind} as {}", protocol.id);
            assert!(found.measures.is_empty() && !found.reason.is_empty(), "{kind} as {}", protocol.id);
        }
    }
}

#[test]
fn without_a_protocol_of_the_catalogue_it_is_told_what_the_movement_looks_like() {
    let assessment = exercise(Exercise::SideHip, Preset::KinectV2, 1);
    for declared in [None, Some("juggling")] {
        let found = perform(declared, &assessment);
        assert_eq!((found.status, found.protocol_version), (PerformanceStatus::NotMeasured, None));
        assert_eq!(found.recognized, ["side_hip"]);
        assert!(found.reason.contains("side_hip") && found.measures.is_empty(), "{}", found.reason);
    }
}

#[test]
fn legs_that_were_hardly_seen_are_not_measured() {
    let mut assessment = exercise(Exercise::BackKnee, Preset::KinectV2, 1);
    for series in &mut assessment.series {
        hide(series);
    }
    let found = perform(Some("back_knee"), &assessment);
    assert_eq!(found.status, PerformanceStatus::NotMeasured);
    assert!(found.reason.contains("keep the whole body in view") && found.measures.is_empty(), "{}", found.reason);
}

fn hide(series: &mut Series) {
    series.flags.iter_mut().for_each(|flags| *flags |= crate::assessment::series::FLAG_BRIDGED);
}

#[test]
fn a_single_repetition_has_no_symmetry_tempo_or_standard_error() {
    let settings =
        SimulationSettings { duration_s: 8.0, ..SimulationSettings::new(Exercise::BackKnee, Preset::KinectV2, 1) };
    let recording = simulate(&settings).expect("settings in range").recording;
    let found = perform(Some("back_knee"), &assessment(&recording));
    assert_eq!(found.status, PerformanceStatus::Measured, "{}", found.reason);
    for name in ["tempo_per_min", "range_of_motion_symmetry_ratio"] {
        let measure = measure(&found, name);
        assert!(measure.value.is_none() && !measure.reason.is_empty(), "{measure:?}");
    }
    assert_eq!(measure(&found, "range_of_motion_deg").standard_error, None);
}
