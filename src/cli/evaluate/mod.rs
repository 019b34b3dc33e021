//! `surefoot evaluate`: methods beside a reference.

mod table;

use crate::assessment::JointAngleSettings;
use crate::evaluation::joint_angles::evaluate;
use crate::evaluation::{Contender, Evaluation, Trial, TrialSource};
use crate::recording::import::{Dataset, ImportError, list};
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};
use anyhow::bail;
use clap::Subcommand;
use indicatif::{ProgressBar, ProgressStyle};
use std::fs;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Measure how well estimates agree with a reference.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Joint angles against gold-standard angles, real or simulated
    JointAngles(JointAngleArgs),
}

/// Compare methods with the reference angles of every importable trial below a directory, or of simulated exercises.
///
/// Prints, for each data set, exercise, method and angle: trials, frames, coverage, and the medians over the trials of
/// mean absolute error, root mean square error with and without the constant offset, and correlation. `raw` is the
/// three-point angle of the recorded joints.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot evaluate joint-angles --data ../shared/data\n  \
    surefoot evaluate joint-angles --data uiprmd --methods raw,iekf --json\n  \
    surefoot evaluate joint-angles --simulated --noise kinect-v2 --seeds 10 --table")]
struct JointAngleArgs {
    /// Directory of the data sets, or of one of them (uiprmd, utdmhad, keraal, cmu)
    #[arg(long, env = "SUREFOOT_DATA", default_value = "../shared/data", value_name = "DIR")]
    data: PathBuf,
    /// Evaluate the five synthetic exercises with known truth instead of data
    #[arg(long)]
    simulated: bool,
    /// Sensor errors of simulated exercises: clean, table1, kinect-v2, failures
    #[arg(long, default_value = "table1", value_name = "PRESET")]
    noise: Preset,
    /// Simulated subjects for each exercise
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Methods, comma separated: raw, iekf, ukf, guided, particle, ik, nite
    #[arg(long, value_delimiter = ',', default_value = "raw,ik,particle,iekf,nite", value_name = "LIST")]
    methods: Vec<Contender>,
    /// Particles of particle (512 when not given) and guided (96)
    #[arg(long, value_parser = clap::value_parser!(u32).range(16..=65536), value_name = "N")]
    particles: Option<u32>,
    /// Seed of the methods' random streams
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Also print the paper's Table 2: rotation errors of hips and knees, and the gain over the middleware
    #[arg(long)]
    table: bool,
}

/// Runs the command.
///
/// # Errors
/// When there is nothing to evaluate.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.what {
        What::JointAngles(args) => joint_angles(args, &mut std::io::stdout().lock()),
    }
}

fn joint_angles(args: &JointAngleArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let sources = if args.simulated { simulated(args.noise, args.seeds) } else { imported(&args.data)? };
    let settings = JointAngleSettings { particles: args.particles, seed: args.seed, ..JointAngleSettings::default() };
    let bar = progress_bar(sources.len() as u64);
    let evaluation = evaluate(&sources, &args.methods, &settings, || bar.inc(1));
    bar.finish_and_clear();
    for failure in &evaluation.failures {
        eprintln!("failed: {} ({}): {}", failure.trial, failure.method.unwrap_or("loading"), failure.reason);
    }
    if evaluation.n_without_reference > 0 {
        eprintln!("left out: {} trials without reference angles of hips or knees", evaluation.n_without_reference);
    }
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&document(args, &evaluation))?)?;
        return Ok(());
    }
    table::agreement(&evaluation, out)?;
    if args.table {
        table::errors(&evaluation, out)?;
    }
    Ok(())
}

/// The result as JSON, with what is needed to get it again.
fn document(args: &JointAngleArgs, evaluation: &Evaluation) -> serde_json::Value {
    let data = if args.simulated {
        format!("simulated, noise {}, {} seeds", args.noise, args.seeds)
    } else {
        args.data.display().to_string()
    };
    let mut document = serde_json::json!({
        "rows": evaluation.rows,
        "failures": evaluation.failures,
        "n_without_reference": evaluation.n_without_reference,
        "data": data,
        "particles": args.particles,
        "seed": args.seed,
        "machine": machine(),
        "version": env!("CARGO_PKG_VERSION"),
    });
    if args.table {
        document["errors"] = serde_json::json!(evaluation.errors);
    }
    document
}

/// Name and number of the processors, as far as the system tells.
fn machine() -> serde_json::Value {
    let information = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information.lines().find(|line| line.starts_with("model name"));
    let cpu = model.and_then(|line| line.split_once(':')).map_or("unknown", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    serde_json::json!({ "cpu": cpu, "cores": cores })
}

/// Every trial of every data set at or below a directory.
fn imported(directory: &Path) -> anyhow::Result<Vec<TrialSource>> {
    if !directory.is_dir() {
        bail!(
            "there is no directory {}; give the data sets' directory with --data or SUREFOOT_DATA, or use --simulated",
            directory.display()
        );
    }
    let mut sources = Vec::new();
    for dataset in Dataset::ALL {
        let found = match list(dataset, directory) {
            Ok(found) => found,
            Err(ImportError::NotFound { .. }) => continue,
            Err(error) => return Err(error.into()),
        };
        for source in found {
            // Exercises done wrongly on purpose are kept apart from the same done well.
            let manner = if source.name.ends_with("_inc") { "_incorrect" } else { "" };
            let exercise = format!("{}{manner}", source.exercise);
            sources.push(TrialSource::new(format!("{} {}", dataset.name(), source.name), move || {
                let trial = source.read().map_err(|error| error.to_string())?;
                Ok(Trial { dataset: dataset.name().to_owned(), exercise: exercise.clone(), recording: trial.recording })
            }));
        }
    }
    if sources.is_empty() {
        let names = Dataset::ALL.map(Dataset::name).join(", ");
        bail!(
            "no trials of {names} below {}; give their directory with --data, or use --simulated",
            directory.display()
        );
    }
    Ok(sources)
}

/// The synthetic exercises, each by several subjects of different height and direction.
fn simulated(noise: Preset, seeds: u64) -> Vec<TrialSource> {
    let mut sources = Vec::new();
    for exercise in Exercise::ALL {
        for seed in 1..=seeds {
            sources.push(TrialSource::new(format!("{exercise}, seed {seed}"), move || {
                let settings = SimulationSettings {
                    jitter: true,
                    // Steps that never repeat within a few subjects: heights 1.55 to 1.85 m, up to 10° to either side.
                    stature_m: 1.55 + 0.3 * (0.618 * seed as f64).fract(),
                    yaw_deg: -10.0 + 20.0 * (0.414 * seed as f64).fract(),
                    ..SimulationSettings::new(exercise, noise, seed)
                };
                let recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
                Ok(Trial { dataset: format!("simulated-{noise}"), exercise: exercise.name().to_owned(), recording })
            }));
        }
    }
    sources
}

/// A bar on standard error, or nothing when nobody watches.
fn progress_bar(trials: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(trials);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} trials, {eta} left") {
        bar.set_style(style);
    }
    bar
}

#[cfg(test)]
mod tests;
