//! What knowledge of the body beside the recording is used for, and what it is worth.

use crate::support::{cut, lose, mean_absolute_error, series};
use surefoot::assessment::series::FLAG_BRIDGED;
use surefoot::assessment::{Assessment, CalibrationChoice, JointAngleSettings, Settings};
use surefoot::body::{Joint, Limb, Skeleton};
use surefoot::pipeline::joint_angles::body_knowledge::{SEGMENT_COUNT, lengths_of, segment_names};
use surefoot::pipeline::{Inputs, PatientCalibration, PipelineError, assess, assess_with};
use surefoot::progress::Monitor;
use surefoot::recording::Recording;
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};
use uuid::Uuid;

const STATURE_M: f64 = 1.68;

/// A recording that says nothing of the body.
fn unknown(exercise: Exercise, preset: Preset, seed: u64) -> Recording {
    let settings = SimulationSettings {
        stature_m: STATURE_M,
        duration_s: 20.0,
        ..SimulationSettings::new(exercise, preset, seed)
    };
    let mut recording = simulate(&settings).expect("settings in range").recording;
    recording.header.subject_height_m = None;
    recording
}

fn true_lengths() -> [f64; SEGMENT_COUNT] {
    lengths_of(&Skeleton::of_stature(STATURE_M))
}

fn with_lengths(mut recording: Recording, lengths: [f64; SEGMENT_COUNT]) -> Recording {
    recording.header.segment_lengths_m = segment_names().into_iter().zip(lengths).collect();
    recording
}

fn with_stature(mut recording: Recording) -> Recording {
    recording.header.subject_height_m = Some(STATURE_M);
    recording
}

fn assessed(recording: &Recording) -> Assessment {
    assess(recording, &Settings::default(), &Monitor::default()).expect("an assessment")
}

fn codes(found: &Assessment) -> Vec<&str> {
    found.quality.warnings.iter().map(|warning| warning.code.as_str()).collect()
}

fn lengths(found: &Assessment) -> Vec<f64> {
    found.quality.calibration.as_ref().expect("a calibration").segments.iter().map(|segment| segment.length_m).collect()
}

