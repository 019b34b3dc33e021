//! Joint angles of several methods beside a reference, trial by trial.

use super::agreement::{Agreement, median};
use super::reference::interpolated;
use super::three_point::knee_flexion_deg;
use crate::assessment::series::{FLAG_BRIDGED, FLAG_NOT_OBSERVABLE};
use crate::assessment::{AngleChannel, Assessment, JointAngleSettings, Method, Settings};
use crate::body::Side;
use crate::pipeline;
use crate::progress::Monitor;
use crate::recording::Recording;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// One recording with a reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Where it comes from, for example `uiprmd`.
    pub dataset: String,
    /// What was done, for example `m01_deep_squat`.
    pub exercise: String,
    /// Which recording, for messages.
    pub name: String,
    /// The recording.
    pub recording: Recording,
}

/// A trial that is loaded when its turn comes, so that a large data set is never in memory as a whole.
pub struct TrialSource {
    /// Which recording, for messages.
    pub name: String,
    load: Box<dyn Fn() -> Result<Trial, String> + Send + Sync>,
}

impl TrialSource {
    /// A trial that `load` reads or makes; its error is a sentence.
    pub fn new(name: impl Into<String>, load: impl Fn() -> Result<Trial, String> + Send + Sync + 'static) -> Self {
        Self { name: name.into(), load: Box::new(load) }
    }
}

/// What is compared: a method of the pipeline, or the angle of the raw joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contender {
    /// The three-point angle of the recorded joints; knees only.
    Raw,
    /// A method of the pipeline.
    Method(Method),
}

impl Contender {
    /// Raw first, then every method.
    pub fn all() -> Vec<Contender> {
        std::iter::once(Contender::Raw).chain(Method::ALL.map(Contender::Method)).collect()
    }

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Contender::Raw => "raw",
            Contender::Method(method) => method.name(),
        }
    }
}

/// A name that no contender has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a method; there are raw, smoother, paper, ik and nite")]
pub struct UnknownContender(pub String);

impl FromStr for Contender {
    type Err = UnknownContender;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::all().into_iter().find(|c| c.name() == name).ok_or_else(|| UnknownContender(name.to_owned()))
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The angles that are compared, with the channel of each side.
const MEASURES: [(&str, fn(Side) -> AngleChannel); 4] = [
    ("hip_flexion", AngleChannel::HipFlexion),
    ("hip_abduction", AngleChannel::HipAbduction),
    ("hip_axial_rotation", AngleChannel::HipAxialRotation),
    ("knee_flexion", AngleChannel::KneeFlexion),
];

/// One line of the result: a method's agreement in one measure over the trials of an exercise. Errors are medians over
/// the trials; both sides of a trial are pooled unless the measure names one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Where the trials come from.
    pub dataset: String,
    /// What was done in them.
    pub exercise: String,
    /// The method, or `raw`.
    pub method: &'static str,
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
    pub method: Option<&'static str>,
    /// Why.
    pub reason: String,
}

/// The whole result.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Evaluation {
    /// Lines in the order of data set, exercise, contender, measure.
    pub rows: Vec<Row>,
    /// What could not be evaluated.
    pub failures: Vec<Failure>,
}

/// Error of one method in one angle of one trial, sample by sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The measure, without side.
    pub measure: &'static str,
    /// The side.
    pub side: Side,
    /// Estimate at each time of the reference, NaN where there is none; turned by full turns towards the reference.
    pub estimate: Vec<f64>,
    /// The reference, NaN where there is none.
    pub reference: Vec<f64>,
    /// Samples of the reference for which the method has an observed value.
    observed: usize,
    /// Samples with an interval, and those of them whose interval holds the reference.
    intervals: (usize, usize),
}

/// Runs every contender on every trial, trials in parallel; the result does not depend on the number of threads.
///
/// `done` is called after each trial.
pub fn evaluate(
    sources: &[TrialSource],
    contenders: &[Contender],
    settings: &JointAngleSettings,
    done: impl Fn() + Sync,
) -> Evaluation {
    let outcomes: Vec<TrialOutcome> = sources
        .par_iter()
        .map(|source| {
            let outcome = evaluate_trial(source, contenders, settings);
            done();
            outcome
        })
        .collect();
    summarize(&outcomes, contenders)
}

/// What every contender did in one trial.
struct TrialOutcome {
    name: String,
    /// Data set and exercise, or why the trial could not be loaded.
    place: Result<(String, String), String>,
    results: Vec<Result<Vec<Comparison>, String>>,
}

fn evaluate_trial(source: &TrialSource, contenders: &[Contender], settings: &JointAngleSettings) -> TrialOutcome {
    let name = source.name.clone();
    match (source.load)() {
        Err(reason) => TrialOutcome { name, place: Err(reason), results: Vec::new() },
        Ok(trial) => {
            let results = contenders.iter().map(|contender| compare(&trial.recording, *contender, settings)).collect();
            TrialOutcome { name, place: Ok((trial.dataset, trial.exercise)), results }
        }
    }
}

