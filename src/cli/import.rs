//! `surefoot import`: a public data set becomes recordings.

use crate::recording::encode;
use crate::recording::import::{Dataset, ImportReport, list};
use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use std::fs;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

/// Make recordings of a public data set
///
/// Reads the original files and writes one recording per trial, with the data set's reference on its own channels, and a
/// report of what had to be repaired.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example: surefoot import uiprmd ~/data/skeleton recordings/
writes recordings/m01_s01_e02.mcap and its siblings, and recordings/import-report.json with what was done to each trial:
lost joints, jumps, the lag between the clocks of the skeleton and its reference.")]
pub struct Args {
    /// Data set to read.
    #[arg(value_enum)]
    dataset: DatasetName,
    /// Folder of the data set, or one or two levels above it.
    dir: PathBuf,
    /// Folder to write to; made when absent, files of the same name are replaced.
    out: PathBuf,
    /// Print the report as JSON instead of a summary.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum DatasetName {
    /// UI-PRMD: rehabilitation exercises, Kinect v2 with Vicon knee angles.
    Uiprmd,
    /// UTD-MHAD: daily actions, Kinect v1 with an inertial sensor on the right thigh.
    Utdmhad,
    /// KERAAL: seated trunk exercises, Kinect v2 with orientations.
    Keraal,
    /// CMU motion capture, subject 02: walking with exact knee angles.
    Cmu,
    /// BROAD: one inertial unit in the hand, with its optical orientation.
    #[value(name = "broad")]
    Broad,
    /// RepoIMU: one inertial unit on a rod, with the rod's optical orientation.
    #[value(name = "repoimu")]
    Repoimu,
    /// Five-segment chain with hinges, units and optical orientation.
    #[value(name = "ring_chain")]
    RingChain,
    /// Thigh and shank in sit-to-stands, with knee flexion from markers.
    #[value(name = "knee_sts")]
    KneeSts,
    /// Thigh and shank in drop landings and cutting, with knee flexion.
    #[value(name = "knee_drop_cut")]
    KneeDropCut,
    /// Nine units on one person.
    #[value(name = "qmt_fullbody")]
    QmtFullbody,
    /// Exports of an x-IMU, `…_CalInertialAndMag.csv`.
    #[value(name = "ximu_gait")]
    XimuGait,
}

impl From<DatasetName> for Dataset {
    fn from(name: DatasetName) -> Self {
        match name {
            DatasetName::Uiprmd => Dataset::Uiprmd,
            DatasetName::Utdmhad => Dataset::Utdmhad,
            DatasetName::Keraal => Dataset::Keraal,
            DatasetName::Cmu => Dataset::Cmu,
            DatasetName::Broad => Dataset::Broad,
            DatasetName::Repoimu => Dataset::Repoimu,
            DatasetName::RingChain => Dataset::RingChain,
            DatasetName::KneeSts => Dataset::KneeSts,
            DatasetName::KneeDropCut => Dataset::KneeDropCut,
            DatasetName::QmtFullbody => Dataset::QmtFullbody,
            DatasetName::XimuGait => Dataset::XimuGait,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// When the data set is not found or malformed, or the output cannot be written; trials that were written before stay.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let dataset = Dataset::from(args.dataset);
    let sources = list(dataset, &args.dir)?;
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    let bar = progress_bar(sources.len() as u64)?;
    let mut notes = Vec::new();
    for source in &sources {
        bar.set_message(source.name.clone());
        let trial = source.read()?;
        let file = args.out.join(format!("{}.mcap", source.name));
        fs::write(&file, encode::mcap(&trial.recording)?)
            .with_context(|| format!("cannot write {}", file.display()))?;
        notes.push(trial.notes);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let report = ImportReport::of(dataset.name(), notes);
    let json = serde_json::to_string_pretty(&report)?;
    let file = args.out.join("import-report.json");
    fs::write(&file, &json).with_context(|| format!("cannot write {}", file.display()))?;
    let text = if args.json { json } else { summary(&report, args) };
    writeln!(std::io::stdout(), "{text}")?;
    Ok(())
}

/// A bar on a terminal, nothing elsewhere.
fn progress_bar(n: u64) -> anyhow::Result<ProgressBar> {
    if !std::io::stderr().is_terminal() {
        return Ok(ProgressBar::hidden());
    }
    Ok(ProgressBar::new(n).with_style(ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}")?))
}

fn summary(report: &ImportReport, args: &Args) -> String {
    let defects = &report.defects;
    let unsure = report.trials.iter().filter_map(|trial| trial.clock_offset.as_ref());
    let unsure = unsure.filter(|clock| !clock.is_determined).count();
    format!(
        "{} recordings ({} with a reference, {} frames, {} inertial samples) written to {}\n\
         lost joints {}, jumps {}, missing orientations {}, lost reference markers {}, trials without a sure lag {unsure}",
        report.n_trials,
        report.n_trials_with_reference,
        report.n_frames,
        report.n_inertial_samples,
        args.out.display(),
        defects.lost_joints,
        defects.jumps,
        defects.zero_quaternions,
        defects.lost_reference_markers,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Format, Limits, decode};
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn args(words: &[&str]) -> Args {
        Command::try_parse_from([&["import"], words].concat()).expect("arguments").args
    }

    #[test]
    fn a_data_set_becomes_recordings_that_decode_and_a_report() {
        let folder = tempfile::tempdir().expect("a folder");
        let (data, out) = (folder.path().join("keraal"), folder.path().join("out"));
        fs::create_dir_all(&data).expect("made");
        let row = (0..175).map(|i| if i % 7 == 3 { "1" } else { "0.5" }).collect::<Vec<_>>().join(" ");
        let row = row.replace("1 0.5 0.5 0.5", "1 0 0 0");
        fs::write(data.join("G3-Kinect-CTK-P1.txt"), format!("{row}\n{row}\n{row}\n")).expect("written");
        let path = |path: &std::path::Path| path.to_str().expect("a text").to_owned();
        run(&args(&["keraal", &path(folder.path()), &path(&out)])).expect("imported");
        let recording = fs::File::open(out.join("G3-CTK-P1.mcap")).expect("a recording");
        let skeleton = decode(recording, Format::Mcap, &Limits::default()).expect("decodes").skeleton;
        assert_eq!(skeleton.expect("a skeleton").len(), 3);
        let report: serde_json::Value =
            serde_json::from_slice(&fs::read(out.join("import-report.json")).expect("a report")).expect("json");
        assert_eq!((&report["n_trials"], &report["trials"][0]["n_frames"]), (&1.into(), &3.into()));
    }

    #[test]
    fn a_folder_without_the_data_set_is_an_error_that_says_what_was_expected() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_str().expect("a text");
        let error = run(&args(&["cmu", path, path])).expect_err("nothing there");
        assert!(error.to_string().contains("expected 02.asf"), "{error}");
    }
}
