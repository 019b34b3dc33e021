//! From comparisons of single trials to lines over data sets and exercises.

use super::agreement::{Agreement, median};
use super::contender::Contender;
use super::error_analysis::{ErrorRow, error_row};
use super::joint_angles::{Comparison, MEASURES, TrialOutcome};
use super::overview::{OverviewRow, overview};
use super::segment_lengths::{SegmentLengths, segment_lengths};
use super::verdict::{Verdict, verdict};
use crate::body::Side;
use serde::Serialize;
use std::collections::BTreeMap;

/// One line of the result: a method's agreement in one measure over the trials of an exercise. Errors are medians over
/// the trials; both sides of a trial are pooled unless the measure names one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Where the trials come from.
    pub dataset: String,
    /// What was done in them.
    pub exercise: String,
    /// The contender, for example `iekf`, `particle/512` or `raw`.
    pub method: String,
    /// The angle, for example `knee_flexion` or `left_knee_flexion`.
    pub measure: String,
    /// Trials with at least one compared frame.
    pub n_trials: usize,
    /// Trials in which the method failed; see the failures.
    pub n_failed: usize,
    /// Compared samples of all trials; a frame counts once for each side.
    pub n_frames: usize,
    /// Share of the reference's samples for which the method has an observed (not bridged, not unobservable) value.
    pub coverage: f64,
    /// Mean absolute error, degrees.
    pub mae_deg: Option<f64>,
    /// Root mean square error, degrees.
    pub rmse_deg: Option<f64>,
    /// Root mean square error after the mean error of each trial and side is taken away, degrees.
    pub rmse_without_offset_deg: Option<f64>,
    /// Correlation, pooled within the sides.
    pub correlation: Option<f64>,
    /// Share of the samples whose 95 % interval holds the reference; absent for methods without intervals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_coverage: Option<f64>,
}

/// A trial that could not be evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Failure {
    /// The trial.
    pub trial: String,
    /// The method, or nothing when the trial could not even be loaded.
    pub method: Option<String>,
    /// Why.
    pub reason: String,
}

/// The whole result.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Evaluation {
    /// Lines in the order of data set, exercise, contender, measure.
    pub rows: Vec<Row>,
    /// The paper's error analysis, in the order of data set, side, exercise (`all` last), method.
    pub errors: Vec<ErrorRow>,
    /// Every method over all exercises of a data set.
    pub overview: Vec<OverviewRow>,
    /// Whether the default beats the others; none when the default or every other contender was left out.
    pub verdict: Option<Verdict>,
    /// How constant the body's segments are, in each data set.
    pub segment_lengths: Vec<SegmentLengths>,
    /// What could not be evaluated.
    pub failures: Vec<Failure>,
    /// Trials that were left out because they have no reference for any compared angle.
    pub n_without_reference: usize,
}

/// Lines of all trials, and what went wrong.
pub(super) fn summarize(outcomes: &[TrialOutcome], contenders: &[Contender]) -> Evaluation {
    let mut evaluation = Evaluation::default();
    let mut groups = Groups::new();
    for outcome in outcomes {
        match &outcome.place {
            Ok(_) if outcome.results.is_empty() => evaluation.n_without_reference += 1,
            Ok((dataset, exercise)) => groups.entry((dataset, exercise)).or_default().push(outcome),
            Err(reason) => {
                evaluation.failures.push(Failure { trial: outcome.name.clone(), method: None, reason: reason.clone() })
            }
        }
        for (contender, result) in contenders.iter().zip(&outcome.results) {
            if let Err(reason) = result {
                evaluation.failures.push(Failure {
                    trial: outcome.name.clone(),
                    method: Some(contender.name()),
                    reason: reason.clone(),
                });
            }
        }
    }
    let sets = sets(&groups);
    evaluation.errors = error_rows(&sets, contenders);
    evaluation.verdict = verdict(&sets, contenders);
    evaluation.segment_lengths = segment_lengths(&sets, contenders);
    for ((dataset, exercise), trials) in &groups {
        for (i, contender) in contenders.iter().enumerate() {
            let n_failed = trials.iter().filter(|trial| trial.results[i].is_err()).count();
            let found: Vec<&[Comparison]> =
                trials.iter().filter_map(|trial| Some(&trial.results[i].as_ref().ok()?.comparisons[..])).collect();
            for (measure, _) in MEASURES {
                for sides in [&Side::BOTH[..], &[Side::Left], &[Side::Right]] {
                    let Some(mut row) = row_of(&found, measure, sides) else { continue };
                    row.dataset = (*dataset).to_owned();
                    row.exercise = (*exercise).to_owned();
                    row.method = contender.name();
                    row.n_failed = n_failed;
                    evaluation.rows.push(row);
                }
            }
        }
    }
    evaluation.overview = overview(&evaluation.rows, &sets, contenders);
    evaluation
}

