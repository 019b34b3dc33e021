//! Recognition, counts and times of protocols against what is known of recordings.
//!
//! What was done is known by the data set; how often and when, from reference angles by the very rule that finds repetitions
//! in the camera's: then an error is one of the angles and not of the rule.

mod chain;
mod reference;
#[cfg(test)]
mod simulated_tests;
#[cfg(test)]
mod tests;

pub use chain::{Chain, chains};
pub use reference::{ReferenceRepetition, reference_repetitions, reference_rises};

use crate::assessment::{Performance, PerformanceStatus};
use crate::pipeline::assess;
use crate::progress::Monitor;
use crate::protocol::{PROTOCOLS, perform, recognize};
use crate::recording::Recording;
use serde::Serialize;

/// What an exercise of a data set, or a simulated one, is in the catalogue; none when the catalogue does not have it, or the
/// recording shows too little of it (standing up without sitting down before is enough, sitting down alone is not).
pub fn protocol_of(exercise: &str) -> Option<&'static str> {
    Some(match exercise.trim_end_matches("_incorrect") {
        "m01_deep_squat" | "a27_squat" => "squat",
        "m02_hurdle_step" => "knee_lift",
        "m03_inline_lunge" | "a26_forward_lunge" => "lunge",
        "m04_side_lunge" => "side_lunge",
        "m05_sit_to_stand" | "a24_sit_to_stand" => "five_times_sit_to_stand",
        "m06_standing_leg_raise" => "leg_raise",
        "a22_jog_in_place" | "a23_walk_in_place" => "march",
        "walking" => "walk",
        name => PROTOCOLS.iter().find(|protocol| protocol.id == name)?.id,
    })
}

/// Repetitions that a file of a data set holds, where its description says so; none where it does not.
fn repetitions_of_files(exercise: &str) -> Option<usize> {
    let of_uiprmd = ["m01", "m02", "m03", "m04", "m05", "m06"];
    let of_utdmhad = ["a24", "a26", "a27"];
    let is_one = of_uiprmd.iter().chain(&of_utdmhad).any(|name| exercise.starts_with(name));
    is_one.then_some(1)
}

/// What was found in one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProtocolTrial {
    /// The recording.
    pub trial: String,
    /// What was done.
    pub exercise: String,
    /// Which protocol that is, if any.
    pub expected: Option<&'static str>,
    /// What it was taken for.
    pub recognized: Vec<&'static str>,
    /// Every protocol that would be measured if it were declared.
    pub measured_as: Vec<&'static str>,
    /// Complete repetitions when declared as what it is.
    pub n_repetitions: usize,
    /// How many there are, if it is known.
    pub n_expected: Option<usize>,
    /// Found minus reference for start, peak and end of each matched repetition, seconds.
    pub time_errors_s: Vec<[f64; 3]>,
    /// Why it could not be assessed.
    pub failure: Option<String>,
}

/// Assesses one recording and compares what is found in it with what is known.
pub fn evaluate(trial: &str, exercise: &str, recording: &Recording) -> ProtocolTrial {
    let expected = protocol_of(exercise);
    let mut row = ProtocolTrial {
        trial: trial.to_owned(),
        exercise: exercise.to_owned(),
        expected,
        recognized: Vec::new(),
        measured_as: Vec::new(),
        n_repetitions: 0,
        n_expected: repetitions_of_files(exercise),
        time_errors_s: Vec::new(),
        failure: None,
    };
    let settings = crate::assessment::Settings::JointAngles(Default::default());
    let assessment = match assess(recording, &settings, &Monitor::default()) {
        Ok(assessment) => assessment,
        Err(error) => {
            row.failure = Some(error.to_string());
            return row;
        }
    };
    row.recognized = recognize(&assessment);
    let is_measured = |id: &str| perform(Some(id), &assessment).status == PerformanceStatus::Measured;
    row.measured_as = PROTOCOLS.iter().map(|protocol| protocol.id).filter(|id| is_measured(id)).collect();
    if let Some(id) = expected {
        let first_ns = assessment.time_ns.first().copied().unwrap_or(0);
        compare(&mut row, &perform(Some(id), &assessment), recording, first_ns);
    }
    row
}

/// Counts, and times against the reference's where it has the angle.
fn compare(row: &mut ProtocolTrial, performance: &Performance, recording: &Recording, first_ns: i64) {
    row.n_repetitions = performance.repetitions.iter().filter(|repetition| repetition.is_complete).count();
    let mut channels: Vec<&str> = performance.repetitions.iter().map(|r| r.channel.as_str()).collect();
    channels.sort_unstable();
    channels.dedup();
    // What the camera gave no repetition of has no channel either: only then nothing is known to be missing.
    let downwards = performance.protocol.as_deref() == Some("sit_front_knee");
    let references: Vec<(&str, ReferenceRepetition)> = channels
        .into_iter()
        .flat_map(|channel| {
            reference_repetitions(recording, channel, downwards, first_ns).into_iter().map(move |r| (channel, r))
        })
        .collect();
    for repetition in performance.repetitions.iter().filter(|repetition| repetition.is_complete) {
        let distance = |reference: &ReferenceRepetition| {
            (reference.middle_s() - 0.5 * (repetition.start_s + repetition.end_s)).abs()
        };
        let own =
            references.iter().filter(|(channel, _)| *channel == repetition.channel).map(|(_, reference)| reference);
        let Some(nearest) = own.min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
        let errors = [
            repetition.start_s - nearest.start_s,
            repetition.peak_s - nearest.peak_s,
            repetition.end_s - nearest.end_s,
        ];
        row.time_errors_s.push(errors);
    }
    let is_simulated = recording.references.iter().any(|reference| reference.source == crate::synthetic::TRUTH_SOURCE);
    if is_simulated && !references.is_empty() {
        row.n_expected = Some(references.len());
    }
}
