//! `surefoot evaluate protocols`: recognition, counts and times of exercises and tests.

use super::sources::{imported, simulated};
use crate::evaluation::protocols::{Chain, ProtocolTrial, chains, evaluate};
use crate::recording::Recording;
use crate::synthetic::Preset;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

/// Compare what the catalogue of exercises and tests finds with what is known of recordings.
///
/// For each exercise: trials; how many were recognised; how many have the right number of repetitions; median and largest
/// difference of starts, peaks and ends from those that the same rule finds in the reference angles; what else the movement was
/// taken for. Then, for each exercise, how many of its trials would get numbers when declared as each protocol. Last, the
/// five-times sit-to-stand of persons whose single repetitions were put after each other.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot evaluate protocols --data ../shared/data\n  \
    surefoot evaluate protocols --json > protocols.json")]
pub(super) struct ProtocolArgs {
    /// Directory of the data sets, or of one of them (uiprmd, utdmhad, keraal, cmu) [default: $SUREFOOT_DATA, else
    /// ../shared/data]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Simulated subjects for each exercise and sensor
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(0..=1000))]
    seeds: u64,
    /// Print one JSON object with every trial
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &ProtocolArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let usual = || std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let mut sources = imported(&args.data.clone().unwrap_or_else(usual))?;
    for noise in Preset::OF_JOINT_ANGLES {
        sources.extend(simulated(noise, args.seeds));
    }
    let mut rows = Vec::new();
    let mut sit_to_stand: Vec<(String, Recording)> = Vec::new();
    for source in &sources {
        let trial = source.load().map_err(anyhow::Error::msg)?;
        rows.push(evaluate(&source.name, &trial.exercise, &trial.recording));
        if trial.exercise == "m05_sit_to_stand" {
            // uiprmd m05_s01_e02
            let subject = source.name.split('_').nth(1).unwrap_or(&source.name).to_owned();
            sit_to_stand.push((subject, trial.recording));
        }
    }
    let chains = chains(&sit_to_stand);
    if args.json {
        let document = json!({ "trials": rows, "five_times": chains, "version": env!("CARGO_PKG_VERSION") });
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
        return Ok(());
    }
    write_exercises(&rows, out)?;
    write_matrix(&rows, out)?;
    write_chains(&chains, out)
}

/// Trials by exercise, in the order of their names.
fn by_exercise(rows: &[ProtocolTrial]) -> BTreeMap<String, Vec<&ProtocolTrial>> {
    let mut groups: BTreeMap<String, Vec<&ProtocolTrial>> = BTreeMap::new();
    for row in rows {
        // Simulated exercises are told apart by their sensor.
        let sensor = row.trial.strip_prefix("simulated-").and_then(|name| name.split(' ').next());
        let name = sensor.map_or(row.exercise.clone(), |sensor| format!("{} {sensor}", row.exercise));
        groups.entry(name).or_default().push(row);
    }
    groups
}

fn write_exercises(rows: &[ProtocolTrial], out: &mut dyn Write) -> anyhow::Result<()> {
    writeln!(
        out,
        "{:<36} {:<24} {:>6} {:>10} {:>11} {:>22} {:>22} {:>22}  also taken for",
        "exercise",
        "protocol",
        "trials",
        "recognised",
        "right count",
        "start med, max s",
        "peak med, max s",
        "end med, max s"
    )?;
    for (name, rows) in by_exercise(rows) {
        let expected = rows[0].expected;
        let n_recognised = rows.iter().filter(|r| expected.is_some_and(|id| r.recognized.contains(&id))).count();
        let counted: Vec<_> = rows.iter().filter_map(|row| Some((row.n_repetitions, row.n_expected?))).collect();
        let n_right = counted.iter().filter(|(found, expected)| found == expected).count();
        let errors: Vec<[f64; 3]> = rows.iter().flat_map(|row| row.time_errors_s.iter().copied()).collect();
        let [start, peak, end] = [0, 1, 2].map(|i| spread(errors.iter().map(|error| error[i]).collect()));
        let mut others: BTreeMap<&str, usize> = BTreeMap::new();
        for id in rows.iter().flat_map(|row| &row.recognized).filter(|id| Some(**id) != expected) {
            *others.entry(id).or_default() += 1;
        }
        let others: Vec<String> = others.iter().map(|(id, n)| format!("{id} {n}")).collect();
        writeln!(
            out,
            "{name:<36} {:<24} {:>6} {:>10} {:>11} {start:>22} {peak:>22} {end:>22}  {}",
            expected.unwrap_or("-"),
            rows.len(),
            if expected.is_some() { n_recognised.to_string() } else { "-".to_owned() },
            if counted.is_empty() { "-".to_owned() } else { format!("{n_right}/{}", counted.len()) },
            others.join(", "),
        )?;
        for row in rows.iter().filter(|row| row.failure.is_some()) {
            writeln!(out, "  {}: {}", row.trial, row.failure.as_deref().unwrap_or_default())?;
        }
    }
    Ok(())
}

/// Median and largest size of differences, in words.
fn spread(mut errors: Vec<f64>) -> String {
    errors.sort_unstable_by(f64::total_cmp);
    let Some(median) = errors.get(errors.len() / 2) else { return "-".to_owned() };
    let largest = errors.iter().fold(0.0, |most: f64, error| most.max(error.abs()));
    format!("{median:+.2}, {largest:.2}")
}

fn write_matrix(rows: &[ProtocolTrial], out: &mut dyn Write) -> anyhow::Result<()> {
    writeln!(out, "\ntrials that would get numbers when declared as another protocol than their own")?;
    for (name, rows) in by_exercise(rows) {
        let mut measured: BTreeMap<&str, usize> = BTreeMap::new();
        for row in &rows {
            for id in row.measured_as.iter().filter(|id| Some(**id) != row.expected) {
                *measured.entry(id).or_default() += 1;
            }
        }
        let measured: Vec<String> = measured.iter().map(|(id, n)| format!("{id} {n}")).collect();
        let measured = if measured.is_empty() { "none".to_owned() } else { measured.join(", ") };
        writeln!(out, "{name:<36} {:>4} trials: {measured}", rows.len())?;
    }
    Ok(())
}

fn write_chains(chains: &[Chain], out: &mut dyn Write) -> anyhow::Result<()> {
    writeln!(out, "\nfive-times sit-to-stand from single repetitions, seconds")?;
    writeln!(out, "{:<8} {:>6} {:>9} {:>9} {:>19}", "subject", "rises", "measured", "by knees", "by reference knees")?;
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    for chain in chains {
        writeln!(
            out,
            "{:<8} {:>6} {:>9} {:>9} {:>19}",
            chain.subject,
            chain.n_rises,
            number(chain.five_times_sit_to_stand_s),
            number(chain.by_knees_s),
            number(chain.by_reference_knees_s)
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_that_is_not_there_is_named() {
        let args = ProtocolArgs { data: Some("no/such".into()), seeds: 1, json: false };
        let error = run(&args, &mut Vec::new()).unwrap_err().to_string();
        assert!(error.contains("no/such"), "{error}");
    }
}
