use super::*;
use crate::assessment::Method;
use crate::evaluation::agreement::Agreement;
use crate::evaluation::{Row, Trial};
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};

fn settings() -> JointAngleSettings {
    JointAngleSettings { particles: Some(64), ..JointAngleSettings::default() }
}

fn trial(exercise: Exercise, sensor: Preset, seed: u64) -> TrialSource {
    TrialSource::new(format!("{exercise} {seed}"), move || {
        let settings = SimulationSettings { duration_s: 10.0, ..SimulationSettings::new(exercise, sensor, seed) };
        let recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
        Ok(Trial { dataset: "simulated".into(), exercise: exercise.name().into(), recording })
    })
}

fn row<'a>(evaluation: &'a Evaluation, exercise: Exercise, method: &str, measure: &str) -> &'a Row {
    let mut rows = evaluation.rows.iter();
    rows.find(|r| r.exercise == exercise.name() && r.method == method && r.measure == measure).unwrap()
}

#[test]
fn raw_joints_without_noise_agree_with_the_truth_exactly() {
    let sources = [trial(Exercise::BackKnee, Preset::Clean, 1), trial(Exercise::BackKnee, Preset::Clean, 2)];
    let evaluation = evaluate(&sources, &[Contender::Raw], &settings(), &Inputs::default(), || ());
    assert_eq!(evaluation.failures, []);
    let knee = row(&evaluation, Exercise::BackKnee, "raw", "knee_flexion");
    assert_eq!((knee.n_trials, knee.n_frames, knee.coverage), (2, 2 * 2 * 301, 1.0));
    assert!(knee.rmse_deg.unwrap() < 1e-6, "{knee:?}");
    assert!((knee.correlation.unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(knee.interval_coverage, None);
}

#[test]
fn there_is_a_line_for_both_sides_together_and_for_each() {
    let sources = [trial(Exercise::SideHip, Preset::Table1, 1)];
    let contenders = [Contender::Raw, Contender::of(Method::Ik)];
    let evaluation = evaluate(&sources, &contenders, &settings(), &Inputs::default(), || ());
    let measures = |method: &str| {
        let rows = evaluation.rows.iter().filter(|r| r.method == method);
        rows.map(|r| r.measure.as_str()).collect::<Vec<_>>()
    };
    assert_eq!(measures("raw"), ["knee_flexion", "left_knee_flexion", "right_knee_flexion"]);
    assert_eq!(measures("ik").len(), 12);
    let part = |measure| row(&evaluation, Exercise::SideHip, "ik", measure);
    assert_eq!(part("knee_flexion").n_frames, part("left_knee_flexion").n_frames + part("right_knee_flexion").n_frames);
    let mean = (part("left_knee_flexion").mae_deg.unwrap() + part("right_knee_flexion").mae_deg.unwrap()) / 2.0;
    assert!((part("knee_flexion").mae_deg.unwrap() - mean).abs() < 1e-9, "one trial with as many frames of each side");
}

#[test]
fn a_trial_that_cannot_be_loaded_or_assessed_is_reported_and_the_others_count() {
    let broken = TrialSource::new("broken", || Err("the file is empty".to_owned()));
    let one_frame = TrialSource::new("one frame", || {
        let settings = SimulationSettings::new(Exercise::Step, Preset::Clean, 1);
        let mut recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
        recording.skeleton = None;
        Ok(Trial { dataset: "simulated".into(), exercise: "step".into(), recording })
    });
    let sources = [broken, one_frame, trial(Exercise::Step, Preset::Clean, 2)];
    let evaluation = evaluate(&sources, &[Contender::of(Method::Ik)], &settings(), &Inputs::default(), || ());
    let told: Vec<_> = evaluation.failures.iter().map(|f| (f.trial.as_str(), f.method.as_deref())).collect();
    assert_eq!(told, [("broken", None), ("one frame", Some("ik"))]);
    assert_eq!(evaluation.failures[0].reason, "the file is empty");
    let knee = row(&evaluation, Exercise::Step, "ik", "knee_flexion");
    assert_eq!((knee.n_trials, knee.n_failed), (1, 1));
}

#[test]
fn the_result_is_the_same_with_one_and_with_several_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let sources = [1, 2, 3].map(|seed| trial(Exercise::Step, Preset::Failures, seed));
        pool.install(|| evaluate(&sources, &Contender::all(), &settings(), &Inputs::default(), || ()))
    };
    let json = |evaluation: &Evaluation| serde_json::to_string(evaluation).unwrap();
    assert_eq!(json(&run(1)), json(&run(3)));
}

