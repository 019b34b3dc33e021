//! `surefoot evaluate orientation`: orientation filters beside optical orientation.

use crate::estimation::orientation_filter::{InertialSamples, OrientationMethod, estimate};
use crate::evaluation::orientation::trial::trials;
use crate::evaluation::orientation::{OrientationErrors, OrientationTrial, errors};
use crate::recording::import::{Dataset, ImportError, list};
use anyhow::{Context, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Data sets with an optical orientation, and whether its frame and clock are the unit's already.
const DATASETS: [(Dataset, bool); 3] = [(Dataset::Broad, true), (Dataset::Repoimu, false), (Dataset::RingChain, false)];

/// Compare orientation filters with the optical orientation of inertial units.
///
/// Prints, for each set and method, the means over the trials of two root mean square errors in degrees: the whole error
/// after one constant heading was taken out of each trial, and the error of inclination, which is what is left when
/// heading does not count at all. Samples count where the data set says that there was movement, otherwise from 5 s
/// on. Magnetometers are not used. `gyroscope` is the baseline: rates integrated, nothing corrected.
///
/// The references of repoimu and ring_chain are first brought to the unit's frame, clock and vertical, from the
/// movement and without any filter; those of broad are taken as they are.
///
/// Samples per second are those of this run on one core: compare them within one run only.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot evaluate orientation --data ../shared/data\n  \
    surefoot evaluate orientation --methods madgwick,smoother --trials\n  \
    surefoot evaluate orientation --json > orientation.json")]
pub(super) struct OrientationArgs {
    /// Directory of the data sets, or of one of them (broad, repoimu, ring_chain) [default: $SUREFOOT_DATA, else
    /// ../shared/data]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Methods, comma separated [default: all]
    #[arg(long, value_delimiter = ',', value_name = "LIST", value_parser = method_parser())]
    methods: Vec<OrientationMethod>,
    /// Print every trial too
    #[arg(long)]
    trials: bool,
    /// Print one JSON object with every trial
    #[arg(long)]
    json: bool,
}

fn method_parser() -> impl TypedValueParser<Value = OrientationMethod> {
    PossibleValuesParser::new(OrientationMethod::ALL.map(OrientationMethod::name)).map(|name| {
        let found = OrientationMethod::ALL.into_iter().find(|method| method.name() == name);
        found.unwrap_or_default()
    })
}

/// What one method did.
struct Outcome {
    method: OrientationMethod,
    /// Errors of each trial, in the order of the trials; none when nothing could be compared.
    errors: Vec<Option<OrientationErrors>>,
    samples_per_second: f64,
}

pub(super) fn run(args: &OrientationArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let usual = || std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let directory = args.data.clone().unwrap_or_else(usual);
    let trials = read(&directory)?;
    let methods = if args.methods.is_empty() { OrientationMethod::ALL.to_vec() } else { args.methods.clone() };
    let mut outcomes = Vec::new();
    for method in methods {
        outcomes.push(evaluate(method, &trials)?);
    }
    if args.json {
        return write_json(&trials, &outcomes, out);
    }
    write_table(&trials, &outcomes, args.trials, out)
}

/// Every trial with an optical orientation below a directory.
fn read(directory: &Path) -> anyhow::Result<Vec<OrientationTrial>> {
    if !directory.is_dir() {
        bail!(
            "there is no directory {}; give the data sets' directory with --data or SUREFOOT_DATA",
            directory.display()
        );
    }
    let mut found = Vec::new();
    for (dataset, is_aligned) in DATASETS {
        let sources = match list(dataset, directory) {
            Ok(sources) => sources,
            Err(ImportError::NotFound { .. }) => continue,
            Err(error) => return Err(error.into()),
        };
        for source in sources {
            let recording = source.read()?.recording;
            found.extend(trials(dataset.name(), &source.name, &recording, is_aligned));
        }
    }
    if found.is_empty() {
        let names = DATASETS.map(|(dataset, _)| dataset.name()).join(", ");
        bail!("no trials of {names} below {}; give their directory with --data", directory.display());
    }
    // Sets stay together, in the order in which they were met.
    let mut sets: Vec<String> = Vec::new();
    for trial in &found {
        if !sets.contains(&trial.set) {
            sets.push(trial.set.clone());
        }
    }
    found.sort_by_key(|trial| sets.iter().position(|set| *set == trial.set));
    Ok(found)
}

fn evaluate(method: OrientationMethod, trials: &[OrientationTrial]) -> anyhow::Result<Outcome> {
    let mut seconds = 0.0;
    let mut n_samples = 0;
    let mut found = Vec::new();
    for trial in trials {
        let samples = InertialSamples {
            time_ns: &trial.time_ns,
            acceleration: &trial.acceleration,
            angular_rate: &trial.angular_rate,
        };
        let start = Instant::now();
        let estimate = estimate(method, &samples).with_context(|| format!("{} {}", trial.set, trial.name))?;
        seconds += start.elapsed().as_secs_f64();
        n_samples += trial.time_ns.len();
        found.push(errors(trial, &estimate.earth_from_sensor));
    }
    Ok(Outcome { method, errors: found, samples_per_second: n_samples as f64 / seconds.max(f64::MIN_POSITIVE) })
}

/// Set, number of trials, and mean errors (whole, inclination) of each set.
fn means(trials: &[OrientationTrial], outcome: &Outcome) -> Vec<(String, usize, [f64; 2])> {
    let mut means: Vec<(String, usize, [f64; 2])> = Vec::new();
    for (trial, errors) in trials.iter().zip(&outcome.errors) {
        let Some(errors) = errors else { continue };
        if means.last().is_none_or(|(set, ..)| *set != trial.set) {
            means.push((trial.set.clone(), 0, [0.0; 2]));
        }
        if let Some((_, n, sums)) = means.last_mut() {
            *n += 1;
            *sums = [sums[0] + errors.total_deg, sums[1] + errors.inclination_deg];
        }
    }
    means.into_iter().map(|(set, n, sums)| (set, n, sums.map(|sum| sum / n as f64))).collect()
}

fn write_table(
    trials: &[OrientationTrial],
    outcomes: &[Outcome],
    has_trials: bool,
    out: &mut dyn Write,
) -> anyhow::Result<()> {
    writeln!(out, "{:<12} {:<22} {:>6} {:>8} {:>12}", "method", "set", "trials", "total", "inclination")?;
    for outcome in outcomes {
        for (set, n, [total, inclination]) in means(trials, outcome) {
            writeln!(out, "{:<12} {set:<22} {n:>6} {total:>8.2} {inclination:>12.2}", outcome.method.name())?;
            let of_set = trials.iter().zip(&outcome.errors).filter(|(trial, _)| has_trials && trial.set == set);
            for (trial, errors) in of_set {
                if let Some(errors) = errors {
                    let OrientationErrors { total_deg, inclination_deg, .. } = errors;
                    writeln!(out, "  {:<39} {total_deg:>8.2} {inclination_deg:>12.2}", trial.name)?;
                }
            }
        }
    }
    writeln!(out, "\nRoot mean squares in degrees, means over trials, one constant heading taken out of each.\n")?;
    for outcome in outcomes {
        writeln!(out, "{:<12} {:>6.1} million samples/s", outcome.method.name(), outcome.samples_per_second * 1e-6)?;
    }
    Ok(())
}

fn write_json(trials: &[OrientationTrial], outcomes: &[Outcome], out: &mut dyn Write) -> anyhow::Result<()> {
    let methods = outcomes.iter().map(|outcome| {
        let sets = means(trials, outcome).into_iter().map(|(set, n_trials, [total_deg, inclination_deg])| {
            json!({ "set": set, "n_trials": n_trials, "total_deg": total_deg, "inclination_deg": inclination_deg })
        });
        let trials = trials.iter().zip(&outcome.errors);
        let trials = trials.map(|(trial, errors)| json!({ "set": trial.set, "trial": trial.name, "errors": errors }));
        json!({
            "method": outcome.method.name(),
            "sets": sets.collect::<Vec<_>>(),
            "trials": trials.collect::<Vec<_>>(),
            "samples_per_second": outcome.samples_per_second,
        })
    });
    let document = json!({ "methods": methods.collect::<Vec<_>>(), "version": env!("CARGO_PKG_VERSION") });
    writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The data sets of inertial units; says so when they are not there.
    fn data() -> Option<PathBuf> {
        let directory = std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
        let has_data = directory.join("imu/broad").is_dir();
        if !has_data {
            println!("skipped: no inertial recordings below {}", directory.display());
        }
        has_data.then_some(directory)
    }

    #[test]
    fn a_directory_that_is_not_there_is_named() {
        let args = OrientationArgs { data: Some("no/such".into()), methods: Vec::new(), trials: false, json: false };
        let error = run(&args, &mut Vec::new()).unwrap_err().to_string();
        assert!(error.contains("no/such"), "{error}");
    }

    #[test]
    fn the_default_keeps_its_accuracy_on_every_set() {
        let Some(data) = data() else { return };
        let trials = read(&data).unwrap();
        let outcome = evaluate(OrientationMethod::default(), &trials).unwrap();
        // Degrees, whole and inclination: what the best published filter reaches on the same recordings.
        let limits = [
            ("broad", 2.72, 0.95),
            ("repoimu", 0.62, 0.28),
            ("ring_chain rigid", 4.45, 1.60),
            ("ring_chain on foam", 4.77, 2.49),
        ];
        let means = means(&trials, &outcome);
        for (set, max_total, max_inclination) in limits {
            let Some((_, _, [total, inclination])) = means.iter().find(|(name, ..)| name == set) else { continue };
            assert!(*total <= max_total && *inclination <= max_inclination, "{set}: {total}, {inclination}");
        }
        assert!(!means.is_empty());
    }
}
