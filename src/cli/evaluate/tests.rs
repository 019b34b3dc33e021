use super::*;
use crate::synthetic::Exercise;
use clap::Parser;
use std::collections::HashSet;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    args: Args,
}

fn output_of(words: &[&str]) -> anyhow::Result<String> {
    let args = Command::try_parse_from(["evaluate", "joint-angles"].iter().chain(words))?.args;
    let What::JointAngles(args) = args.what else { panic!("not joint angles") };
    let mut out = Vec::new();
    joint_angles(&args, &mut out)?;
    Ok(String::from_utf8(out)?)
}

#[test]
fn json_has_one_row_for_each_exercise_method_and_measure() {
    let output = output_of(&["--simulated", "--seeds", "1", "--methods", "raw,ik", "--json"]).unwrap();
    let document: serde_json::Value = serde_json::from_str(&output).unwrap();
    let rows = document["rows"].as_array().unwrap();
    // Five exercises; 3 rows of the raw knee, 4 × 3 of the method.
    assert_eq!(rows.len(), 5 * (3 + 12));
    for key in [
        "dataset",
        "exercise",
        "method",
        "measure",
        "n_trials",
        "n_frames",
        "coverage",
        "mae_deg",
        "rmse_deg",
        "rmse_without_offset_deg",
        "correlation",
    ] {
        assert!(rows.iter().all(|row| row.get(key).is_some()), "{key}");
    }
    assert_eq!(document["seed"], 1);
    assert!(document["machine"]["cores"].as_u64().unwrap() >= 1 && document["version"].is_string());
}

#[test]
fn tables_name_every_exercise_and_the_paper_s_columns() {
    let words = ["--table2", "--simulated", "--noise", "table1", "--seeds", "1", "--methods", "raw,iekf,ik,nite"];
    let output = output_of(&words).unwrap();
    for exercise in Exercise::ALL {
        assert!(output.contains(&format!("simulated-table1 {exercise}")), "{output}");
    }
    for said in [
        "hip gain over nite",
        "Table 2: simulated-table1, right side",
        "simulated-table1, all exercises, both sides",
        "output of iekf 0.000000000",
        "Verdict: does iekf beat",
    ] {
        assert!(output.contains(said), "{said}: {output}");
    }
}

#[test]
fn table_2_runs_every_contender_on_every_sensor_and_says_the_same_twice() {
    let words =
        ["--table2", "--simulated", "--noise", "failures,clean", "--seeds", "1", "--particles", "16,32", "--json"];
    let output = output_of(&words).unwrap();
    let document: serde_json::Value = serde_json::from_str(&output).unwrap();
    let texts = |list: &str, field: &str| {
        let rows = document[list].as_array().unwrap().iter();
        rows.map(|row| row[field].as_str().unwrap().to_owned()).collect::<HashSet<_>>()
    };
    let contenders = Contender::table2(&[16, 32]);
    let all: HashSet<String> = contenders.iter().map(|contender| contender.name()).collect();
    assert_eq!(texts("rows", "method"), all);
    assert_eq!(texts("rows", "dataset"), ["simulated-clean", "simulated-failures"].map(String::from).into());
    let methods: HashSet<String> = all.iter().filter(|name| *name != "raw").cloned().collect();
    assert_eq!(texts("errors", "method"), methods);
    let others: HashSet<String> = all.iter().filter(|name| *name != "iekf").cloned().collect();
    assert_eq!(document["verdict"]["default"], "iekf");
    let against = document["verdict"]["scores"].as_array().unwrap().iter();
    assert_eq!(against.map(|score| score["against"].as_str().unwrap().to_owned()).collect::<HashSet<_>>(), others);
    assert_eq!(document["settings"]["contenders"].as_array().unwrap().len(), contenders.len());
    assert_eq!(document["segment_lengths"].as_array().unwrap().len(), 2);
    assert_eq!(output, output_of(&words).unwrap());
}

fn plan_of(words: &[&str]) -> anyhow::Result<Plan> {
    let args = Command::try_parse_from(["evaluate", "joint-angles"].iter().chain(words))?.args;
    let What::JointAngles(args) = args.what else { panic!("not joint angles") };
    plan(&args)
}

