use super::*;
use crate::assessment::{JointAngleSettings, Method};
use crate::evaluation::joint_angles::run;
use crate::evaluation::{Trial, TrialSource};
use crate::pipeline::Inputs;
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};

fn outcomes() -> Outcomes {
    let sources = [Exercise::Step, Exercise::SideHip].map(|exercise| {
        TrialSource::new(format!("{exercise} <1>"), move || {
            let settings =
                SimulationSettings { duration_s: 8.0, ..SimulationSettings::new(exercise, Preset::Failures, 1) };
            let recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
            Ok(Trial { dataset: "lab".into(), exercise: exercise.name().into(), recording })
        })
    });
    let mut contenders = vec![Contender::Raw, Contender::default_method(), Contender::MIDDLEWARE];
    contenders.extend(Contender::of(Method::Particle).with_each(&[16, 64]));
    run(&sources, &contenders, &JointAngleSettings::default(), &Inputs::default(), || ())
}

fn figures(outcomes: &Outcomes) -> Vec<Figure> {
    draw(outcomes, &outcomes.summarize()).unwrap()
}

/// Elements of a well-formed document by name, and its texts.
fn read(svg: &str) -> (Vec<String>, Vec<String>) {
    let document = roxmltree::Document::parse(svg).unwrap();
    let elements = document.descendants().filter(|node| node.is_element());
    let texts = document.descendants().filter_map(|node| node.text().filter(|_| node.is_text()));
    (
        elements.map(|node| node.tag_name().name().to_owned()).collect(),
        texts.map(|text| text.trim().to_owned()).filter(|text| !text.is_empty()).collect(),
    )
}

#[test]
fn there_is_a_series_for_each_exercise_and_the_other_figures_for_each_data_set() {
    let names: Vec<String> = figures(&outcomes()).into_iter().map(|figure| figure.name).collect();
    assert_eq!(names, ["series-lab-side_hip", "series-lab-step", "scatter-lab", "boxes-lab", "gain-lab"]);
}

#[test]
fn figures_are_well_formed_and_name_angles_units_and_methods() {
    let figures = figures(&outcomes());
    let of = |name: &str| read(&figures.iter().find(|figure| figure.name == name).unwrap().svg);
    let count = |elements: &[String], name: &str| elements.iter().filter(|element| *element == name).count();

    let (elements, texts) = of("series-lab-step");
    for text in ["reference", "iekf (default)", "time (s)", "hip flexion (°)", "knee flexion (°)"] {
        assert!(texts.iter().any(|found| found == text), "{text}: {texts:?}");
    }
    assert!(texts[0].contains("step <1>"), "the title is escaped and read back: {}", texts[0]);
    assert!(count(&elements, "polygon") >= 4, "a band for each angle");
    assert!(count(&elements, "polyline") > 4 * 3, "reference, default and nite for each angle, raw for the knee");

    let (elements, texts) = of("scatter-lab");
    assert!(count(&elements, "circle") > 500 && texts.iter().any(|text| text == "error of iekf (°)"));

    let (elements, texts) = of("boxes-lab");
    for text in ["raw", "particle/16", "particle/64", "side_hip", "step"] {
        assert!(texts.iter().any(|found| found == text), "{text}: {texts:?}");
    }
    // Four methods in four angles of two exercises, and raw in the knee; filled and outlined.
    assert!(count(&elements, "rect") >= 2 * 2 * (4 * 4 + 1));

    let (_, texts) = of("gain-lab");
    for text in ["16 particles", "64 particles", "gain of particle over nite (°)"] {
        assert!(texts.iter().any(|found| found == text), "{text}: {texts:?}");
    }
}

#[test]
fn the_same_evaluation_gives_the_same_bytes() {
    assert_eq!(figures(&outcomes()), figures(&outcomes()));
}

#[test]
fn the_series_follow_the_values() {
    let mut outcomes = outcomes();
    let before = figures(&outcomes);
    for compared in outcomes.trials.iter_mut().flat_map(|trial| &mut trial.results).flatten() {
        for comparison in &mut compared.comparisons {
            comparison.estimate.iter_mut().for_each(|value| *value += 1.0);
        }
    }
    let after = figures(&outcomes);
    let differs = |name: &str| {
        let svg = |all: &[Figure]| all.iter().find(|figure| figure.name == name).map(|figure| figure.svg.clone());
        svg(&before) != svg(&after)
    };
    assert!(differs("series-lab-step") && differs("boxes-lab"));
}

#[test]
fn without_the_middleware_or_the_default_the_figures_that_need_them_are_left_out() {
    let source = TrialSource::new("one", || {
        let settings =
            SimulationSettings { duration_s: 8.0, ..SimulationSettings::new(Exercise::Step, Preset::Clean, 1) };
        let recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
        Ok(Trial { dataset: "lab".into(), exercise: "step".into(), recording })
    });
    let contenders = [Contender::Raw, Contender::of(Method::Ik)];
    let outcomes = run(&[source], &contenders, &JointAngleSettings::default(), &Inputs::default(), || ());
    let names: Vec<String> = figures(&outcomes).into_iter().map(|figure| figure.name).collect();
    assert_eq!(names, ["boxes-lab"]);
}
