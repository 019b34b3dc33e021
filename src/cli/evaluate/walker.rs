//! `surefoot evaluate walker`: tracked legs beside the truth of simulated walks.

use super::walker_sweep;
use crate::evaluation::walker::MethodErrors;
use crate::evaluation::walker::comparison::{WalkError, compare};
use crate::evaluation::walker::method::WalkerMethod;
use crate::evaluation::walker::sequences::Condition;
use crate::synthetic::walker::cesium::body_from_glb;
use crate::synthetic::walker::trousers::trousers;
use crate::synthetic::walker::{Course, WalkerSettings, WalkerSimulation};
use anyhow::Context;
use std::fs;
use std::io::Write;
use std::path::PathBuf;

/// Compare tracked legs with the truth of simulated walks, in the shape of the paper's Tables 2 and 3.
///
/// Each sequence is a person, clothes, gait, camera mount and sensor noise of its own, drawn from the seed. Errors are
/// absolute errors of the distance of the ankles in floor axes, over the frames with both feet on the floor. `baseline`
/// has no model and no filter: the foreground is split into two legs, and the lowest part of each is the foot.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surefoot evaluate walker\n  surefoot evaluate walker --seeds 3 --missing 0.3 --json\n  \
    surefoot evaluate walker --methods baseline,fitted,cue1,cue2,both,rgb --particles 5000\n  \
    surefoot evaluate walker --conditions all --seeds 2\n  surefoot evaluate walker --conditions turn,narrow --first-seed 9 --seeds 1"
)]
pub(super) struct WalkerArgs {
    /// The figure that walks [default: depth/assets/CesiumMan.glb below $SUREFOOT_DATA, else ../shared/data]
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Sequences
    #[arg(long, default_value_t = 6, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// The first of the seeds
    #[arg(long, default_value_t = 1, value_name = "N")]
    first_seed: u64,
    /// Judge the default tracker on walks that are hard in one way each, by both figures, steps and intervals included:
    /// names separated by commas, or `all`; the other options but --figure, --seeds and --json do not apply
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = conditions)]
    conditions: Vec<Vec<Condition>>,
    /// Share of the legs' pixels that are missing, 0 to 0.9
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    missing: f64,
    /// Tilt of the camera downwards, degrees [default: the seed's, 0 to 15]
    #[arg(long, value_name = "DEG")]
    tilt: Option<f64>,
    /// Length of each sequence, seconds
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    seconds: f64,
    /// Methods to compare, separated by commas: baseline, fitted (the default), and the paper's cue1, cue2, both, rgb
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "baseline,fitted")]
    methods: Vec<WalkerMethod>,
    /// Particles of the paper's methods
    #[arg(long, default_value_t = 5000, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=65536))]
    particles: u32,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &WalkerArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let usual = || {
        let data = std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
        data.join("depth/assets/CesiumMan.glb")
    };
    let path = args.figure.clone().unwrap_or_else(usual);
    let bytes = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let body = body_from_glb(&bytes)?;
    let seeds = args.first_seed..args.first_seed + args.seeds;
    if !args.conditions.is_empty() {
        let figures = [("trousers", trousers()), ("cesium", body)];
        let seeds: Vec<u64> = seeds.collect();
        return walker_sweep::run(&args.conditions.concat(), &seeds, &figures, args.json, out);
    }
    let mut sequences = Vec::new();
    for seed in seeds {
        let mut settings = WalkerSettings::of_seed(Course::Straight, seed);
        if let Some(tilt) = args.tilt {
            settings = settings.with_tilt(tilt.to_radians());
        }
        settings.duration_s = args.seconds;
        settings.errors.missing_share = args.missing;
        let simulation = WalkerSimulation::new(&settings, body.clone())?;
        sequences.push((seed, compare(&simulation, &args.methods, args.particles)));
    }
    if args.json {
        let documents: Vec<serde_json::Value> = sequences
            .iter()
            .map(|(seed, outcome)| match outcome {
                Ok(methods) => {
                    let methods: Vec<serde_json::Value> = methods.iter().map(document).collect();
                    serde_json::json!({ "seed": seed, "methods": methods })
                }
                Err(error) => serde_json::json!({ "seed": seed, "problem": error.to_string() }),
            })
            .collect();
        writeln!(out, "{}", serde_json::to_string_pretty(&documents)?)?;
        return Ok(());
    }
    writeln!(
        out,
        "{:<6}{:<10}{:>11}{:>16}{:>16}{:>16}{:>10}{:>6}",
        "walk", "method", "frames", "length, cm", "width, cm", "all frames, cm", "ankle, cm", "lost"
    )?;
    for (seed, outcome) in &sequences {
        match outcome {
            Ok(methods) => methods.iter().try_for_each(|errors| write_row(*seed, errors, out))?,
            Err(error) => writeln!(out, "{seed:<6}{error}")?,
        }
    }
    writeln!(
        out,
        "\nMean absolute error (standard deviation) with both feet on the floor; all frames: length / width."
    )?;
    write_paper_table("Step length error, cm (Table 2 of the paper)", &args.methods, &sequences, |e| e.length_m, out)?;
    write_paper_table("Step width error, cm (Table 3 of the paper)", &args.methods, &sequences, |e| e.width_m, out)?;
    Ok(())
}

