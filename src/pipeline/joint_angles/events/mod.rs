//! What went wrong while a recording was taken: found, undone or removed where that is certain, and told.
//!
//! Each kind of event is a file of its own with one function that looks at the [`Scene`], repairs it and says what it
//! found. They run in the order of `KINDS`, so that a later one sees what an earlier one repaired: exchanged limbs
//! are exchanged back before a hand is suspected to have jumped.
//!
//! Thresholds come from what bodies can do, or from the recording's own white noise; none belongs to a data set.

mod frame_gap;
mod hand_jump;
mod limb_swap;
mod lost_joint;
mod lost_user;
mod occlusion;
mod polynomial;
mod scene;
#[cfg(test)]
mod tests;

pub use scene::{Repairs, Scene};

use super::observation::Observations;
use crate::assessment::JointAngleSettings;
use crate::assessment::quality::{Event, EventCount};
use crate::pipeline::PipelineError;
use crate::recording::SkeletonRecording;

/// A kind of event: its name in `quality.events`, and the function that finds it.
struct Kind {
    name: &'static str,
    find: fn(&mut Scene) -> Vec<Finding>,
}

/// Every kind, in the order in which they look.
const KINDS: [Kind; 7] = [
    Kind { name: "frame_gap", find: frame_gap::find },
    Kind { name: "lost_user", find: lost_user::find },
    Kind { name: "lost_joint", find: lost_joint::find },
    Kind { name: "limb_swap", find: limb_swap::find },
    Kind { name: "hand_jump", find: hand_jump::find_hands },
    Kind { name: "foot_jump", find: hand_jump::find_feet },
    Kind { name: "occlusion", find: occlusion::find },
];

/// Findings of one kind and subject that lie closer together than this are one event, seconds. A tracker that loses a
/// joint flickers for some frames before and after.
const MERGED_WITHIN_S: f64 = 0.2;

/// Most events that are listed; a recording in which more happened keeps the longest ones, and counts all.
const MAX_LISTED: usize = 1000;

/// A stretch of frames in which something went wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Finding {
    /// What it concerns, for example `left_wrist`.
    subject: String,
    /// First frame.
    first: usize,
    /// Last frame.
    last: usize,
    /// Frames concerned, or frames that are missing.
    n_frames: u64,
}

impl Finding {
    /// A finding that concerns every frame of a stretch.
    fn of_frames(subject: impl Into<String>, frames: std::ops::Range<usize>) -> Self {
        let n_frames = frames.len() as u64;
        Self { subject: subject.into(), first: frames.start, last: frames.end.saturating_sub(1), n_frames }
    }
}

/// What was found in a recording, and what was done about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// Observations after the repair.
    pub repaired: Observations,
    /// What was done to each frame.
    pub repairs: Repairs,
    /// What happened, by time.
    pub events: Vec<Event>,
    /// How often each kind happened, in the order of looking.
    pub counts: Vec<EventCount>,
}

/// Looks for every kind of event in the observations of a recording, which are still in `world`.
///
/// # Errors
/// `joints_missing` when the recording lacks a joint that the model needs.
pub fn inspect(
    skeleton: &SkeletonRecording,
    observations: &Observations,
    settings: &JointAngleSettings,
) -> Result<Inspection, PipelineError> {
    let mut scene = Scene::new(skeleton, observations, settings)?;
    let (mut events, mut counts) = (Vec::new(), Vec::with_capacity(KINDS.len()));
    for kind in &KINDS {
        let findings = merged((kind.find)(&mut scene), &observations.time_ns);
        let of_kind: Vec<Event> = findings.iter().map(|f| event(kind.name, f, &observations.time_ns)).collect();
        counts.push(EventCount {
            kind: kind.name.to_owned(),
            n_events: of_kind.len() as u64,
            n_frames: of_kind.iter().map(|e| e.n_frames).sum(),
        });
        events.extend(of_kind);
    }
    let (repaired, repairs) = scene.finish();
    Ok(Inspection { repaired, repairs, events: listed(events), counts })
}

fn event(kind: &str, finding: &Finding, time_ns: &[i64]) -> Event {
    let seconds = |t: usize| (time_ns[t] - time_ns[0]) as f64 * 1e-9;
    Event {
        kind: kind.to_owned(),
        subject: finding.subject.clone(),
        start_s: seconds(finding.first),
        end_s: seconds(finding.last),
        n_frames: finding.n_frames,
    }
}

/// Findings by subject and time, those of a subject joined that lie within [`MERGED_WITHIN_S`].
fn merged(mut findings: Vec<Finding>, time_ns: &[i64]) -> Vec<Finding> {
    findings.sort_by(|a, b| (&a.subject, a.first).cmp(&(&b.subject, b.first)));
    let mut merged: Vec<Finding> = Vec::with_capacity(findings.len());
    for finding in findings {
        match merged.last_mut() {
            Some(last)
                if last.subject == finding.subject
                    && (time_ns[finding.first] - time_ns[last.last]) as f64 * 1e-9 <= MERGED_WITHIN_S =>
            {
                last.last = last.last.max(finding.last);
                last.n_frames += finding.n_frames;
            }
            _ => merged.push(finding),
        }
    }
    merged
}

/// The events that are listed, by time; the longest when there are too many.
fn listed(mut events: Vec<Event>) -> Vec<Event> {
    let length = |e: &Event| e.end_s - e.start_s;
    if events.len() > MAX_LISTED {
        events.sort_by(|a, b| length(b).total_cmp(&length(a)));
        events.truncate(MAX_LISTED);
    }
    events.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    events
}

/// Stretches of frames for which a condition holds.
fn stretches(n: usize, holds: impl Fn(usize) -> bool) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let mut start = None;
    for t in 0..=n {
        match (start, t < n && holds(t)) {
            (None, true) => start = Some(t),
            (Some(from), false) => {
                found.push(from..t);
                start = None;
            }
            _ => {}
        }
    }
    found
}
