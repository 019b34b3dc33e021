use super::*;
use clap::Parser;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    args: Args,
}

fn output_of(words: &[&str]) -> anyhow::Result<String> {
    let args = Command::try_parse_from(["evaluate", "joint-angles"].iter().chain(words))?.args;
    let What::JointAngles(args) = args.what;
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
    let output = output_of(&["--simulated", "--seeds", "1", "--methods", "raw,ik,nite", "--table"]).unwrap();
    for exercise in Exercise::ALL {
        assert!(output.contains(&format!("simulated-table1 {exercise}")), "{output}");
    }
    assert!(output.contains("hip gain over nite") && output.contains("right side"), "{output}");
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
