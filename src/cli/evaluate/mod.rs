//! `surefoot evaluate`: methods beside a reference.

mod document;
mod fusion;
mod gait;
mod hinge;
mod noise;
mod orientation;
mod protocols;
mod sources;
mod table;
mod verdict_table;
mod walker;
mod walker_sweep;
mod watch;

use super::noise_model::NoiseModelChoice;
use crate::assessment::JointAngleSettings;
use crate::evaluation::contender::{PAPER_PARTICLES, PARTICLES};
use crate::evaluation::joint_angles::run as run_contenders;
use crate::evaluation::{Contender, Evaluation, TrialSource, figures};
use crate::pipeline::Inputs;
use crate::synthetic::Preset;
use anyhow::{Context, bail};
use clap::Subcommand;
use noise::Noise;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use watch::Watch;

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
    /// Camera skeleton and inertial units fused, simulated and real
    Fusion(fusion::FusionArgs),
    /// Gait measures from camera skeletons against captured and simulated walks
    Gait(gait::GaitArgs),
    /// Flexion of hinge joints from two inertial units against optical angles
    Hinge(hinge::HingeArgs),
    /// Orientation filters of inertial units against optical orientation
    Orientation(orientation::OrientationArgs),
    /// Recognition, repetitions and times of exercises and tests, real and simulated
    Protocols(protocols::ProtocolArgs),
    /// Legs of a walker's user from depth images against the truth of simulated walks
    Walker(walker::WalkerArgs),
}

/// Compare methods with the reference angles of every importable trial below a directory, or of simulated exercises.
///
/// Prints, for each data set, exercise, method and angle: trials, frames, coverage, and the medians over the trials of
/// mean absolute error, root mean square error with and without the constant offset, and correlation; then each method
/// over all exercises with the share of 95 % intervals that hold the reference, and whether the default beats, ties or
/// loses against each other method.
///
/// With --table2 everything runs side by side: every real trial that has a reference, and the five simulated exercises
/// with every sensor; every method, those with particles at 128, 512 and 2048; and the paper's Table 2 is printed: mean
/// and quartiles of the errors, the gain over the middleware, and Wilcoxon's signed-rank test.
///
/// A method is written as `iekf`, with a pass as `iekf-filter`, with particles as `particle/512`; `raw` is the
/// three-point angle of the recorded joints.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot evaluate joint-angles --data ../shared/data\n  \
    surefoot evaluate joint-angles --table2 --svg figures\n  \
    surefoot evaluate joint-angles --table2 --json > table2.json\n  \
    surefoot evaluate joint-angles --table2 --simulated --noise table1,failures --seeds 10\n  \
    surefoot evaluate joint-angles --simulated --noise kinect-v2 --methods raw,iekf,iekf-filter,particle/2048")]
struct JointAngleArgs {
    /// Directory of the data sets, or of one of them (uiprmd, utdmhad, keraal, cmu); with --table2 this leaves the
    /// simulated exercises out [default: $SUREFOOT_DATA, else ../shared/data]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Evaluate the five synthetic exercises with known truth instead of data
    #[arg(long)]
    simulated: bool,
    /// Sensor errors of simulated exercises, comma separated: clean, table1, kinect-v2, failures, or all [default:
    /// table1; with --table2 all]
    #[arg(long, value_name = "LIST")]
    noise: Option<Noise>,
    /// Simulated subjects for each exercise and sensor [default: 3; with --table2 6, the fewest that a signed-rank test
    /// over trials can tell apart]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: Option<u64>,
    /// Methods, comma separated [default: raw and every method; with --table2 also the filters of those that smooth]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    methods: Vec<Contender>,
    /// Particles of the methods that have them, comma separated, for those that do not say how many themselves; 512 for
    /// particle, 96 for guided when not given [default with --table2: 128,512,2048]
    #[arg(long, value_delimiter = ',', value_name = "LIST",
        value_parser = clap::value_parser!(u32).range(i64::from(*PARTICLES.start())..=i64::from(*PARTICLES.end())))]
    particles: Vec<u32>,
    /// Seed of the methods' random streams
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Noise of the sensor for methods that take any: adaptive, nite-table1, kinect-v1, kinect-v2, or the file of a
    /// trained model; each method's own choice when absent
    #[arg(long, value_name = "NAME|FILE")]
    noise_model: Option<NoiseModelChoice>,
    /// Print the paper's Table 2: rotation errors of hips and knees, and the gain over the middleware
    #[arg(long)]
    table2: bool,
    /// Print one JSON object with everything
    #[arg(long)]
    json: bool,
    /// Also write figures as SVG into a directory: time series, errors beside the middleware's, box plots, and the gain
    /// by the number of particles
    #[arg(long, value_name = "DIR")]
    svg: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// When there is nothing to evaluate.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.what {
        What::JointAngles(args) => joint_angles(args, &mut std::io::stdout().lock()),
        What::Fusion(args) => fusion::run(args, &mut std::io::stdout().lock()),
        What::Gait(args) => gait::run(args, &mut std::io::stdout().lock()),
        What::Hinge(args) => hinge::run(args, &mut std::io::stdout().lock()),
        What::Orientation(args) => orientation::run(args, &mut std::io::stdout().lock()),
        What::Protocols(args) => protocols::run(args, &mut std::io::stdout().lock()),
        What::Walker(args) => walker::run(args, &mut std::io::stdout().lock()),
    }
}

