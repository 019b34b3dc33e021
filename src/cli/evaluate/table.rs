//! Tables for people.

use crate::evaluation::error_analysis::{Gain, Spread};
use crate::evaluation::overview::PROMISED_COVERAGE;
use crate::evaluation::{Evaluation, MEASURE_NAMES, OverviewRow};
use std::io::{self, Write};

/// Agreement of every method, both sides together; the JSON output has each side as well.
pub(super) fn agreement(evaluation: &Evaluation, out: &mut dyn Write) -> io::Result<()> {
    let mut group = None;
    for row in &evaluation.rows {
        if row.measure.starts_with("left_") || row.measure.starts_with("right_") {
            continue;
        }
        let place = (&row.dataset, &row.exercise);
        if group != Some(place) {
            group = Some(place);
            writeln!(out, "\n{} {}", row.dataset, row.exercise)?;
            writeln!(
                out,
                "  {:<14} {:<19} {:>6} {:>6} {:>7} {:>8} {:>7} {:>7} {:>8} {:>6} {:>8}",
                "method", "angle", "trials", "failed", "frames", "coverage", "MAE", "RMSE", "no offs.", "r", "interval"
            )?;
        }
        writeln!(
            out,
            "  {:<14} {:<19} {:>6} {:>6} {:>7} {:>7.1}% {:>7} {:>7} {:>8} {:>6} {:>8}",
            row.method,
            row.measure,
            row.n_trials,
            row.n_failed,
            row.n_frames,
            100.0 * row.coverage,
            number(row.mae_deg, 2),
            number(row.rmse_deg, 2),
            number(row.rmse_without_offset_deg, 2),
            number(row.correlation, 3),
            row.interval_coverage.map_or("-".to_owned(), |share| format!("{:.1}%", 100.0 * share)),
        )?;
    }
    writeln!(
        out,
        "\nErrors in degrees, medians over trials; interval: share of 95 % intervals that hold the reference."
    )
}

/// The paper's Table 2: mean and quartiles of the absolute errors, and the gain over the middleware.
pub(super) fn errors(evaluation: &Evaluation, out: &mut dyn Write) -> io::Result<()> {
    let mut place = None;
    for row in &evaluation.errors {
        let next = (&row.dataset, row.side, &row.exercise);
        if place.is_none_or(|(dataset, side, _)| (dataset, side) != (next.0, next.1)) {
            writeln!(
                out,
                "\nTable 2: {}, {} side; absolute errors, mean (p25 to p75), degrees",
                row.dataset,
                row.side.name()
            )?;
            writeln!(
                out,
                "    {:<14} {:<19} {:<19} {:<19} {:<40} {:<19} {:<40}",
                "",
                "hip flexion",
                "hip abduction",
                "hip rotation",
                "hip gain over nite",
                "knee flexion",
                "knee gain over nite"
            )?;
        }
        if place != Some(next) {
            writeln!(out, "  {}", row.exercise)?;
        }
        place = Some(next);
        let line = format!(
            "    {:<14} {:<19} {:<19} {:<19} {:<40} {:<19} {:<40}",
            row.method,
            spread(row.hip_flexion),
            spread(row.hip_abduction),
            spread(row.hip_axial_rotation),
            gain(row.hip_gain),
            spread(row.knee_flexion),
            gain(row.knee_gain),
        );
        writeln!(out, "{}", line.trim_end())?;
    }
    writeln!(
        out,
        "\nGain: modulus of nite's error less that of the method's, with W (standardised rank sum) and p of Wilcoxon's \
         signed-rank\ntest over frames, as in the paper; neighbouring frames are alike, so p is smaller than the evidence."
    )
}

/// Each method over all exercises of a data set: one column for each angle, error and interval coverage.
pub(super) fn overview(evaluation: &Evaluation, out: &mut dyn Write) -> io::Result<()> {
    let mut dataset = None;
    let (mut promised, mut all) = (0, 0);
    let rows = &evaluation.overview;
    for first in rows.chunk_by(|a, b| a.dataset == b.dataset && a.method == b.method).map(|group| &group[0]) {
        if dataset != Some(&first.dataset) {
            dataset = Some(&first.dataset);
            writeln!(out, "\n{}, all exercises, both sides: MAE in degrees | intervals that hold", first.dataset)?;
            write!(out, "  {:<14}", "method")?;
            for (_, name) in MEASURE_NAMES {
                write!(out, " {name:>20}")?;
            }
            writeln!(out)?;
        }
        let mut line = format!("  {:<14}", first.method);
        for (measure, _) in MEASURE_NAMES {
            let same = |row: &&OverviewRow| (&row.dataset, &row.method) == (&first.dataset, &first.method);
            let found = rows.iter().filter(same).find(|row| row.measure == measure);
            let (mae, interval) = found.map_or((None, None), |row| (row.mae_deg, row.interval_coverage));
            let mark = match found.and_then(|row| row.interval_coverage_as_promised) {
                Some(true) => "  ",
                Some(false) => " !",
                None => "  ",
            };
            let interval = interval.map_or("-".to_owned(), |share| format!("{:.1}%", 100.0 * share));
            line += &format!(" {:>8} |{interval:>8}{mark}", number(mae, 2));
        }
        writeln!(out, "{}", line.trim_end())?;
    }
    let default = evaluation.verdict.as_ref().map(|verdict| verdict.default.as_str());
    for row in rows.iter().filter(|row| Some(row.method.as_str()) == default) {
        promised += usize::from(row.interval_coverage_as_promised == Some(true));
        all += usize::from(row.interval_coverage_as_promised.is_some());
    }
    writeln!(
        out,
        "\nMAE: mean over exercises of medians over trials. Intervals are 95 %; `!` marks shares outside {:.0} to {:.0} %.",
        100.0 * PROMISED_COVERAGE.start(),
        100.0 * PROMISED_COVERAGE.end(),
    )?;
    match default {
        Some(default) => writeln!(out, "{default}: {promised} of {all} shares are inside."),
        None => Ok(()),
    }
}

/// How constant the body's segments are.
pub(super) fn segment_lengths(evaluation: &Evaluation, out: &mut dyn Write) -> io::Result<()> {
    if !evaluation.segment_lengths.is_empty() {
        writeln!(out, "\nLargest deviation of a limb segment from its median length, millimetres")?;
    }
    for row in &evaluation.segment_lengths {
        // Rounding of f64 is below a billionth of a millimetre.
        let output = row.output_deviation_mm.map_or("-".to_owned(), |mm| format!("{mm:.9}"));
        writeln!(
            out,
            "  {:<20} recorded joints {:>7} (median over {} trials); output of {} {output} (largest of all)",
            row.dataset,
            number(row.recorded_deviation_mm, 1),
            row.n_trials,
            row.method,
        )?;
    }
    Ok(())
}

pub(super) fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

fn spread(spread: Option<Spread>) -> String {
    spread.map_or("-".to_owned(), |s| format!("{:.1} ({:.1} to {:.1})", s.mean_deg, s.p25_deg, s.p75_deg))
}

fn gain(gain: Option<Gain>) -> String {
    gain.map_or("-".to_owned(), |g| {
        let p = if g.p < 0.001 { "p<.001".to_owned() } else { format!("p={:.3}", g.p) };
        format!("{} W={:.1} {p}", spread(Some(g.difference)), g.z)
    })
}
