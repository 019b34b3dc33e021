//! Five-times sit-to-stand, put together from single repetitions of one person.

use super::reference::reference_rises;
use crate::assessment::{PerformanceMeasure, Settings};
use crate::pipeline::assess;
use crate::progress::Monitor;
use crate::protocol::chair::rises;
use crate::protocol::motion::Motion;
use crate::protocol::perform;
use crate::recording::{Recording, SkeletonRecording};
use serde::Serialize;

/// Repetitions that are put after each other.
const REPETITIONS: usize = 5;

/// Time in which one file's last posture becomes the next one's first, nanoseconds.
const PAUSE_NS: i64 = 500_000_000;

/// One test that was put together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chain {
    /// Whose repetitions they are.
    pub subject: String,
    /// Complete rises that were found; five are there.
    pub n_rises: usize,
    /// What the service measured; none with a reason when it did not.
    pub five_times_sit_to_stand_s: Option<f64>,
    /// Why it was not measured, or what limits it.
    pub reason: String,
    /// The time by knees alone, in the camera's angles.
    pub by_knees_s: Option<f64>,
    /// The time by knees alone, in the reference's.
    pub by_reference_knees_s: Option<f64>,
}

/// Puts the repetitions of each subject after each other, five in turn, and measures them. `trials` are subject and recording.
pub fn chains(trials: &[(String, Recording)]) -> Vec<Chain> {
    let mut subjects: Vec<&String> = trials.iter().map(|(subject, _)| subject).collect();
    subjects.sort_unstable();
    subjects.dedup();
    subjects
        .into_iter()
        .filter_map(|subject| {
            let own: Vec<&Recording> =
                trials.iter().filter(|(other, _)| other == subject).map(|(_, recording)| recording).collect();
            let five: Vec<&Recording> = own.iter().copied().cycle().take(REPETITIONS).collect();
            measure(subject, &joined(&five)?)
        })
        .collect()
}

fn measure(subject: &str, recording: &Recording) -> Option<Chain> {
    let assessment = assess(recording, &Settings::JointAngles(Default::default()), &Monitor::default()).ok()?;
    let performance = perform(Some("five_times_sit_to_stand"), &assessment);
    let motion = Motion::of(&assessment)?;
    let found: Vec<_> = rises(&motion).into_iter().filter(|rise| rise.is_complete).collect();
    let reference = reference_rises(recording, *assessment.time_ns.first()?);
    let named = |measure: &&PerformanceMeasure| measure.name == "five_times_sit_to_stand_s";
    let time = performance.measures.iter().find(named);
    let from_to = |first: Option<f64>, fifth: Option<f64>| Some(fifth? - first?);
    Some(Chain {
        subject: subject.to_owned(),
        n_rises: found.len(),
        five_times_sit_to_stand_s: time.and_then(|measure| measure.value),
        reason: time.map_or(performance.reason.clone(), |measure| measure.reason.clone()),
        by_knees_s: from_to(
            found.first().map(|rise| motion.seconds(rise.way.start)),
            found.get(REPETITIONS - 1).map(|rise| motion.seconds(rise.way.end)),
        ),
        by_reference_knees_s: from_to(
            reference.first().map(|rise| rise[0]),
            reference.get(REPETITIONS - 1).map(|rise| rise[1]),
        ),
    })
}

/// Recordings after each other, with references; none when they do not have the same joints.
fn joined(parts: &[&Recording]) -> Option<Recording> {
    let first = parts.first()?;
    let mut whole = (*first).clone();
    let mut shift_ns = 0;
    for (k, part) in parts.iter().enumerate() {
        let skeleton = part.skeleton.as_ref()?;
        let start_ns = *skeleton.time_ns.first()?;
        if k > 0 {
            let target = whole.skeleton.as_mut()?;
            shift_ns = target.time_ns.last()? + PAUSE_NS - start_ns;
            append(target, skeleton, shift_ns)?;
        }
        for reference in &part.references {
            let own = whole.references.iter_mut().find(|other| other.channel == reference.channel)?;
            if k == 0 {
                own.time_ns.iter_mut().for_each(|time| *time += reference.clock_offset_ns);
                own.clock_offset_ns = 0;
                continue;
            }
            for (time, value) in reference.time_ns.iter().zip(&reference.values) {
                let time = time + reference.clock_offset_ns + shift_ns;
                // What the two devices cut differently overlaps by some frames.
                if own.time_ns.last().is_none_or(|last| time > *last) {
                    own.time_ns.push(time);
                    own.values.push(*value);
                }
            }
        }
    }
    Some(whole)
}

/// Puts one skeleton after another, with frames between that go from posture to posture on a straight line.
fn append(target: &mut SkeletonRecording, next: &SkeletonRecording, shift_ns: i64) -> Option<()> {
    if target.joints != next.joints || next.len() < 2 {
        return None;
    }
    let interval_ns = (next.time_ns[1] - next.time_ns[0]).max(1);
    let n_joints = target.joints.len();
    let last = target.frame(target.len() - 1).to_vec();
    let last_ns = *target.time_ns.last()?;
    let n_between = PAUSE_NS / interval_ns - 1;
    for i in 1..=n_between {
        let share = i as f64 / (n_between + 1) as f64;
        target.time_ns.push(last_ns + i * interval_ns);
        target.positions.extend(last.iter().zip(next.frame(0)).map(|(a, b)| a + (b - a) * share));
        target.confidence.extend(vec![1.0; n_joints]);
    }
    target.time_ns.extend(next.time_ns.iter().map(|time| time + shift_ns));
    target.positions.extend_from_slice(&next.positions);
    target.confidence.extend_from_slice(&next.confidence);
    // Nobody asks for the middleware's rotations here.
    target.orientations.clear();
    Some(())
}