/// What is compared with what: the arguments with their defaults.
#[derive(Debug)]
struct Plan {
    /// Directory of real trials.
    data: Option<PathBuf>,
    /// Sensors of simulated ones.
    noise: Vec<Preset>,
    seeds: u64,
    contenders: Vec<Contender>,
    settings: JointAngleSettings,
    /// The noise model that the settings name.
    inputs: Inputs,
}

fn joint_angles(args: &JointAngleArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let plan = plan(args)?;
    let sources = sources_of(&plan)?;
    let watch = Watch::new(sources.len() as u64);
    let outcomes = run_contenders(&sources, &plan.contenders, &plan.settings, &plan.inputs, || watch.one_more());
    watch.finish();
    let evaluation = outcomes.summarize();
    report_gaps(&evaluation);
    if let Some(directory) = &args.svg {
        write_figures(&figures::draw(&outcomes, &evaluation)?, directory)?;
    }
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&document::document(&plan, &evaluation))?)?;
        return Ok(());
    }
    table::agreement(&evaluation, out)?;
    if args.table2 {
        table::errors(&evaluation, out)?;
    }
    table::overview(&evaluation, out)?;
    table::segment_lengths(&evaluation, out)?;
    verdict_table::print(evaluation.verdict.as_ref(), out)?;
    Ok(())
}

fn plan(args: &JointAngleArgs) -> anyhow::Result<Plan> {
    if args.noise.is_some() && !args.simulated && !args.table2 {
        bail!("--noise is of simulated exercises; add --simulated");
    }
    // Table 2 without a choice is all of it.
    let real = if args.table2 { args.data.is_some() || !args.simulated } else { !args.simulated };
    let simulated = args.simulated || args.table2 && args.data.is_none();
    if args.data.is_some() && args.simulated && !args.table2 {
        bail!("give --data or --simulated; both in one run is --table2 --data DIR --simulated");
    }
    let noise = match (&args.noise, args.table2) {
        (Some(noise), _) => noise.0.clone(),
        (None, true) => Preset::OF_JOINT_ANGLES.to_vec(),
        (None, false) => vec![Preset::Table1],
    };
    let particles = match (&args.particles[..], args.table2) {
        ([], true) => &PAPER_PARTICLES[..],
        (given, _) => given,
    };
    let mut settings = JointAngleSettings {
        seed: args.seed,
        noise_model: args.noise_model.as_ref().map(NoiseModelChoice::name),
        ..JointAngleSettings::default()
    };
    // One number is a setting of the run; several are contenders of their own.
    let counts = match particles {
        [one] if !args.table2 => {
            settings.particles = Some(*one);
            &[]
        }
        several => several,
    };
    let mut contenders = Vec::new();
    let named = match (&args.methods[..], args.table2) {
        ([], true) => Contender::table2(counts),
        ([], false) => Contender::all(),
        (named, _) => named.to_vec(),
    };
    for contender in named.into_iter().flat_map(|contender| contender.with_each(counts)) {
        if !contenders.contains(&contender) {
            contenders.push(contender);
        }
    }
    Ok(Plan {
        data: if real { data_directory(args)? } else { None },
        noise: if simulated { noise } else { Vec::new() },
        seeds: args.seeds.unwrap_or(if args.table2 { 6 } else { 3 }),
        contenders,
        settings,
        inputs: Inputs {
            noise_model: args.noise_model.as_ref().and_then(NoiseModelChoice::model),
            ..Inputs::default()
        },
    })
}

/// Directory of the data; none when nobody asked for it, it is not there, and simulated exercises run anyway.
fn data_directory(args: &JointAngleArgs) -> anyhow::Result<Option<PathBuf>> {
    let usual = || std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let directory = args.data.clone().unwrap_or_else(usual);
    if directory.is_dir() {
        return Ok(Some(directory));
    }
    let told = format!("there is no directory {}", directory.display());
    if args.table2 && args.data.is_none() {
        eprintln!("no real recordings: {told}; give the data sets' directory with SUREFOOT_DATA");
        return Ok(None);
    }
    bail!("{told}; give the data sets' directory with --data or SUREFOOT_DATA, or use --simulated")
}

fn sources_of(plan: &Plan) -> anyhow::Result<Vec<TrialSource>> {
    let mut found = match &plan.data {
        Some(directory) => sources::imported(directory)?,
        None => Vec::new(),
    };
    for noise in &plan.noise {
        found.extend(sources::simulated(*noise, plan.seeds));
    }
    Ok(found)
}

/// Says on standard error what is not in the tables.
fn report_gaps(evaluation: &Evaluation) {
    for failure in &evaluation.failures {
        let method = failure.method.as_deref().unwrap_or("loading");
        eprintln!("failed: {} ({method}): {}", failure.trial, failure.reason);
    }
    if evaluation.n_without_reference > 0 {
        eprintln!("left out: {} trials without reference angles of hips or knees", evaluation.n_without_reference);
    }
}

fn write_figures(figures: &[figures::Figure], directory: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(directory).with_context(|| format!("cannot make {}", directory.display()))?;
    for figure in figures {
        let file = directory.join(format!("{}.svg", figure.name));
        fs::write(&file, &figure.svg).with_context(|| format!("cannot write {}", file.display()))?;
    }
    eprintln!("{} figures in {}", figures.len(), directory.display());
    Ok(())
}

#[cfg(test)]
mod tests;