/// Runs one contender on a recording and compares every measure that has a reference.
///
/// # Errors
/// The sentence with which the pipeline refused the recording.
pub fn compare(
    recording: &Recording,
    contender: Contender,
    settings: &JointAngleSettings,
) -> Result<Vec<Comparison>, String> {
    match contender {
        Contender::Raw => Ok(compare_raw(recording)),
        Contender::Method(method) => {
            let settings = Settings::JointAngles(JointAngleSettings { method, ..settings.clone() });
            let assessment =
                pipeline::assess(recording, &settings, &Monitor::default()).map_err(|error| error.to_string())?;
            Ok(compare_assessment(recording, &assessment))
        }
    }
}

fn compare_raw(recording: &Recording) -> Vec<Comparison> {
    let Some(skeleton) = &recording.skeleton else { return Vec::new() };
    let mut found = Vec::new();
    for side in Side::BOTH {
        let channel = AngleChannel::KneeFlexion(side).name();
        let reference = recording.references.iter().find(|r| r.channel == channel);
        let (Some(reference), Some(estimate)) = (reference, knee_flexion_deg(skeleton, side)) else { continue };
        let reference = interpolated(reference, &skeleton.time_ns);
        let observed = both_finite(&estimate, &reference);
        found.push(Comparison { measure: "knee_flexion", side, estimate, reference, observed, intervals: (0, 0) });
    }
    found
}

fn compare_assessment(recording: &Recording, assessment: &Assessment) -> Vec<Comparison> {
    let mut found = Vec::new();
    for (measure, channel_of) in MEASURES {
        for side in Side::BOTH {
            let channel = channel_of(side).name();
            let reference = recording.references.iter().find(|r| r.channel == channel);
            let series = assessment.series.iter().find(|s| s.channel == channel);
            let (Some(reference), Some(series)) = (reference, series) else { continue };
            let reference = interpolated(reference, &assessment.time_ns);
            let mut estimate = Vec::with_capacity(reference.len());
            let (mut observed, mut intervals) = (0, (0, 0));
            for (t, truth) in reference.iter().enumerate() {
                let value = f64::from(series.value[t]);
                // An angle that passed ±180° is the same angle a turn further.
                let turns = 360.0 * ((value - truth) / 360.0).round();
                let turns = if turns.is_finite() { turns } else { 0.0 };
                estimate.push(value - turns);
                let (low, high) = (f64::from(series.low[t]) - turns, f64::from(series.high[t]) - turns);
                if truth.is_finite() && low.is_finite() && high.is_finite() {
                    intervals.0 += 1;
                    intervals.1 += usize::from((low..=high).contains(truth));
                }
                let is_seen = series.flags[t] & (FLAG_BRIDGED | FLAG_NOT_OBSERVABLE) == 0;
                observed += usize::from(is_seen && truth.is_finite() && value.is_finite());
            }
            found.push(Comparison { measure, side, estimate, reference, observed, intervals });
        }
    }
    found
}

fn both_finite(a: &[f64], b: &[f64]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()).count()
}

fn summarize(outcomes: &[TrialOutcome], contenders: &[Contender]) -> Evaluation {
    let mut evaluation = Evaluation::default();
    let mut groups: BTreeMap<(&str, &str), Vec<&TrialOutcome>> = BTreeMap::new();
    for outcome in outcomes {
        match &outcome.place {
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
    for ((dataset, exercise), trials) in groups {
        for (i, contender) in contenders.iter().enumerate() {
            let n_failed = trials.iter().filter(|trial| trial.results[i].is_err()).count();
            let found: Vec<&Vec<Comparison>> =
                trials.iter().filter_map(|trial| trial.results[i].as_ref().ok()).collect();
            for (measure, _) in MEASURES {
                for sides in [&Side::BOTH[..], &[Side::Left], &[Side::Right]] {
                    let Some(mut row) = row_of(&found, measure, sides) else { continue };
                    row.dataset = dataset.to_owned();
                    row.exercise = exercise.to_owned();
                    row.method = contender.name();
                    row.n_failed = n_failed;
                    evaluation.rows.push(row);
                }
            }
        }
    }
    evaluation
}

/// The line of a measure over trials, its place left empty; none when no trial has the measure.
fn row_of(trials: &[&Vec<Comparison>], measure: &'static str, sides: &[Side]) -> Option<Row> {
    let mut agreements = Vec::new();
    let (mut referenced, mut observed, mut intervals) = (0, 0, (0, 0));
    for trial in trials {
        let mut pooled = Agreement::default();
        for comparison in trial.iter().filter(|c| c.measure == measure && sides.contains(&c.side)) {
            pooled = pooled.pooled(Agreement::between(&comparison.estimate, &comparison.reference));
            referenced += comparison.reference.iter().filter(|v| v.is_finite()).count();
            observed += comparison.observed;
            intervals.0 += comparison.intervals.0;
            intervals.1 += comparison.intervals.1;
        }
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
        method: "",
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

#[cfg(test)]
mod tests;
