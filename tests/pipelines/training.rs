//! Noise models: training on recordings with known noise, and assessments that rest on a named model.

use crate::support::{exercise, mean_absolute_error};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::PathBuf;
use surefoot::assessment::noise_model::{NITE_TABLE1, find_shipped, nite_table1};
use surefoot::assessment::{JointAngleSettings, Method, NoiseModel, Settings};
use surefoot::body::{Joint, Limb};
use surefoot::pipeline::joint_angles::training::{RecordingIdentity, Trainer};
use surefoot::pipeline::{Inputs, PipelineError, assess, assess_with};
use surefoot::progress::Monitor;
use surefoot::recording::import::{Dataset, list};
use surefoot::recording::{Recording, SkeletonRecording};
use surefoot::synthetic::sensor::white_noise;
use surefoot::synthetic::{Exercise, Preset};

fn identity(name: &str) -> RecordingIdentity {
    RecordingIdentity { name: name.into(), sha256: "0".repeat(64) }
}

/// A subject in the T-posture before a sensor with the white noise of Table 1.
fn standing(seconds: usize, seed: u64) -> Recording {
    let mut recording = exercise(Exercise::BackKnee, Preset::Clean, 8.0);
    let skeleton = recording.skeleton.as_mut().expect("a skeleton");
    let (frame, n) = (skeleton.frame(0).to_vec(), 30 * seconds);
    *skeleton = SkeletonRecording {
        joints: skeleton.joints.clone(),
        time_ns: (0..n as i64).map(|t| t * 33_333_333).collect(),
        positions: (0..n).flat_map(|_| frame.clone()).collect(),
        confidence: vec![1.0; n * frame.len()],
        orientations: Vec::new(),
    };
    recording.references.clear();
    white_noise::add(skeleton, white_noise::table1_sd_mm, &mut ChaCha8Rng::seed_from_u64(seed));
    recording
}

fn trained(still: &[Recording], movement: &[Recording]) -> Result<NoiseModel, PipelineError> {
    let mut trainer = Trainer::default();
    for recording in still {
        trainer.add_static(identity("still"), recording, &Monitor::default())?;
    }
    for recording in movement {
        trainer.add_movement(identity("movement"), recording, &Monitor::default())?;
    }
    trainer.finish("ward-3", "a test")
}

fn refusal(still: &[Recording], movement: &[Recording]) -> (&'static str, String) {
    match trained(still, movement) {
        Err(PipelineError::Unsuitable { code, sentence, .. }) => (code, sentence),
        other => panic!("not refused: {:?}", other.map(|model| model.name())),
    }
}

#[test]
fn training_finds_the_white_noise_of_table_1_in_static_recordings() {
    let model = trained(&[standing(20, 1), standing(20, 2), standing(20, 3)], &[]).unwrap();
    // 1620 degrees of freedom and their mirror image: a standard error of 1.3 to 1.8 %.
    const TOLERANCE: f64 = 0.06;
    for point in &model.document().points {
        let joint = if point.point == Joint::LeftAnkle { Joint::LeftFoot } else { point.point };
        let truth = white_noise::table1_sd_mm(joint);
        for axis in 0..3 {
            let ratio = point.white_sd_mm[axis] / truth[axis];
            assert!((ratio - 1.0).abs() < TOLERANCE, "{} axis {axis}: {ratio}", point.point);
        }
    }
    let training = model.document().training.as_ref().unwrap();
    assert!(training.white_s >= 54.0, "{}", training.white_s);
    assert_eq!(training.transition_source, NITE_TABLE1);
    assert_eq!(model.document().transition_sd_deg, nite_table1().document().transition_sd_deg);
    assert!(model.observation.cholesky().is_some());
}

#[test]
fn the_same_recordings_train_the_same_bytes() {
    let train = || trained(&[standing(10, 1), standing(10, 2)], &[exercise(Exercise::Step, Preset::Table1, 12.0)]);
    let (one, two) = (train().unwrap(), train().unwrap());
    assert_eq!((one.sha256(), &one), (two.sha256(), &two));
}