#[test]
fn the_default_s_intervals_are_counted_against_the_truth() {
    let sources = [trial(Exercise::BackKnee, Preset::Table1, 1)];
    let evaluation = evaluate(&sources, &[Contender::of(Method::Iekf)], &settings(), &Inputs::default(), || ());
    let knee = row(&evaluation, Exercise::BackKnee, "iekf", "knee_flexion");
    let inside = knee.interval_coverage.expect("the default has intervals");
    assert!(inside > 0.5 && inside <= 1.0, "{inside}");
}

#[test]
fn full_turns_are_no_error() {
    let source = trial(Exercise::BackKnee, Preset::Clean, 1);
    let recording = (source.load)().unwrap().recording;
    let settings = Settings::JointAngles(JointAngleSettings { method: Method::Ik, ..settings() });
    let mut assessment = pipeline::assess(&recording, &settings, &Monitor::default()).unwrap();
    let before = compare_assessment(&recording, &assessment);
    for series in &mut assessment.series {
        series.value.iter_mut().for_each(|value| *value += 360.0);
    }
    let after = compare_assessment(&recording, &assessment);
    for (a, b) in before.iter().zip(&after) {
        let rmse = |c: &Comparison| Agreement::between(&c.estimate, &c.reference).rmse().unwrap();
        // The series are f32: at 400° they resolve 3e-5°.
        assert!((rmse(a) - rmse(b)).abs() < 1e-3, "{} {:?}", a.measure, a.side);
    }
}

#[test]
fn a_method_has_particles_exactly_when_its_assessment_tells_an_effective_sample_size() {
    let recording = (trial(Exercise::BackKnee, Preset::Table1, 1).load)().unwrap().recording;
    for method in Method::ALL {
        let own = JointAngleSettings { method, ..settings() };
        let assessment = pipeline::assess(&recording, &Settings::JointAngles(own), &Monitor::default()).unwrap();
        assert_eq!(method.has_particles(), assessment.quality.effective_sample_size.is_some(), "{method}");
    }
}

#[test]
fn the_overview_takes_the_exercises_of_a_data_set_together() {
    let sources = [trial(Exercise::Step, Preset::Table1, 1), trial(Exercise::SideHip, Preset::Table1, 1)];
    let contenders = [Contender::default_method(), Contender::of(Method::Ik)];
    let evaluation = evaluate(&sources, &contenders, &settings(), &Inputs::default(), || ());
    assert_eq!(evaluation.overview.len(), contenders.len() * MEASURES.len());
    let knee = |method: &str| {
        let mut rows = evaluation.overview.iter();
        rows.find(|row| row.method == method && row.measure == "knee_flexion").unwrap()
    };
    let of = |exercise| row(&evaluation, exercise, "iekf", "knee_flexion");
    let (step, side_hip) = (of(Exercise::Step), of(Exercise::SideHip));
    let mean = (step.mae_deg.unwrap() + side_hip.mae_deg.unwrap()) / 2.0;
    assert!(knee("iekf").n_exercises == 2 && (knee("iekf").mae_deg.unwrap() - mean).abs() < 1e-12);
    let held = |row: &Row| row.interval_coverage.unwrap() * row.n_frames as f64;
    let share = (held(step) + held(side_hip)) / (step.n_frames + side_hip.n_frames) as f64;
    assert!((knee("iekf").interval_coverage.unwrap() - share).abs() < 1e-12);
    assert_eq!((knee("ik").interval_coverage, knee("ik").interval_coverage_as_promised), (None, None));
}

#[test]
fn the_verdict_compares_the_default_with_every_other_in_each_exercise_and_in_all() {
    let sources = [trial(Exercise::Step, Preset::Table1, 1), trial(Exercise::SideHip, Preset::Table1, 1)];
    let contenders = [Contender::Raw, Contender::default_method(), Contender::of(Method::Ik)];
    let verdict = evaluate(&sources, &contenders, &settings(), &Inputs::default(), || ()).verdict.unwrap();
    // Two exercises and all; raw in the knee only, `ik` in four angles; two statistics.
    assert_eq!(verdict.rows.len(), 3 * (1 + 4) * 2);
    let scored: usize = verdict.scores.iter().map(|score| score.beats + score.ties + score.loses).sum();
    assert_eq!(scored, 2 * (1 + 4) * 2, "rows of all exercises are not counted again");
    assert_eq!(verdict.default_beats_or_ties_everywhere, verdict.losses().count() == 0);
    assert_eq!(evaluate(&sources, &contenders[..1], &settings(), &Inputs::default(), || ()).verdict, None);
}
