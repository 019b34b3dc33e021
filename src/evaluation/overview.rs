//! Every method over all exercises of a data set: the error of each angle, and whether the intervals hold what they
//! promise.

use super::contender::Contender;
use super::joint_angles::{MEASURES, TrialOutcome};
use super::rows::{Row, Sets};
use serde::Serialize;
use std::ops::RangeInclusive;

/// Share of 95 % intervals that should hold the reference: the promise, give or take what a few dozen recordings with
/// correlated frames can show.
pub const PROMISED_COVERAGE: RangeInclusive<f64> = 0.90..=0.98;

/// One method in one angle over all exercises of a data set, both sides together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverviewRow {
    /// Where the trials come from.
    pub dataset: String,
    /// The contender.
    pub method: String,
    /// The angle, without side.
    pub measure: &'static str,
    /// Exercises with the angle.
    pub n_exercises: usize,
    /// Mean over the exercises of the median mean absolute error over trials, degrees.
    pub mae_deg: Option<f64>,
    /// Mean over the exercises of the median root mean square error over trials, degrees.
    pub rmse_deg: Option<f64>,
    /// Share of the samples of all exercises whose 95 % interval holds the reference; absent without intervals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_coverage: Option<f64>,
    /// Whether that share, to a tenth of a percent, lies in [`PROMISED_COVERAGE`]; absent without intervals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_coverage_as_promised: Option<bool>,
}

/// Rows in the order of data set, contender, measure.
pub(super) fn overview(rows: &[Row], sets: &Sets<'_>, contenders: &[Contender]) -> Vec<OverviewRow> {
    let mut found = Vec::new();
    for (dataset, exercises) in sets {
        let Some((_, all)) = exercises.last() else { continue };
        for (i, contender) in contenders.iter().enumerate() {
            let method = contender.name();
            for (measure, _) in MEASURES {
                let own: Vec<&Row> = rows
                    .iter()
                    .filter(|r| r.dataset == *dataset && r.method == method && r.measure == measure)
                    .collect();
                if own.is_empty() {
                    continue;
                }
                let interval_coverage = coverage(all, i, measure);
                found.push(OverviewRow {
                    dataset: (*dataset).to_owned(),
                    method: method.clone(),
                    measure,
                    n_exercises: own.len(),
                    mae_deg: mean(own.iter().filter_map(|row| row.mae_deg)),
                    rmse_deg: mean(own.iter().filter_map(|row| row.rmse_deg)),
                    interval_coverage,
                    interval_coverage_as_promised: interval_coverage.map(is_as_promised),
                });
            }
        }
    }
    found
}

/// Judges the share as tables print it, so that no 90.0 % is called less than 90 %.
fn is_as_promised(share: f64) -> bool {
    PROMISED_COVERAGE.contains(&((1000.0 * share).round() / 1000.0))
}

/// Share of a contender's intervals that hold the reference, over all samples of the trials.
fn coverage(trials: &[&TrialOutcome], contender: usize, measure: &str) -> Option<f64> {
    let (mut with_interval, mut held) = (0, 0);
    for compared in trials.iter().filter_map(|trial| trial.results[contender].as_ref().ok()) {
        for comparison in compared.comparisons.iter().filter(|c| c.measure == measure) {
            let (all, inside) = comparison.held_by_intervals();
            with_interval += all;
            held += inside;
        }
    }
    (with_interval > 0).then(|| held as f64 / with_interval as f64)
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> Option<f64> {
    let n = values.clone().count();
    (n > 0).then(|| values.sum::<f64>() / n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_judged_as_it_is_printed() {
        assert!(is_as_promised(0.89996) && is_as_promised(0.95) && is_as_promised(0.98049));
        assert!(!is_as_promised(0.8994) && !is_as_promised(0.9806) && !is_as_promised(1.0));
    }
}
