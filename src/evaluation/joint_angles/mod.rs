//! Joint angles of several methods beside a reference, trial by trial.

use super::contender::Contender;
use super::error_analysis::{FrameErrors, frame_errors};
use super::reference::interpolated;
use super::rows::{Evaluation, summarize};
use super::segment_lengths::{largest_deviation_of_output, largest_deviation_recorded};
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

/// The angles that are compared as fields name them, and as people do.
pub const MEASURE_NAMES: [(&str, &str); 4] = [
    ("hip_flexion", "hip flexion"),
    ("hip_abduction", "hip abduction"),
    ("hip_axial_rotation", "hip axial rotation"),
    ("knee_flexion", "knee flexion"),
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
    /// Ends of the 95 % interval around each estimate, NaN where there is none; empty for the raw angle.
    pub intervals: Vec<[f32; 2]>,
    /// Samples of the reference for which the method has an observed value.
    pub(super) observed: usize,
}

impl Comparison {
    /// Samples that have an interval and a reference, and those of them whose interval holds the reference.
    pub(super) fn held_by_intervals(&self) -> (usize, usize) {
        let mut held = (0, 0);
        for (truth, [low, high]) in self.reference.iter().zip(&self.intervals) {
            let (low, high) = (f64::from(*low), f64::from(*high));
            if truth.is_finite() && low.is_finite() && high.is_finite() {
                held.0 += 1;
                held.1 += usize::from((low..=high).contains(truth));
            }
        }
        held
    }
}

/// Everything that a run found, sample by sample: what tables and figures are made of.
pub struct Outcomes {
    /// What was compared.
    pub contenders: Vec<Contender>,
    /// In the order of the sources.
    pub(super) trials: Vec<TrialOutcome>,
}

impl Outcomes {
    /// Lines over data sets and exercises.
    pub fn summarize(&self) -> Evaluation {
        summarize(&self.trials, &self.contenders)
    }
}

/// Runs every contender on every trial, trials in parallel; the result does not depend on the number of threads.
///
/// `done` is called after each trial.
pub fn run(
    sources: &[TrialSource],
    contenders: &[Contender],
    settings: &JointAngleSettings,
    inputs: &Inputs,
    done: impl Fn() + Sync,
) -> Outcomes {
    let trials = sources
        .par_iter()
        // One at a time: trials differ in length, and a thread that is done takes the next.
        .with_max_len(1)
        .map(|source| {
            let outcome = evaluate_trial(source, contenders, settings, inputs);
            done();
            outcome
        })
        .collect();
    Outcomes { contenders: contenders.to_vec(), trials }
}

/// [`run`], summarized.
pub fn evaluate(
    sources: &[TrialSource],
    contenders: &[Contender],
    settings: &JointAngleSettings,
    inputs: &Inputs,
    done: impl Fn() + Sync,
) -> Evaluation {
    run(sources, contenders, settings, inputs, done).summarize()
}

/// What every contender did in one trial.
pub(super) struct TrialOutcome {
    pub(super) name: String,
    /// Data set and exercise, or why the trial could not be loaded.
    pub(super) place: Result<(String, String), String>,
    /// Largest deviation of a recorded segment from its median length, metres; none without a skeleton.
    pub(super) recorded_length_deviation_m: Option<f64>,
    /// One for each contender; none at all when the trial has no reference for any measure.
    pub(super) results: Vec<Result<Compared, String>>,
}

/// What comparing one contender with the reference of one trial gave.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Compared {
    /// Time of each sample, nanoseconds on the recording's clock.
    pub time_ns: Vec<i64>,
    /// Each measure that has a reference.
    pub comparisons: Vec<Comparison>,
    /// Errors of the joints' rotations; empty for the raw angle.
    pub errors: Vec<FrameErrors>,
    /// Largest deviation of a segment of the estimated body from its median length, metres; none for the raw angle.
    pub length_deviation_m: Option<f64>,
}

fn evaluate_trial(
    source: &TrialSource,
    contenders: &[Contender],
    settings: &JointAngleSettings,
    inputs: &Inputs,
) -> TrialOutcome {
    let name = source.name.clone();
    let trial = match (source.load)() {
        Ok(trial) => trial,
        Err(reason) => {
            let results = Vec::new();
            return TrialOutcome { name, place: Err(reason), recorded_length_deviation_m: None, results };
        }
    };
    let measured = |channel: &str| MEASURES.iter().any(|(_, of)| Side::BOTH.iter().any(|s| of(*s).name() == channel));
    let has_reference = trial.recording.references.iter().any(|reference| measured(&reference.channel));
    let compare = |contender: &Contender| compare(&trial.recording, *contender, settings, inputs);
    let results = if has_reference { contenders.iter().map(compare).collect() } else { Vec::new() };
    let recorded_length_deviation_m = trial.recording.skeleton.as_ref().and_then(largest_deviation_recorded);
    TrialOutcome { name, place: Ok((trial.dataset, trial.exercise)), recorded_length_deviation_m, results }
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
    let Some(mut settings) = contender.settings(settings) else {
        let time_ns = recording.skeleton.as_ref().map_or(Vec::new(), |skeleton| skeleton.time_ns.clone());
        return Ok(Compared { time_ns, comparisons: compare_raw(recording), ..Compared::default() });
    };
    if settings.method.default_noise_model().is_none() {
        settings.noise_model = None;
    }
    let settings = Settings::JointAngles(settings);
    let assessment =
        pipeline::assess_with(recording, &settings, inputs, &Monitor::default()).map_err(|error| error.to_string())?;
    Ok(Compared {
        comparisons: compare_assessment(recording, &assessment),
        errors: frame_errors(recording, &assessment),
        length_deviation_m: largest_deviation_of_output(&assessment),
        time_ns: assessment.time_ns,
    })
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
        found.push(Comparison { measure: "knee_flexion", side, estimate, reference, intervals: Vec::new(), observed });
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
            let mut intervals = Vec::with_capacity(reference.len());
            let mut observed = 0;
            for (t, truth) in reference.iter().enumerate() {
                let value = f64::from(series.value[t]);
                // An angle that passed ±180° is the same angle a turn further.
                let turns = 360.0 * ((value - truth) / 360.0).round();
                let turns = if turns.is_finite() { turns } else { 0.0 };
                estimate.push(value - turns);
                intervals.push([series.low[t], series.high[t]].map(|end| (f64::from(end) - turns) as f32));
                let is_seen = series.flags[t] & (FLAG_BRIDGED | FLAG_NOT_OBSERVABLE) == 0;
                observed += usize::from(is_seen && truth.is_finite() && value.is_finite());
            }
            found.push(Comparison { measure, side, estimate, reference, intervals, observed });
        }
    }
    found
}

fn both_finite(a: &[f64], b: &[f64]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()).count()
}

#[cfg(test)]
mod tests;