#[test]
fn turns_of_reference_angles_make_the_prior_and_those_of_estimates_come_close() {
    let still = [standing(10, 1), standing(10, 2)];
    let movement = exercise(Exercise::BackKnee, Preset::Table1, 20.0);
    let mut without = movement.clone();
    without.references.clear();
    let by_reference = trained(&still, &[movement]).unwrap();
    let by_estimate = trained(&still, &[without]).unwrap();
    let source = |model: &NoiseModel| model.document().training.as_ref().unwrap().transition_source.clone();
    assert_eq!((source(&by_reference).as_str(), source(&by_estimate).as_str()), ("reference", "estimate"));
    let knee = |model: &NoiseModel| model.document().transition_sd_deg.knee;
    assert!((knee(&by_estimate) / knee(&by_reference) - 1.0).abs() < 0.2, "{by_estimate:?}");
}

#[test]
fn the_slow_offset_of_a_kinect_v2_is_found_in_centimetres_beside_a_millimetre_of_white_noise() {
    let mut trainer = Trainer::with_white_noise_from_movement();
    for kind in Exercise::ALL {
        trainer.add_movement(identity("m"), &exercise(kind, Preset::KinectV2, 20.0), &Monitor::default()).unwrap();
    }
    let model = trainer.finish("ward-3", "").unwrap();
    let document = model.document();
    assert_eq!(document.training.as_ref().unwrap().leg_offset_source, "reference");
    for level in 0..3 {
        let knee = document.point(Limb::LeftLeg, level).unwrap();
        // The simulated offset has 20 to 56 mm over three coordinates, the jitter 1 mm in each, and the torso's own.
        assert!((8.0..40.0).contains(&knee.slow_offset_sd_mm), "{}", knee.slow_offset_sd_mm);
        for sd in knee.white_sd_mm {
            assert!((0.9..2.0).contains(&sd), "{sd}");
        }
    }
}

#[test]
fn recordings_that_teach_too_little_are_refused_and_told_what_to_record() {
    assert_eq!(refusal(&[standing(20, 1)], &[]).0, "too_few_static_recordings");
    let (code, sentence) = refusal(&[standing(5, 1), standing(5, 2)], &[]);
    assert!(code == "static_too_short" && sentence.contains("twice"), "{sentence}");
    let moving = exercise(Exercise::BackKnee, Preset::Table1, 20.0);
    let (code, sentence) = refusal(&[moving.clone(), moving.clone()], &[]);
    assert!(code == "not_static" && sentence.contains("of 20 s"), "{sentence}");
    let (code, _) = refusal(&[standing(25, 1), moving], &[]);
    assert_eq!(code, "not_static", "one still recording and one moving are not two still ones");
    let short = crate::support::cut(exercise(Exercise::Step, Preset::Table1, 8.0), 0.0, 5.0);
    assert_eq!(refusal(&[standing(10, 1), standing(10, 2)], &[short]).0, "movement_too_short");
}

#[test]
fn a_sensor_that_repeats_its_frames_has_no_noise_to_learn() {
    let mut frozen = standing(12, 1);
    let skeleton = frozen.skeleton.as_mut().unwrap();
    let frame = skeleton.frame(0).to_vec();
    skeleton.positions = (0..skeleton.len()).flat_map(|_| frame.clone()).collect();
    let (code, sentence) = refusal(&[frozen.clone(), frozen], &[]);
    assert!(code == "implausible_noise" && sentence.contains("repeat"), "{sentence}");
}

fn settings(method: Method, noise_model: Option<&str>) -> Settings {
    let noise_model = noise_model.map(str::to_owned);
    Settings::JointAngles(JointAngleSettings {
        method,
        noise_model,
        particles: Some(128),
        ..JointAngleSettings::default()
    })
}