/// Trials by data set and exercise.
type Groups<'a> = BTreeMap<(&'a str, &'a str), Vec<&'a TrialOutcome>>;

/// Exercise of the lines that take all exercises of a data set together.
pub const ALL_EXERCISES: &str = "all";

/// Exercises of each data set with their trials; all of them together come last.
pub(super) type Sets<'a> = BTreeMap<&'a str, Vec<(&'a str, Vec<&'a TrialOutcome>)>>;

pub(super) fn sets<'a>(groups: &Groups<'a>) -> Sets<'a> {
    let mut sets = Sets::new();
    for ((dataset, exercise), trials) in groups {
        sets.entry(dataset).or_default().push((exercise, trials.clone()));
    }
    for exercises in sets.values_mut() {
        let all = exercises.iter().flat_map(|(_, trials)| trials.iter().copied()).collect();
        exercises.push((ALL_EXERCISES, all));
    }
    sets
}

/// The paper's error analysis of every data set: each side, each exercise and all of them, each method.
fn error_rows(sets: &Sets<'_>, contenders: &[Contender]) -> Vec<ErrorRow> {
    let baseline = contenders.iter().position(|contender| *contender == Contender::MIDDLEWARE);
    let mut rows = Vec::new();
    for (dataset, exercises) in sets {
        for side in Side::BOTH {
            for (exercise, trials) in exercises {
                for (i, contender) in contenders.iter().enumerate() {
                    let mut found = Vec::new();
                    for trial in trials {
                        let errors = |i: usize| {
                            let compared = trial.results[i].as_ref().ok()?;
                            compared.errors.iter().find(|errors| errors.side == side)
                        };
                        if let Some(own) = errors(i) {
                            found.push((own, baseline.filter(|baseline| *baseline != i).and_then(errors)));
                        }
                    }
                    if found.is_empty() {
                        continue;
                    }
                    let mut row = error_row(&contender.name(), side, &found);
                    row.dataset = (*dataset).to_owned();
                    row.exercise = (*exercise).to_owned();
                    rows.push(row);
                }
            }
        }
    }
    rows
}

/// Agreement in one measure of one trial, its sides pooled.
pub(super) fn agreement_in_trial(trial: &[Comparison], measure: &str, sides: &[Side]) -> Agreement {
    let own = trial.iter().filter(|c| c.measure == measure && sides.contains(&c.side));
    own.fold(Agreement::default(), |sum, c| sum.pooled(Agreement::between(&c.estimate, &c.reference)))
}

/// The line of a measure over trials, its place left empty; none when no trial has the measure.
fn row_of(trials: &[&[Comparison]], measure: &'static str, sides: &[Side]) -> Option<Row> {
    let mut agreements = Vec::new();
    let (mut referenced, mut observed, mut intervals) = (0, 0, (0, 0));
    for trial in trials {
        for comparison in trial.iter().filter(|c| c.measure == measure && sides.contains(&c.side)) {
            referenced += comparison.reference.iter().filter(|v| v.is_finite()).count();
            observed += comparison.observed;
            let (with_interval, held) = comparison.held_by_intervals();
            intervals.0 += with_interval;
            intervals.1 += held;
        }
        let pooled = agreement_in_trial(trial, measure, sides);
        if pooled.n() > 0 {
            agreements.push(pooled);
        }
    }
    if referenced == 0 {
        return None;
    }
    let over_trials =
        |number: fn(&Agreement) -> Option<f64>| median(&agreements.iter().filter_map(number).collect::<Vec<f64>>());
    let side = match sides {
        [side] => format!("{}_", side.name()),
        _ => String::new(),
    };
    Some(Row {
        dataset: String::new(),
        exercise: String::new(),
        method: String::new(),
        measure: format!("{side}{measure}"),
        n_trials: agreements.len(),
        n_failed: 0,
        n_frames: agreements.iter().map(Agreement::n).sum(),
        coverage: observed as f64 / referenced as f64,
        mae_deg: over_trials(Agreement::mae),
        rmse_deg: over_trials(Agreement::rmse),
        rmse_without_offset_deg: over_trials(Agreement::rmse_without_offset),
        correlation: over_trials(Agreement::correlation),
        interval_coverage: (intervals.0 > 0).then(|| intervals.1 as f64 / intervals.0 as f64),
    })
}
