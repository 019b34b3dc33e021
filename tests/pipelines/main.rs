//! Whole pipelines on recordings with known truth.

mod body;
mod events;
mod fusion;
mod live;
mod model_methods;
mod support;
mod training;
mod walker;

use support::{centimetres, exercise, mean_absolute_error, mirrored, series, without};
use surefoot::assessment::series::FLAG_BRIDGED;
use surefoot::assessment::{JointAngleSettings, Method, Settings};
use surefoot::body::Joint;
use surefoot::pipeline::{PipelineError, assess};
use surefoot::progress::Monitor;
use surefoot::recording::Recording;
use surefoot::synthetic::{Exercise, Preset};

fn settings(method: Method, seed: u64) -> Settings {
    Settings::JointAngles(JointAngleSettings { method, seed, particles: Some(128), ..JointAngleSettings::default() })
}

fn refusal(recording: &Recording, method: Method) -> (&'static str, String) {
    match assess(recording, &settings(method, 1), &Monitor::default()) {
        Err(PipelineError::Unsuitable { code, sentence, .. }) => (code, sentence),
        other => panic!("not refused: {:?}", other.map(|a| a.quality)),
    }
}

#[test]
fn the_default_follows_every_exercise_under_the_papers_noise() {
    // Twice the mean error that docs/measurements.md shows, since this is one subject for each exercise.
    let limits = [("hip_flexion_deg", 3.0), ("hip_abduction_deg", 1.5), ("knee_flexion_deg", 5.0)];
    for kind in Exercise::ALL {
        let recording = exercise(kind, Preset::Table1, 20.0);
        let found = assess(&recording, &Settings::default(), &Monitor::default()).unwrap();
        for (suffix, limit) in limits {
            for side in ["left", "right"] {
                let channel = format!("{side}_{suffix}");
                let error = mean_absolute_error(&found, &recording, &channel);
                assert!(error < limit, "{kind} {channel}: {error} degrees");
            }
        }
    }
}

#[test]
fn intervals_hold_the_truth_under_white_noise_and_under_slow_offsets() {
    for preset in [Preset::Table1, Preset::KinectV2] {
        let (mut inside, mut all) = (0.0, 0.0);
        for kind in Exercise::ALL {
            let recording = exercise(kind, preset, 20.0);
            let found = assess(&recording, &Settings::default(), &Monitor::default()).unwrap();
            for side in ["left", "right"] {
                for angle in ["hip_flexion_deg", "knee_flexion_deg"] {
                    let estimate = series(&found, &format!("{side}_{angle}"));
                    for (i, truth) in support::truth_at(&recording, &estimate.channel, &found.time_ns) {
                        let holds = f64::from(estimate.low[i]) <= truth && truth <= f64::from(estimate.high[i]);
                        inside += f64::from(u8::from(holds));
                        all += 1.0;
                    }
                }
            }
        }
        // One subject: his own constant offset may take several points from the share over many subjects.
        assert!(inside / all > 0.8, "{preset}: {}", inside / all);
    }
}

#[test]
fn the_same_recording_settings_and_seed_give_the_same_bits_on_any_number_of_threads() {
    let recording = exercise(Exercise::Step, Preset::Failures, 6.0);
    for method in Method::ALL {
        let on = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| assess(&recording, &settings(method, seed), &Monitor::default())).unwrap();
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            found.series.iter().map(|s| (bits(&s.value), bits(&s.low), s.flags.clone())).collect::<Vec<_>>()
        };
        assert_eq!(on(1, 1), on(3, 1), "{method}");
        assert_eq!(
            on(1, 1) != on(1, 2),
            method.has_particles(),
            "only methods with particles depend on the seed, not {method}"
        );
    }
}

#[test]
fn a_mirrored_recording_is_refused_because_knees_bend_backwards() {
    let recording = mirrored(exercise(Exercise::BackKnee, Preset::Clean, 20.0));
    let (code, sentence) = refusal(&recording, Method::Iekf);
    assert_eq!(code, "handedness_mismatch");
    assert!(sentence.contains("handedness"), "{sentence}");
}

#[test]
fn positions_in_centimetres_are_refused_as_no_human_body() {
    let recording = centimetres(exercise(Exercise::BackKnee, Preset::Clean, 8.0));
    assert_eq!(refusal(&recording, Method::Iekf).0, "implausible_body");
}

#[test]
fn a_recording_without_knees_is_refused_by_name() {
    let recording = without(exercise(Exercise::BackKnee, Preset::Clean, 8.0), Joint::LeftKnee);
    let (code, sentence) = refusal(&recording, Method::Iekf);
    assert_eq!(code, "joints_missing");
    assert!(sentence.contains("left_knee"), "{sentence}");
}

#[test]
fn a_recording_without_frames_is_refused() {
    assert_eq!(refusal(&Recording::default(), Method::Iekf).0, "no_skeleton");
}

#[test]
fn the_middlewares_method_needs_its_orientations() {
    let mut recording = exercise(Exercise::BackKnee, Preset::Clean, 8.0);
    recording.skeleton.as_mut().unwrap().orientations.clear();
    assert_eq!(refusal(&recording, Method::Nite).0, "no_orientations");
}

#[test]
fn a_static_start_calibrates_and_its_absence_is_flagged() {
    let resting = exercise(Exercise::SideHip, Preset::Table1, 12.0);
    let found = assess(&resting, &Settings::default(), &Monitor::default()).unwrap();
    assert_eq!(found.quality.calibration.unwrap().source, "static_window");
    assert!(found.quality.warnings.is_empty(), "{:?}", found.quality.warnings);

    let moving = support::cut(resting, 2.2, 3.1);
    let found = assess(&moving, &Settings::default(), &Monitor::default()).unwrap();
    assert_eq!(found.quality.calibration.unwrap().source, "whole_recording");
    assert_eq!(found.quality.warnings[0].code, "no_static_window");
}

#[test]
fn a_lost_ankle_is_bridged_flagged_and_widens_the_interval() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 12.0);
    let lost = support::lose(recording, Joint::RightFoot, 5.0, 6.0);
    let found = assess(&lost, &Settings::default(), &Monitor::default()).unwrap();
    let knee = series(&found, "right_knee_flexion_deg");
    let at = |seconds: f64| found.time_ns.iter().position(|t| *t as f64 * 1e-9 >= seconds).unwrap();
    let width = |t: usize| knee.high[t] - knee.low[t];
    assert_eq!(knee.flags[at(5.5)] & FLAG_BRIDGED, FLAG_BRIDGED);
    assert_eq!(knee.flags[at(4.5)] & FLAG_BRIDGED, 0);
    assert!(knee.value[at(5.5)].is_finite() && width(at(5.5)) > 1.5 * width(at(4.5)));
    assert!(found.quality.coverage < 0.95);
}

#[test]
fn a_cancelled_assessment_ends_without_a_result() {
    let monitor = Monitor::default();
    monitor.cancel();
    let recording = exercise(Exercise::BackKnee, Preset::Clean, 8.0);
    assert_eq!(assess(&recording, &Settings::default(), &monitor), Err(PipelineError::Cancelled));
}

#[test]
fn the_papers_filter_reports_how_few_particles_count() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 8.0);
    let found = assess(&recording, &settings(Method::Particle, 1), &Monitor::default()).unwrap();
    let size = found.quality.effective_sample_size.unwrap();
    assert_eq!(size.particles, 128);
    assert!((1.0..40.0).contains(&size.median) && size.min >= 1.0, "{size:?}");
}
