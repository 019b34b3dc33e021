//! `surefoot evaluate gait`: footfalls beside the truth of captured and simulated walks.

use crate::assessment::JointTrack;
use crate::evaluation::gait::walks::{GaitRow, captured, rows, simulated};
use crate::gait::measures_of_track;
use crate::recording::import::{Dataset, ImportError, list};
use crate::synthetic::walker::Course;
use anyhow::bail;
use serde::Serialize;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Data sets of exercises in which nobody walks.
const EXERCISES: [Dataset; 3] = [Dataset::Uiprmd, Dataset::Utdmhad, Dataset::Keraal];

/// Compare gait measures from camera skeletons with the truth of captured and simulated walks.
///
/// Captured walks (cmu) are sampled at 30 Hz: clean with every phase of the frames, and with the error of a Kinect v2 for each
/// seed in four directions before the camera. Their true contacts come from the motion at 120 Hz by a rule of heel and ball
/// that the detector does not use; those of simulated walks are planned. All steps count here, also the first and last of a walk.
///
/// `baseline` takes the frames in which the feet are farthest apart, as they come. Errors of step time, step length, width,
/// speed and double support are those of the means of a walk: mean of the absolute values, and the worst. `single` is the mean
/// absolute error of single step lengths.
///
/// Below it the exercises of uiprmd, utdmhad and keraal, in which nobody walks, with the contacts that were found all the same.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot evaluate gait --data ../shared/data\n  \
    surefoot evaluate gait --seeds 20 --json > gait.json")]
pub(super) struct GaitArgs {
    /// Directory of the data sets; without cmu only simulated walks are evaluated [default: $SUREFOOT_DATA, else
    /// ../shared/data]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Seeds of the sensor's error, and simulated walks of each course
    #[arg(long, default_value_t = 10, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// An exercise in which nobody walks.
#[derive(Debug, Serialize)]
struct Exercise {
    exercise: String,
    n_trials: u64,
    /// Trials in which contacts were found.
    n_with_contacts: u64,
    /// Trials with a length or speed.
    n_with_lengths: u64,
}

pub(super) fn run(args: &GaitArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let usual = || std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let directory = args.data.clone().unwrap_or_else(usual);
    if args.data.is_some() && !directory.is_dir() {
        bail!(
            "there is no directory {}; give the data sets' directory with --data or SUREFOOT_DATA",
            directory.display()
        );
    }
    let mut walks = Vec::new();
    for source in sources(Dataset::Cmu, &directory)? {
        if let Some(motion) = source.read()?.recording.skeleton {
            walks.extend(captured(&motion, args.seeds));
        }
    }
    for course in [Course::Straight, Course::StopAndGo, Course::Turn] {
        walks.extend(simulated(course, args.seeds)?);
    }
    let rows = rows(&walks);
    let exercises = exercises(&directory)?;
    if args.json {
        let document = json!({ "walks": rows, "exercises": exercises, "version": env!("CARGO_PKG_VERSION") });
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
        return Ok(());
    }
    write_table(&rows, out)?;
    writeln!(out, "\n{:<26}{:>8}{:>15}{:>14}", "exercise", "trials", "with contacts", "with lengths")?;
    for e in &exercises {
        writeln!(out, "{:<26}{:>8}{:>15}{:>14}", e.exercise, e.n_trials, e.n_with_contacts, e.n_with_lengths)?;
    }
    Ok(())
}

/// The trials of a data set; none when it is not there.
fn sources(dataset: Dataset, directory: &Path) -> anyhow::Result<Vec<crate::recording::import::Source>> {
    match list(dataset, directory) {
        Ok(sources) => Ok(sources),
        Err(ImportError::NotFound { .. }) => Ok(Vec::new()),
        Err(error) => Err(error.into()),
    }
}

fn exercises(directory: &Path) -> anyhow::Result<Vec<Exercise>> {
    let mut found: Vec<Exercise> = Vec::new();
    for dataset in EXERCISES {
        for source in sources(dataset, directory)? {
            let Some(skeleton) = source.read()?.recording.skeleton else { continue };
            let findings = measures_of_track(&JointTrack::of_skeleton(&skeleton));
            let is_length = |name: &str| name.ends_with("_m") || name.ends_with("_mps");
            let has_lengths = findings.measures_of_all_steps.iter().any(|m| is_length(&m.name) && m.value.is_some());
            let k = match found.iter().position(|e| e.exercise == source.exercise) {
                Some(k) => k,
                None => {
                    let exercise = source.exercise.clone();
                    found.push(Exercise { exercise, n_trials: 0, n_with_contacts: 0, n_with_lengths: 0 });
                    found.len() - 1
                }
            };
            found[k].n_trials += 1;
            found[k].n_with_contacts += u64::from(!findings.contacts.is_empty());
            found[k].n_with_lengths += u64::from(has_lengths);
        }
    }
    Ok(found)
}

fn write_table(rows: &[GaitRow], out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(
        out,
        "{:<24}{:<8}{:<10}{:>6}{:>13}{:>9}{:>13}{:>8}{:>12}{:>8}{:>11}{:>12}{:>13}",
        "walks",
        "sensor",
        "method",
        "walks",
        "contacts",
        "bias ms",
        "step time ms",
        "single",
        "length cm",
        "single",
        "speed %",
        "width cm",
        "double sup %"
    )?;
    let pair = |[mean, worst]: [f64; 2], scale: f64| format!("{:.1}/{:.1}", scale * mean, scale * worst);
    for row in rows {
        let [truth, found, extra] = row.n_contacts;
        let [n, lost] = row.n_walks;
        writeln!(
            out,
            "{:<24}{:<8}{:<10}{:>6}{:>13}{:>9.1}{:>13}{:>8.1}{:>12}{:>8.1}{:>11}{:>12}{:>13}",
            row.set,
            row.sensor,
            row.method,
            if lost > 0 { format!("{n}-{lost}") } else { n.to_string() },
            format!("{found}/{truth}+{extra}"),
            1000.0 * row.contact_bias_s,
            pair(row.step_time_s, 1000.0),
            1000.0 * row.worst_step_time_s,
            pair(row.step_length_m, 100.0),
            100.0 * row.single_step_length_m,
            pair(row.speed, 100.0),
            pair(row.step_width_m, 100.0),
            row.double_support_pct.map_or("-".to_owned(), |errors| pair(errors, 1.0)),
        )?;
    }
    writeln!(
        out,
        "\nerrors of a walk's means: mean of the absolute values / worst; single step times: the worst; single step lengths: \
         mean of the absolute values; contacts: found / true + found that are none"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_that_is_not_there_is_named() {
        let args = GaitArgs { data: Some("no/such".into()), seeds: 1, json: false };
        let error = run(&args, &mut Vec::new()).unwrap_err().to_string();
        assert!(error.contains("no/such"), "{error}");
    }

    #[test]
    fn each_set_has_a_row_for_each_method() {
        let nothing = tempfile::tempdir().unwrap();
        let args = GaitArgs { data: Some(nothing.path().to_owned()), seeds: 1, json: false };
        let mut out = Vec::new();
        run(&args, &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        for course in ["straight", "turn"] {
            let of = |method: &str| {
                let is_row = |line: &&str| line.starts_with(&format!("simulated {course}")) && line.contains(method);
                text.lines().filter(is_row).count()
            };
            assert_eq!((of("footfalls"), of("baseline")), (2, 2), "{text}");
        }
    }
}