/// A walk and what became of it.
type Sequence = (u64, Result<Vec<MethodErrors>, WalkError>);

/// Mean and standard deviation by walk and method, in the shape of the paper's tables; below them the means over the walks.
fn write_paper_table(
    title: &str,
    methods: &[WalkerMethod],
    sequences: &[Sequence],
    value: fn(&MethodErrors) -> [f64; 2],
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let mut line = |first: &str, second: &str, cells: &mut dyn Iterator<Item = String>| {
        write!(out, "{first:<6}{second:<6}")?;
        for cell in cells {
            write!(out, "{cell:>10}")?;
        }
        writeln!(out)
    };
    line(&format!("\n{title}"), "", &mut std::iter::empty())?;
    line("walk", "", &mut methods.iter().map(|method| method.name().to_owned()))?;
    let cell = |metres: f64| format!("{:.2}", 100.0 * metres);
    let found: Vec<_> = sequences.iter().filter_map(|(seed, outcome)| Some((seed, outcome.as_ref().ok()?))).collect();
    for (seed, methods) in &found {
        line(&seed.to_string(), "Mean", &mut methods.iter().map(|errors| cell(value(errors)[0])))?;
        line("", "Std", &mut methods.iter().map(|errors| cell(value(errors)[1])))?;
    }
    if found.len() > 1 {
        let mean = |k: usize| found.iter().map(|(_, methods)| value(&methods[k])[0]).sum::<f64>() / found.len() as f64;
        line("all", "Mean", &mut (0..methods.len()).map(|k| cell(mean(k))))?;
    }
    Ok(())
}

/// The condition of a name; all of them for `all`.
fn conditions(name: &str) -> Result<Vec<Condition>, String> {
    if name == "all" {
        return Ok(Condition::ALL.to_vec());
    }
    let found = Condition::ALL.into_iter().find(|condition| condition.name() == name);
    found.map(|condition| vec![condition]).ok_or_else(|| {
        let names = Condition::ALL.map(Condition::name).join(", ");
        format!("there is no condition `{name}`; there are all, {names}")
    })
}

fn write_row(seed: u64, errors: &MethodErrors, out: &mut dyn Write) -> std::io::Result<()> {
    let cm = |metres: f64| 100.0 * metres;
    let with_deviation = |[mean, sd]: [f64; 2]| format!("{:.2} ({:.2})", cm(mean), cm(sd));
    writeln!(
        out,
        "{seed:<6}{:<10}{:>11}{:>16}{:>16}{:>16}{:>10}{:>6}",
        errors.method,
        format!("{}/{}", errors.n_frames[0], errors.n_frames[1]),
        with_deviation(errors.length_m),
        with_deviation(errors.width_m),
        format!("{:.2} / {:.2}", cm(errors.all_frames_m[0]), cm(errors.all_frames_m[1])),
        errors.ankle_m.map_or("-".to_owned(), |metres| format!("{:.2}", cm(metres))),
        errors.n_lost
    )
}

fn document(errors: &MethodErrors) -> serde_json::Value {
    serde_json::json!({
        "method": errors.method,
        "n_frames": errors.n_frames[1],
        "n_estimated": errors.n_frames[0],
        "step_length_error_m": { "mean": errors.length_m[0], "sd": errors.length_m[1] },
        "step_width_error_m": { "mean": errors.width_m[0], "sd": errors.width_m[1] },
        "all_frames_m": { "step_length": errors.all_frames_m[0], "step_width": errors.all_frames_m[1] },
        "ankle_error_m": errors.ankle_m,
        "n_lost": errors.n_lost,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_have_a_mean_and_a_deviation_for_each_walk_and_a_column_for_each_method() {
        let errors = |method, mean: f64| MethodErrors {
            method,
            n_frames: [10, 10],
            length_m: [mean, 0.01],
            width_m: [0.5 * mean, 0.02],
            all_frames_m: [mean; 2],
            ankle_m: None,
            n_lost: 0,
        };
        let methods: Vec<WalkerMethod> = ["cue1", "both"].map(|name| name.parse().unwrap()).into();
        let walk = |seed, mean| (seed, Ok(vec![errors("cue1", 2.0 * mean), errors("both", mean)]));
        let mut out = Vec::new();
        write_paper_table("Step length", &methods, &[walk(4, 0.02), walk(7, 0.04)], |e| e.length_m, &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let words: Vec<Vec<&str>> = text.lines().skip(2).map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(words[0], ["walk", "cue1", "both"]);
        assert_eq!(words[1], ["4", "Mean", "4.00", "2.00"]);
        assert_eq!(words[2], ["Std", "1.00", "1.00"]);
        assert_eq!(words[5], ["all", "Mean", "6.00", "3.00"]);
    }
}