/// Root mean square difference from the true lengths, metres.
fn length_error(found: &Assessment) -> f64 {
    let squares = lengths(found).iter().zip(true_lengths()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    (squares / SEGMENT_COUNT as f64).sqrt()
}

/// Mean absolute errors of a set of recordings: lengths in millimetres (root mean square), hip and knee flexion in degrees.
fn errors(recordings: &[(Recording, Recording)]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (recording, truth) in recordings {
        let found = assessed(recording);
        sums[0] += 1e6 * length_error(&found).powi(2);
        for (sum, angle) in sums[1..].iter_mut().zip(["hip_flexion_deg", "knee_flexion_deg"]) {
            for side in ["left", "right"] {
                *sum += 0.5 * mean_absolute_error(&found, truth, &format!("{side}_{angle}"));
            }
        }
    }
    let n = recordings.len() as f64;
    [(sums[0] / n).sqrt(), sums[1] / n, sums[2] / n]
}

fn all_exercises(preset: Preset, part_s: Option<(f64, f64)>) -> Vec<(Recording, Recording)> {
    let mut all = Vec::new();
    for exercise in Exercise::ALL {
        for seed in 1..=4 {
            let whole = unknown(exercise, preset, seed);
            let part = part_s.map_or_else(|| whole.clone(), |(from_s, to_s)| cut(whole.clone(), from_s, to_s));
            all.push((part, whole));
        }
    }
    all
}

#[test]
fn known_lengths_bring_the_lengths_nearer_to_the_truth() {
    println!("| noise | part | known | lengths, mm | hip flexion, ° | knee flexion, ° |");
    for preset in [Preset::Table1, Preset::KinectV2] {
        for (name, part_s) in [("20 s", None), ("5.0 to 5.6 s", Some((5.0, 5.6)))] {
            let bare = all_exercises(preset, part_s);
            let changed = |change: &dyn Fn(Recording) -> Recording| {
                bare.iter().map(|(part, whole)| (change(part.clone()), whole.clone())).collect::<Vec<_>>()
            };
            let show = |known: &str, [length, hip, knee]: [f64; 3]| {
                println!("| {preset} | {name} | {known} | {length:.1} | {hip:.2} | {knee:.2} |");
                length
            };
            let own = show("nothing", errors(&bare));
            let stature = show("stature", errors(&changed(&with_stature)));
            let given = show("lengths", errors(&changed(&|r| with_lengths(r, true_lengths()))));
            assert!(given < own, "{preset} {name}: {given} mm against {own}");
            match part_s {
                None => assert!((stature - own).abs() < 1e-9, "a long recording needs no stature"),
                Some(_) => assert!(stature < own, "{preset} {name}: {stature} mm against {own}"),
            }
        }
    }
}

#[test]
fn the_stated_uncertainty_of_a_length_is_of_the_size_of_its_error() {
    for preset in [Preset::Table1, Preset::KinectV2] {
        let (mut errors, mut stated, mut n) = (0.0, 0.0, 0.0);
        for (recording, _) in all_exercises(preset, None) {
            let quality = assessed(&recording).quality.calibration.unwrap();
            for (segment, truth) in quality.segments.iter().zip(true_lengths()) {
                errors += (segment.length_m - truth).powi(2);
                stated += segment.uncertainty_m.unwrap().powi(2);
                n += 1.0;
            }
        }
        let (error, stated) = ((errors / n).sqrt(), (stated / n).sqrt());
        println!("{preset}: error {:.1} mm, stated {:.1} mm", 1e3 * error, 1e3 * stated);
        // The slow offset is one number for every joint and sensor, so a factor of two either way.
        assert!((0.5..2.0).contains(&(stated / error)), "{preset}: error {error}, stated {stated}");
    }
}

#[test]
fn stature_is_not_asked_where_the_recording_shows_enough() {
    let recording = unknown(Exercise::Step, Preset::Table1, 1);
    assert_eq!(assessed(&recording).series, assessed(&with_stature(recording)).series);
}

#[test]
fn a_limb_that_is_never_seen_whole_takes_stature_and_without_it_the_recording_is_refused() {
    let hidden = lose(unknown(Exercise::BackKnee, Preset::Table1, 1), Joint::LeftHand, 0.0, 99.0);
    match assess(&hidden, &Settings::default(), &Monitor::default()) {
        Err(PipelineError::Unsuitable { code, .. }) => assert_eq!(code, "too_few_frames"),
        other => panic!("not refused: {:?}", other.map(|a| a.quality)),
    }
    let found = assessed(&with_stature(hidden.clone()));
    assert!(codes(&found).contains(&"segments_not_measured"), "{:?}", found.quality.warnings);
    let quality = found.quality.calibration.as_ref().unwrap();
    assert_eq!(quality.source, "incomplete_recording");
    assert_eq!(quality.knowledge, ["stature"]);
    let forearm = &quality.segments[1];
    assert_eq!((forearm.segment.as_str(), forearm.measured_m, forearm.spread_m), ("left_forearm", None, None));
    assert!((forearm.length_m - 0.146 * STATURE_M).abs() < 1e-12);
    assert!(quality.segments[4].measured_m.is_some());
    assert!(series(&found, "left_elbow_flexion_deg").flags.iter().all(|flags| flags & FLAG_BRIDGED != 0));
    let truth = unknown(Exercise::BackKnee, Preset::Table1, 1);
    // As with all joints seen (main.rs), since the legs are.
    assert!(mean_absolute_error(&found, &truth, "right_knee_flexion_deg") < 5.0);
    // One given length is as good as a stature, for the one segment that lacks.
    let mut given = hidden;
    given.header.segment_lengths_m.insert("left_forearm".into(), 0.25);
    assert_eq!(assessed(&given).quality.calibration.unwrap().knowledge, ["segment_lengths"]);
}

#[test]
fn a_whole_leg_or_arm_may_be_missing() {
    for joints in [[Joint::LeftKnee, Joint::LeftFoot], [Joint::RightElbow, Joint::RightHand]] {
        let whole = with_stature(unknown(Exercise::BackKnee, Preset::Table1, 2));
        let hidden = joints.into_iter().fold(whole, |recording, joint| lose(recording, joint, 0.0, 99.0));
        let found = assessed(&hidden);
        assert!(codes(&found).contains(&"segments_not_measured"));
        assert!(found.series.iter().all(|s| s.value.iter().all(|value| value.is_finite())));
    }
}

#[test]
fn a_trunk_that_is_never_seen_is_refused_whatever_is_known() {
    let whole = with_lengths(with_stature(unknown(Exercise::BackKnee, Preset::Table1, 1)), true_lengths());
    let hidden = lose(whole, Joint::LeftHip, 0.0, 99.0);
    let refused = assess(&hidden, &Settings::default(), &Monitor::default()).unwrap_err();
    assert!(matches!(refused, PipelineError::Unsuitable { code: "too_few_frames", .. }), "{refused}");
}

#[test]
fn lengths_that_contradict_the_recording_and_differ_by_side_are_told() {
    let mut lengths = true_lengths();
    lengths[2 * Limb::LeftLeg.index()] += 0.15;
    let found = assessed(&with_lengths(unknown(Exercise::Step, Preset::Table1, 1), lengths));
    let told = |code: &str| found.quality.warnings.iter().find(|w| w.code == code).unwrap().message.clone();
    assert!(told("body_contradicted").contains("left_thigh"), "{}", told("body_contradicted"));
    let sides = told("asymmetric_segments");
    assert!(sides.contains("left_thigh 0.") && sides.contains("right_thigh 0."), "{sides}");
}

fn patients(recording: &Recording, earlier: Option<&Assessment>, choice: CalibrationChoice) -> Assessment {
    let patient_calibration = earlier.map(|earlier| PatientCalibration {
        assessment_id: Uuid::from_u128(7),
        quality: earlier.quality.calibration.clone().expect("a calibration"),
    });
    let settings = Settings::JointAngles(JointAngleSettings { calibration: choice, ..JointAngleSettings::default() });
    let inputs = Inputs { patient_calibration, ..Inputs::default() };
    assess_with(recording, &settings, &inputs, &Monitor::default()).expect("an assessment")
}

#[test]
fn a_patients_calibration_lies_between_both_recordings_and_is_named_and_asked_for() {
    let earlier = assessed(&unknown(Exercise::SideHip, Preset::KinectV2, 3));
    let recording = unknown(Exercise::Step, Preset::KinectV2, 4);
    let own = assessed(&recording);
    let found = patients(&recording, Some(&earlier), CalibrationChoice::Patient);
    let quality = found.quality.calibration.as_ref().unwrap();
    assert_eq!(quality.knowledge, ["patient"]);
    assert_eq!(quality.patient_assessment_id, Some(Uuid::from_u128(7)));
    assert_eq!(found.provenance.patient_assessment_id, Some(Uuid::from_u128(7)));
    for ((fused, own), earlier) in lengths(&found).iter().zip(lengths(&own)).zip(lengths(&earlier)) {
        assert!((own.min(earlier)..=own.max(earlier)).contains(fused), "{own} and {earlier} give {fused}");
    }
    let mut n_fused = 0;
    for (segment, own) in quality.segments.iter().zip(lengths(&own)) {
        assert_eq!(segment.measured_m, Some(own));
        // A length that contradicts the recording is left out.
        n_fused += usize::from(segment.uncertainty_m < segment.measured_uncertainty_m);
    }
    assert!(n_fused >= 7, "{:#?}", quality.segments);
    // Not asked for, it is not used; asked for and not there, the result is the recording's own, with a warning.
    assert_eq!(patients(&recording, Some(&earlier), CalibrationChoice::Recording), own);
    let without = patients(&recording, None, CalibrationChoice::Patient);
    assert_eq!(without.series, own.series);
    assert!(codes(&without).contains(&"no_patient_calibration"));
}
