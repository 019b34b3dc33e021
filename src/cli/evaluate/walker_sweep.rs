//! `surefoot evaluate walker --conditions`: the default tracker on walks that are hard in one way each.

use crate::assessment::LegPoseSettings;
use crate::evaluation::walker::scores::{SequenceScore, score};
use crate::evaluation::walker::sequences::Condition;
use crate::synthetic::walker::{Body, WalkerSimulation};
use rayon::prelude::*;
use std::io::Write;

/// Bars of the tracker, metres: step length, step width, ankles; then length and width with 30 % of the pixels missing.
const BARS_M: [f64; 5] = [0.012, 0.010, 0.03, 0.030, 0.020];

/// One walk under one condition, by one of the figures.
struct Sequence {
    condition: Condition,
    seed: u64,
    figure: &'static str,
    outcome: Result<SequenceScore, String>,
}

/// Scores every condition with every seed; figures (name and body) take turns.
///
/// # Errors
/// When a walk cannot be simulated or `out` not be written.
pub(super) fn run(
    conditions: &[Condition],
    seeds: &[u64],
    figures: &[(&'static str, Body)],
    as_json: bool,
    out: &mut dyn Write,
) -> anyhow::Result<()> {
    let walks: Vec<(Condition, u64)> =
        conditions.iter().flat_map(|condition| seeds.iter().map(move |seed| (*condition, *seed))).collect();
    let sequences: Vec<Sequence> = walks
        .into_par_iter()
        .map(|(condition, seed)| {
            let turn = Condition::ALL.iter().position(|c| *c == condition).unwrap_or(0) as u64 + seed;
            let (figure, body) = &figures[turn as usize % figures.len()];
            let simulation = WalkerSimulation::new(&condition.settings(seed), body.clone())?;
            let outcome = score(&simulation, condition.has_background(), &LegPoseSettings::default());
            Ok(Sequence { condition, seed, figure, outcome: outcome.map_err(|error| error.to_string()) })
        })
        .collect::<anyhow::Result<_>>()?;
    if as_json {
        let documents: Vec<serde_json::Value> = sequences.iter().map(document).collect();
        writeln!(out, "{}", serde_json::to_string_pretty(&documents)?)?;
        return Ok(());
    }
    writeln!(
        out,
        "{:<18}{:>5} {:<9}{:>13}{:>20}{:>20}{:>14}{:>6}{:>12}{:>14}{:>7}{:>12}",
        "condition",
        "seed",
        "figure",
        "baseline, cm",
        "length, cm",
        "width, cm",
        "ankle, cm",
        "lost",
        "held, %",
        "steps",
        "used",
        "step, cm"
    )?;
    sequences.iter().try_for_each(|sequence| write_row(sequence, out))?;
    writeln!(
        out,
        "\nbaseline: mean absolute error of length / width with both feet down. length, width: mean absolute error (SD) of \
         the tracker in the same frames. ankle: mean / 95th percentile in space. lost: frames without both legs. held: \
         95 % intervals that hold the truth, of ankle coordinates / of length and width. steps: found / true contacts, and \
         +n found where none was. used: steps in the means / those that should be. step: mean absolute error of the used \
         steps' length, ankle to ankle / footprint to footprint."
    )?;
    write_verdict(&sequences, out)
}

fn cm(metres: f64) -> f64 {
    100.0 * metres
}

fn write_row(sequence: &Sequence, out: &mut dyn Write) -> std::io::Result<()> {
    let Sequence { condition, seed, figure, outcome } = sequence;
    let score = match outcome {
        Ok(score) => score,
        Err(problem) => return writeln!(out, "{:<18}{seed:>5} {figure:<9}{problem}", condition.name()),
    };
    let pair = |[a, b]: [f64; 2]| format!("{:.2} / {:.2}", cm(a), cm(b));
    let with_deviation = |[mean, sd]: [f64; 2]| format!("{:.2} ({:.2})", cm(mean), cm(sd));
    writeln!(
        out,
        "{:<18}{seed:>5} {figure:<9}{:>13}{:>20}{:>20}{:>14}{:>6}{:>12}{:>14}{:>7}{:>12}",
        condition.name(),
        pair([score.baseline.length_m[0], score.baseline.width_m[0]]),
        with_deviation(score.tracked.length_m),
        with_deviation(score.tracked.width_m),
        pair(score.ankle_m),
        score.n_lost,
        format!("{:.0} / {:.0}", 100.0 * score.held[0], 100.0 * score.held[1]),
        format!("{}/{} +{}", score.n_found, score.n_true_steps, score.n_false),
        format!("{}/{}", score.n_used[0], score.n_used[1]),
        pair([score.steps[0].absolute_m[0], score.steps[1].absolute_m[0]]),
    )
}

/// What a sequence falls short of; nothing when it meets every bar.
fn shortcomings(sequence: &Sequence) -> Vec<String> {
    let score = match &sequence.outcome {
        Ok(score) => score,
        Err(problem) => return vec![format!("not assessed: {problem}")],
    };
    let [length, width, ankle, missing_length, missing_width] = BARS_M;
    let (length, width) =
        if sequence.condition == Condition::Missing { (missing_length, missing_width) } else { (length, width) };
    let mut found = Vec::new();
    let mut check = |is_short: bool, what: &str| {
        if is_short {
            found.push(what.to_owned());
        }
    };
    check(!score.beats_baseline(), "not better than the baseline");
    check(score.tracked.length_m[0] > length, "step length above its bar");
    check(score.tracked.width_m[0] > width, "step width above its bar");
    check(score.ankle_m[0] > ankle, "ankles above their bar");
    check(score.n_lost > 0, "frames without both legs");
    check(score.n_false > 0, "steps that did not happen");
    check(score.n_wrongly_used > 0, "steps at an end or in a turn are used");
    found
}

fn write_verdict(sequences: &[Sequence], out: &mut dyn Write) -> anyhow::Result<()> {
    let scores: Vec<&SequenceScore> = sequences.iter().filter_map(|sequence| sequence.outcome.as_ref().ok()).collect();
    let n = scores.len().max(1) as f64;
    let mean = |value: &dyn Fn(&SequenceScore) -> f64| scores.iter().map(|s| value(s)).sum::<f64>() / n;
    writeln!(
        out,
        "\nMean of {} sequences: step length {:.2} cm (baseline {:.2}), step width {:.2} cm (baseline {:.2}), ankles {:.2} cm",
        scores.len(),
        cm(mean(&|s| s.tracked.length_m[0])),
        cm(mean(&|s| s.baseline.length_m[0])),
        cm(mean(&|s| s.tracked.width_m[0])),
        cm(mean(&|s| s.baseline.width_m[0])),
        cm(mean(&|s| s.ankle_m[0])),
    )?;
    let sum = |value: &dyn Fn(&SequenceScore) -> usize| scores.iter().map(|s| value(s)).sum::<usize>();
    writeln!(
        out,
        "Steps: {} of {} found, {} that did not happen; heel strikes {:+.0} ms, toe offs {:+.0} ms from the true ones",
        sum(&|s| s.n_found),
        sum(&|s| s.n_true_steps),
        sum(&|s| s.n_false),
        1e3 * mean(&|s| s.heel_strike_s[0]),
        1e3 * mean(&|s| s.toe_off_s[0]),
    )?;
    for (k, name) in ["ankle to ankle", "footprint to footprint"].into_iter().enumerate() {
        let n_steps = sum(&|s| s.steps[k].n_steps);
        let weighted = |axis: usize| {
            let total: f64 = scores.iter().map(|s| s.steps[k].absolute_m[axis] * s.steps[k].n_steps as f64).sum();
            cm(total / n_steps.max(1) as f64)
        };
        let held = |axis: usize| 100.0 * sum(&|s| s.steps[k].n_held[axis]) as f64 / n_steps.max(1) as f64;
        writeln!(
            out,
            "{name}: {n_steps} steps, length {:.2} cm (intervals hold {:.0} %), width {:.2} cm ({:.0} %)",
            weighted(0),
            held(0),
            weighted(1),
            held(1)
        )?;
    }
    let short: Vec<(&Sequence, Vec<String>)> =
        sequences.iter().map(|s| (s, shortcomings(s))).filter(|(_, found)| !found.is_empty()).collect();
    writeln!(out, "{} of {} sequences meet every bar", sequences.len() - short.len(), sequences.len())?;
    for (sequence, found) in short {
        writeln!(out, "  {} {} ({}): {}", sequence.condition.name(), sequence.seed, sequence.figure, found.join("; "))?;
    }
    Ok(())
}

fn document(sequence: &Sequence) -> serde_json::Value {
    let Sequence { condition, seed, figure, outcome } = sequence;
    let mut document = serde_json::json!({ "condition": condition.name(), "seed": seed, "figure": figure });
    let score = match outcome {
        Ok(score) => score,
        Err(problem) => {
            document["problem"] = serde_json::json!(problem);
            return document;
        }
    };
    let distances = |errors: &crate::evaluation::walker::scores::DistanceErrors| {
        serde_json::json!({
            "n_frames": errors.n_frames,
            "step_length_error_m": { "mean": errors.length_m[0], "sd": errors.length_m[1], "bias": errors.bias_m[0] },
            "step_width_error_m": { "mean": errors.width_m[0], "sd": errors.width_m[1], "bias": errors.bias_m[1] },
        })
    };
    document["baseline"] = distances(&score.baseline);
    document["tracked"] = distances(&score.tracked);
    document["ankle_error_m"] = serde_json::json!({ "mean": score.ankle_m[0], "p95": score.ankle_m[1] });
    document["n_frames"] = serde_json::json!(score.n_frames);
    document["n_lost"] = serde_json::json!(score.n_lost);
    document["interval_coverage"] = serde_json::json!({ "ankles": score.held[0], "distances": score.held[1] });
    document["steps"] = serde_json::json!({
        "n_true": score.n_true_steps,
        "n_found": score.n_found,
        "n_false": score.n_false,
        "n_used": score.n_used[0],
        "n_to_use": score.n_used[1],
        "heel_strike_error_s": { "mean": score.heel_strike_s[0], "sd": score.heel_strike_s[1] },
        "toe_off_error_s": { "mean": score.toe_off_s[0], "sd": score.toe_off_s[1] },
    });
    document["shortcomings"] = serde_json::json!(shortcomings(sequence));
    document
}