#[test]
fn table_2_takes_everything_unless_a_part_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let directory = folder.path().to_str().unwrap();
    let real = plan_of(&["--table2", "--data", directory]).unwrap();
    assert!(real.data.is_some() && real.noise.is_empty());
    let simulated = plan_of(&["--table2", "--simulated"]).unwrap();
    assert_eq!((simulated.data, &simulated.noise[..], simulated.seeds), (None, &Preset::OF_JOINT_ANGLES[..], 6));
    let both = plan_of(&["--table2", "--data", directory, "--simulated", "--noise", "clean"]).unwrap();
    assert!(both.data.is_some() && both.noise == [Preset::Clean]);
    let whole = plan_of(&["--table2"]).unwrap();
    assert_eq!(whole.noise, Preset::OF_JOINT_ANGLES);
    assert_eq!(whole.contenders, Contender::table2(&[128, 512, 2048]));
}

#[test]
fn particles_are_a_setting_when_there_is_one_number_and_contenders_when_there_are_several() {
    let names = |words: &[&str]| {
        let plan = plan_of(&[&["--simulated"], words].concat()).unwrap();
        (plan.contenders.iter().map(|c| c.name()).collect::<Vec<_>>(), plan.settings.particles)
    };
    let (usual, particles) = names(&[]);
    assert_eq!((usual.len(), particles), (Contender::all().len(), None));
    assert!(usual.contains(&"particle".to_owned()));
    let one = names(&["--methods", "particle,ik", "--particles", "64"]);
    assert_eq!(one, (vec!["particle".into(), "ik".into()], Some(64)));
    let several = names(&["--methods", "particle,particle/32,ik", "--particles", "32,64"]).0;
    assert_eq!(several, ["particle/32", "particle/64", "ik"]);
    let named = names(&["--methods", "raw,iekf-filter,particle/2048"]).0;
    assert_eq!(named, ["raw", "iekf-filter", "particle/2048"]);
}

#[test]
fn arguments_that_would_be_ignored_are_refused() {
    for (words, said) in [
        (&["--noise", "clean"][..], "add --simulated"),
        (&["--simulated", "--data", "."], "--table2"),
        (&["--simulated", "--methods", "ik/64"], "no particles"),
        (&["--simulated", "--particles", "8"], "16"),
    ] {
        let refusal = plan_of(words).unwrap_err().to_string();
        assert!(refusal.contains(said), "{words:?}: {refusal}");
    }
}

#[test]
fn figures_are_written_as_files() {
    let folder = tempfile::tempdir().unwrap();
    let figures = folder.path().join("figures");
    let words = ["--simulated", "--seeds", "1", "--methods", "raw,iekf,nite", "--svg", figures.to_str().unwrap()];
    output_of(&words).unwrap();
    for name in ["series-simulated-table1-step", "scatter-simulated-table1", "boxes-simulated-table1"] {
        let svg = fs::read_to_string(figures.join(format!("{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{name}");
    }
}

#[test]
fn a_missing_or_empty_directory_is_refused_and_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("nothing");
    for (directory, said) in [(missing.as_path(), "there is no directory"), (folder.path(), "no trials of uiprmd")] {
        let refusal = output_of(&["--data", directory.to_str().unwrap()]).unwrap_err().to_string();
        assert!(refusal.contains(said) && refusal.contains("--simulated"), "{refusal}");
    }
}

#[test]
fn real_trials_are_compared_with_their_reference_where_the_data_are() {
    let data = std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let uiprmd = data.join("skeleton/uiprmd");
    if !uiprmd.is_dir() {
        println!("skipped: no {}", uiprmd.display());
        return;
    }
    let output = output_of(&["--data", uiprmd.to_str().unwrap(), "--methods", "raw", "--json"]).unwrap();
    let document: serde_json::Value = serde_json::from_str(&output).unwrap();
    let squat = document["rows"]
        .as_array()
        .unwrap()
        .iter()
        .find(|row| row["exercise"] == "m01_deep_squat" && row["measure"] == "knee_flexion");
    let squat = squat.expect("a row of the squat");
    assert_eq!(squat["n_trials"], 5);
    let rmse = squat["rmse_deg"].as_f64().unwrap();
    // The sides differ: medians of 6.6° on the right and 8.9° on the left; pooled within each trial it is 9.0°. The
    // estimated lag of the clocks moves it by a few tenths.
    assert!((8.0..10.0).contains(&rmse), "{rmse}");
}
