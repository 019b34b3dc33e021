use super::*;
use clap::Parser;

#[derive(Debug, Parser)]
struct Command {
    #[command(flatten)]
    args: FusionArgs,
}

fn printed(line: &str) -> String {
    let words = std::iter::once("fusion").chain(line.split_whitespace());
    let command = Command::try_parse_from(words).unwrap();
    let mut out = Vec::new();
    run(&command.args, &mut out).unwrap();
    String::from_utf8(out).unwrap()
}

#[test]
fn a_directory_without_the_data_set_is_named() {
    let command = Command::try_parse_from(["fusion", "--data", "no/such"]).unwrap();
    let error = run(&command.args, &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("no/such") && error.contains("utdmhad"), "{error}");
}

#[test]
fn what_cannot_be_is_refused_with_the_choices() {
    let refusal = |words: &[&str]| {
        let command = Command::try_parse_from(std::iter::once(&"fusion").chain(words));
        command
            .map(|command| run(&command.args, &mut Vec::new()).unwrap_err().to_string())
            .unwrap_or_else(|e| e.to_string())
    };
    assert!(refusal(&["--methods", "kalman"]).contains("hierarchy"));
    assert!(refusal(&["--simulated", "--units", "pelvis"]).contains("pelvis"));
    assert!(refusal(&["--movements", "flight"]).contains("kick_left"));
    assert!(refusal(&["--simulated", "--data", "x"]).contains("--data"));
}

#[test]
fn the_tables_hold_every_joint_method_and_the_clocks() {
    let told = printed("--simulated --movements kick --seeds 1 --seconds 5 --methods raw,fused --trials");
    for word in ["left elbow", "right knee", "raw", "fused", "hip flexion", "trunk axial rotation", "clock, ms", "NCC"]
    {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert!(!told.contains("failed:"), "{told}");
}

#[test]
fn the_document_holds_every_trial_and_the_totals() {
    let told = printed("--simulated --movements kick --seeds 1 --seconds 5 --methods raw --json");
    let document: serde_json::Value = serde_json::from_str(&told).unwrap();
    let trial = &document["simulated"]["trials"][0];
    assert_eq!((trial["contender"].as_str(), trial["movement"].as_str()), (Some("raw"), Some("kick")));
    assert_eq!(document["simulated"]["totals"].as_array().unwrap().len(), 2);
    assert!(trial["angles"][0]["rmse_deg"].as_f64().unwrap() > 0.0);
}
