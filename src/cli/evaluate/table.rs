//! Tables for people.

use crate::evaluation::Evaluation;
use crate::evaluation::error_analysis::{Gain, Spread};
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
                "  {:<9} {:<19} {:>6} {:>6} {:>7} {:>8} {:>7} {:>7} {:>8} {:>6} {:>8}",
                "method", "angle", "trials", "failed", "frames", "coverage", "MAE", "RMSE", "no offs.", "r", "interval"
            )?;
        }
        writeln!(
            out,
            "  {:<9} {:<19} {:>6} {:>6} {:>7} {:>7.1}% {:>7} {:>7} {:>8} {:>6} {:>8}",
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
    let mut group = None;
    for row in &evaluation.errors {
        let place = (&row.dataset, row.side);
        if group != Some(place) {
            group = Some(place);
            writeln!(out, "\n{}, {} side: absolute errors, mean (p25 to p75), degrees", row.dataset, row.side.name())?;
            writeln!(
                out,
                "  {:<26} {:<9} {:<19} {:<19} {:<19} {:<26} {:<19} {:<26}",
                "exercise",
                "method",
                "hip flexion",
                "hip abduction",
                "hip rotation",
                "hip gain over nite",
                "knee flexion",
                "knee gain over nite"
            )?;
        }
        writeln!(
            out,
            "  {:<26} {:<9} {:<19} {:<19} {:<19} {:<26} {:<19} {:<26}",
            row.exercise,
            row.method,
            spread(row.hip_flexion),
            spread(row.hip_abduction),
            spread(row.hip_axial_rotation),
            gain(row.hip_gain),
            spread(row.knee_flexion),
            gain(row.knee_gain),
        )?;
    }
    writeln!(out, "\nGain: error of nite less error of the method, with z of Wilcoxon's signed-rank test over frames.")
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

fn spread(spread: Option<Spread>) -> String {
    spread.map_or("-".to_owned(), |s| format!("{:.1} ({:.1} to {:.1})", s.mean_deg, s.p25_deg, s.p75_deg))
}

fn gain(gain: Option<Gain>) -> String {
    gain.map_or("-".to_owned(), |g| format!("{} z={:.1}", spread(Some(g.difference)), g.z))
}
