//! The methods that share the default's model: its alternatives must follow the same movements, in both passes.

use crate::support::{exercise, lose, lose_all, mean_absolute_error, series};
use surefoot::assessment::{Assessment, JointAngleSettings, Method, Pass, Settings};
use surefoot::body::Joint;
use surefoot::pipeline::assess;
use surefoot::progress::Monitor;
use surefoot::recording::Recording;
use surefoot::synthetic::{Exercise, Preset};

const ALTERNATIVES: [Method; 2] = [Method::Ukf, Method::Guided];

fn assessed(recording: &Recording, method: Method, pass: Pass) -> Assessment {
    let settings = JointAngleSettings { method, pass: Some(pass), ..JointAngleSettings::default() };
    assess(recording, &Settings::JointAngles(settings), &Monitor::default()).expect("an assessment")
}

/// Mean absolute error of hips and knees of both sides, degrees.
fn error(found: &Assessment, recording: &Recording) -> f64 {
    let angles = ["hip_flexion_deg", "hip_abduction_deg", "knee_flexion_deg"];
    let channels = angles.iter().flat_map(|angle| ["left", "right"].map(|side| format!("{side}_{angle}")));
    channels.map(|channel| mean_absolute_error(found, recording, &channel)).sum::<f64>() / 6.0
}

#[test]
fn the_alternatives_are_as_accurate_as_the_default_in_both_passes() {
    for preset in [Preset::Table1, Preset::Failures] {
        for pass in [Pass::Filter, Pass::Smooth] {
            let mut sums = [0.0; 3];
            for kind in [Exercise::SitFrontKnee, Exercise::Step] {
                let recording = exercise(kind, preset, 12.0);
                for (sum, method) in sums.iter_mut().zip([Method::Iekf, Method::Ukf, Method::Guided]) {
                    *sum += error(&assessed(&recording, method, pass), &recording) / 2.0;
                }
            }
            let [default, ukf, guided] = sums;
            // One subject: a tenth either way is chance, and some of `guided` is that of its particles.
            assert!(ukf < 1.1 * default, "{preset} {pass:?}: ukf {ukf}, iekf {default} degrees");
            assert!(guided < 1.15 * default, "{preset} {pass:?}: guided {guided}, iekf {default} degrees");
        }
    }
}

#[test]
fn looking_back_from_the_end_makes_the_alternatives_more_accurate() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 12.0);
    for method in ALTERNATIVES {
        let [filter, smooth] =
            [Pass::Filter, Pass::Smooth].map(|pass| error(&assessed(&recording, method, pass), &recording));
        assert!(smooth < 0.8 * filter, "{method}: {smooth} after {filter} degrees");
    }
}

#[test]
fn a_second_without_any_point_and_a_limb_lost_for_two_are_bridged() {
    let whole = exercise(Exercise::Step, Preset::Table1, 12.0);
    let lost = lose_all(lose(whole.clone(), Joint::LeftFoot, 3.0, 5.0), 7.0, 8.0);
    for method in ALTERNATIVES {
        for pass in [Pass::Filter, Pass::Smooth] {
            let found = assessed(&lost, method, pass);
            for channel in &found.series {
                assert!(channel.value.iter().all(|v| v.is_finite()), "{method} {pass:?}: {}", channel.channel);
            }
            let knee = series(&found, "left_knee_flexion_deg");
            let at = |seconds: f64| found.time_ns.iter().position(|t| *t as f64 * 1e-9 >= seconds).expect("a frame");
            let width = |t: usize| knee.high[t] - knee.low[t];
            assert!(width(at(7.6)) > 1.5 * width(at(6.0)), "{method} {pass:?}");
            // A second after the gap all is as if there had been none.
            let error = |found: &Assessment| {
                let truth: Vec<(usize, f64)> =
                    crate::support::truth_at(&whole, "left_knee_flexion_deg", &found.time_ns).collect();
                let after: Vec<f64> = truth
                    .iter()
                    .filter(|(i, _)| *i > at(9.0))
                    .map(|(i, truth)| (f64::from(series(found, "left_knee_flexion_deg").value[*i]) - truth).abs())
                    .collect();
                after.iter().sum::<f64>() / after.len() as f64
            };
            let (after_gap, without) = (error(&found), error(&assessed(&whole, method, pass)));
            assert!(after_gap < 1.3 * without + 0.2, "{method} {pass:?}: {after_gap} for {without} degrees");
        }
    }
}

#[test]
fn an_arm_that_was_exchanged_with_the_other_is_found_again() {
    let recording = exercise(Exercise::Step, Preset::Failures, 12.0);
    let default = assessed(&recording, Method::Iekf, Pass::Filter);
    for method in ALTERNATIVES {
        let found = assessed(&recording, method, Pass::Filter);
        for channel in ["left_elbow_flexion_deg", "right_elbow_flexion_deg"] {
            let pairs = series(&found, channel).value.iter().zip(&series(&default, channel).value);
            let apart = pairs.map(|(a, b)| (a - b).abs()).sum::<f32>() / found.time_ns.len() as f32;
            assert!(apart < 10.0, "{method} {channel}: {apart} degrees from the default");
        }
    }
}

#[test]
fn a_recording_that_begins_without_a_point_finds_its_subject() {
    let whole = exercise(Exercise::BackKnee, Preset::Table1, 12.0);
    let late = lose_all(whole, 0.0, 1.5);
    for method in ALTERNATIVES {
        for pass in [Pass::Filter, Pass::Smooth] {
            let found = assessed(&late, method, pass);
            let error = error(&found, &late);
            assert!(error < 6.0, "{method} {pass:?}: {error} degrees");
        }
    }
}

#[test]
fn particles_that_look_before_they_leap_do_not_starve() {
    let recording = exercise(Exercise::BackKnee, Preset::Table1, 8.0);
    let sizes =
        |pass: Pass| assessed(&recording, Method::Guided, pass).quality.effective_sample_size.expect("particles");
    let (filter, smooth) = (sizes(Pass::Filter), sizes(Pass::Smooth));
    assert_eq!(filter.particles, Method::Guided.default_particles());
    // The paper's filter keeps about three of 512.
    assert!(filter.median > 0.08 * f64::from(filter.particles), "{filter:?}");
    assert!(smooth.median > 0.5 * f64::from(smooth.particles), "{smooth:?}");
}
