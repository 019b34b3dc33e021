//! Joint angles of several methods beside a reference, trial by trial.

use super::contender::Contender;
use super::error_analysis::{FrameErrors, frame_errors};
use super::reference::interpolated;
use super::rows::{Evaluation, summarize};
use super::three_point::knee_flexion_deg;
use super::trial::TrialSource;
use crate::assessment::series::{FLAG_BRIDGED, FLAG_NOT_OBSERVABLE};
use crate::assessment::{AngleChannel, Assessment, JointAngleSettings, Settings};
use crate::body::Side;
use crate::pipeline::{self, Inputs};
use crate::progress::Monitor;
use crate::recording::Recording;
use rayon::prelude::*;

/// Name of an angle, and its channel on a side.
pub(super) type Measure = (&'static str, fn(Side) -> AngleChannel);

/// The angles that are compared, with the channel of each side.
pub(super) const MEASURES: [Measure; 4] = [
    ("hip_flexion", AngleChannel::HipFlexion),
    ("hip_abduction", AngleChannel::HipAbduction),
    ("hip_axial_rotation", AngleChannel::HipAxialRotation),
    ("knee_flexion", AngleChannel::KneeFlexion),
];

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
    pub(super) observed: usize,
    /// Samples with an interval, and those of them whose interval holds the reference.
    pub(super) intervals: (usize, usize),
}

/// Runs every contender on every trial, trials in parallel; the result does not depend on the number of threads.
///
/// `done` is called after each trial.
pub fn evaluate(
    sources: &[TrialSource],
    contenders: &[Contender],
    settings: &JointAngleSettings,
    inputs: &Inputs,
    done: impl Fn() + Sync,
) -> Evaluation {
    let outcomes: Vec<TrialOutcome> = sources
        .par_iter()
        .map(|source| {
            let outcome = evaluate_trial(source, contenders, settings, inputs);
            done();
            outcome
        })
        .collect();
    summarize(&outcomes, contenders)
}

/// What every contender did in one trial.
pub(super) struct TrialOutcome {
    pub(super) name: String,
    /// Data set and exercise, or why the trial could not be loaded.
    pub(super) place: Result<(String, String), String>,
    pub(super) results: Vec<Result<Compared, String>>,
}

/// What comparing one contender with the reference of one trial gave.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Compared {
    /// Each measure that has a reference.
    pub comparisons: Vec<Comparison>,
    /// Errors of the joints' rotations; empty for the raw angle.
    pub errors: Vec<FrameErrors>,
}

fn evaluate_trial(
    source: &TrialSource,
    contenders: &[Contender],
    settings: &JointAngleSettings,
    inputs: &Inputs,
) -> TrialOutcome {
    let name = source.name.clone();
    match (source.load)() {
        Err(reason) => TrialOutcome { name, place: Err(reason), results: Vec::new() },
        Ok(trial) => {
            let measured =
                |channel: &str| MEASURES.iter().any(|(_, of)| Side::BOTH.iter().any(|s| of(*s).name() == channel));
            if !trial.recording.references.iter().any(|reference| measured(&reference.channel)) {
                return TrialOutcome { name, place: Ok((trial.dataset, trial.exercise)), results: Vec::new() };
            }
            let results =
                contenders.iter().map(|contender| compare(&trial.recording, *contender, settings, inputs)).collect();
            TrialOutcome { name, place: Ok((trial.dataset, trial.exercise)), results }
        }
    }
}

/// Runs one contender on a recording and compares every measure that has a reference. A noise model in the settings is for
/// the methods that take one; the others run without.
///
/// # Errors
/// The sentence with which the pipeline refused the recording.
pub fn compare(
    recording: &Recording,
    contender: Contender,
    settings: &JointAngleSettings,
    inputs: &Inputs,
) -> Result<Compared, String> {
    match contender {
        Contender::Raw => Ok(Compared { comparisons: compare_raw(recording), errors: Vec::new() }),
        Contender::Method(method) => {
            let noise_model = settings.noise_model.clone().filter(|_| method.default_noise_model().is_some());
            let settings = Settings::JointAngles(JointAngleSettings { method, noise_model, ..settings.clone() });
            let assessment = pipeline::assess_with(recording, &settings, inputs, &Monitor::default())
                .map_err(|error| error.to_string())?;
            let errors = frame_errors(recording, &assessment);
            Ok(Compared { comparisons: compare_assessment(recording, &assessment), errors })
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

#[cfg(test)]
mod tests;