#[test]
fn provenance_names_the_noise_that_an_assessment_rests_on() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 8.0);
    let named = |method, noise_model| {
        let found = assess(&recording, &settings(method, noise_model), &Monitor::default()).unwrap();
        found.provenance.noise_model.map(|model| (model.name, model.version, model.sha256))
    };
    let kinect = find_shipped(&"kinect-v2".parse().unwrap()).unwrap();
    let expected = Some(("kinect-v2".to_owned(), Some(1), Some(kinect.sha256())));
    assert_eq!(named(Method::Iekf, None), Some(("adaptive".into(), None, None)));
    assert_eq!(named(Method::Iekf, Some("kinect-v2")), expected);
    assert_eq!(
        named(Method::Particle, None).map(|(name, version, _)| (name, version)),
        Some((NITE_TABLE1.into(), Some(1)))
    );
    assert_eq!(named(Method::Particle, Some("kinect-v2@1")), expected);
    assert_eq!(named(Method::Ik, None), None);
}

#[test]
fn a_trained_model_changes_the_estimate_and_one_that_is_not_given_is_missed() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 20.0);
    let model = trained(&[standing(10, 1), standing(10, 2)], std::slice::from_ref(&recording)).unwrap();
    let wanted = settings(Method::Iekf, Some("ward-3@1"));
    let inputs = Inputs { noise_model: Some(model.clone()), ..Inputs::default() };
    let found = assess_with(&recording, &wanted, &inputs, &Monitor::default()).unwrap();
    assert_eq!(found.provenance.noise_model, Some(model.reference()));
    let adaptive = assess(&recording, &settings(Method::Iekf, None), &Monitor::default()).unwrap();
    assert_ne!(found.series, adaptive.series);
    let error = |found| mean_absolute_error(found, &recording, "right_knee_flexion_deg");
    // The true noise must not be much worse than what is estimated from the recording.
    assert!(error(&found) < error(&adaptive) + 1.0, "{} against {}", error(&found), error(&adaptive));
    match assess(&recording, &wanted, &Monitor::default()) {
        Err(PipelineError::Unsuitable { code: "noise_model_missing", sentence, .. }) => {
            assert!(sentence.contains("ward-3@1"), "{sentence}");
        }
        other => panic!("{:?}", other.map(|found| found.provenance)),
    }
}

#[test]
fn methods_refuse_noise_models_that_they_cannot_run_on() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 8.0);
    for (method, noise_model) in
        [(Method::Ik, "kinect-v2"), (Method::Particle, "adaptive"), (Method::Iekf, "adaptive@2"), (Method::Iekf, "A B")]
    {
        let refused = assess(&recording, &settings(method, Some(noise_model)), &Monitor::default());
        assert!(
            matches!(refused, Err(PipelineError::Unsuitable { code: "unusable_noise_model", .. })),
            "{method} {noise_model}"
        );
    }
}

#[test]
fn the_shipped_model_of_the_kinect_v2_is_what_its_data_train() {
    let data = std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let Ok(sources) = list(Dataset::Uiprmd, &data) else {
        println!("skipped: no UI-PRMD below {}", data.display());
        return;
    };
    let mut trainer = Trainer::with_white_noise_from_movement();
    for source in sources.iter().filter(|s| s.name.contains("_s01_") || s.name.contains("_s02_")) {
        trainer.add_movement(identity(&source.name), &source.read().unwrap().recording, &Monitor::default()).unwrap();
    }
    let found = trainer.finish("kinect-v2", "").unwrap();
    let shipped = find_shipped(&"kinect-v2".parse().unwrap()).unwrap();
    for (found, shipped) in found.document().points.iter().zip(&shipped.document().points) {
        assert_eq!(found.white_sd_mm, shipped.white_sd_mm, "{}", found.point);
        assert_eq!(found.slow_offset_sd_mm, shipped.slow_offset_sd_mm, "{}", found.point);
    }
    assert_eq!(found.document().correlations, shipped.document().correlations);
}
