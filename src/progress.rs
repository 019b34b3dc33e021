//! Progress of long work, seen from outside, and the polite request to stop.
//!
//! The worker hands a [`Monitor`] to the pipeline; the pipeline says which step it is in and how far; anyone with a
//! clone may read it or ask for cancellation. All calls are wait-free, so a pipeline may report every frame.

use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::time::Instant;
use utoipa::ToSchema;

/// One step of an assessment, in the order in which they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Waiting to begin.
    Waiting,
    /// The uploaded bytes become a recording.
    Decoding,
    /// Segment lengths and the subject's facing direction are estimated.
    Calibrating,
    /// The estimator walks through the frames.
    Estimating,
    /// The backward pass over the frames.
    Smoothing,
    /// Anatomical angles, intervals and the summary are computed.
    Summarizing,
    /// The result is written.
    Saving,
}

impl Step {
    /// The word in the database, at the API and in metrics.
    pub fn name(self) -> &'static str {
        match self {
            Step::Waiting => "waiting",
            Step::Decoding => "decoding",
            Step::Calibrating => "calibrating",
            Step::Estimating => "estimating",
            Step::Smoothing => "smoothing",
            Step::Summarizing => "summarizing",
            Step::Saving => "saving",
        }
    }

    const ALL: [Step; 7] = [
        Step::Waiting,
        Step::Decoding,
        Step::Calibrating,
        Step::Estimating,
        Step::Smoothing,
        Step::Summarizing,
        Step::Saving,
    ];
}

/// A snapshot of how far the work is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// The step that runs.
    pub step: Step,
    /// Units (frames, bytes) of the step that are done.
    pub done: u64,
    /// Units the step has in all; 0 when not known.
    pub total: u64,
}

/// The work was asked to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the work was cancelled")]
pub struct Cancelled;

/// Shared view of one piece of work.
#[derive(Debug, Clone, Default)]
pub struct Monitor {
    state: Arc<State>,
}

#[derive(Debug)]
struct State {
    made: Instant,
    step: AtomicU8,
    /// When the step that runs began, nanoseconds after `made`.
    begun_ns: AtomicU64,
    /// Time that each step took, nanoseconds.
    took_ns: [AtomicU64; Step::ALL.len()],
    done: AtomicU64,
    total: AtomicU64,
    cancelled: AtomicBool,
}

impl Default for State {
    fn default() -> Self {
        Self {
            made: Instant::now(),
            step: AtomicU8::default(),
            begun_ns: AtomicU64::default(),
            took_ns: Default::default(),
            done: AtomicU64::default(),
            total: AtomicU64::default(),
            cancelled: AtomicBool::default(),
        }
    }
}

impl State {
    fn elapsed_ns(&self) -> u64 {
        u64::try_from(self.made.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }
}

impl Monitor {
    /// Enters a step of `total` units; its count starts at zero.
    pub fn begin(&self, step: Step, total: u64) -> Result<(), Cancelled> {
        let now = self.state.elapsed_ns();
        let begun = self.state.begun_ns.swap(now, Ordering::Relaxed);
        if let Some(took) = self.state.took_ns.get(usize::from(self.state.step.load(Ordering::Relaxed))) {
            took.fetch_add(now.saturating_sub(begun), Ordering::Relaxed);
        }
        self.state.done.store(0, Ordering::Relaxed);
        self.state.total.store(total, Ordering::Relaxed);
        self.state.step.store(step as u8, Ordering::Release);
        self.check()
    }

    /// Counts `units` more of the current step as done.
    pub fn advance(&self, units: u64) -> Result<(), Cancelled> {
        self.state.done.fetch_add(units, Ordering::Relaxed);
        self.check()
    }

    /// `Err(Cancelled)` once somebody has asked to stop.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.state.cancelled.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }

    /// Asks the work to stop at its next report.
    pub fn cancel(&self) {
        self.state.cancelled.store(true, Ordering::Relaxed);
    }

    /// Time that each step took which is over, seconds; steps that never ran are left out.
    pub fn durations(&self) -> impl Iterator<Item = (Step, f64)> + '_ {
        let took = self.state.took_ns.iter().map(|took| took.load(Ordering::Relaxed));
        Step::ALL.into_iter().zip(took).filter(|(_, took)| *took > 0).map(|(step, took)| (step, took as f64 * 1e-9))
    }

    /// How far the work is.
    pub fn progress(&self) -> Progress {
        let step = usize::from(self.state.step.load(Ordering::Acquire));
        Progress {
            step: Step::ALL.get(step).copied().unwrap_or(Step::Waiting),
            done: self.state.done.load(Ordering::Relaxed),
            total: self.state.total.load(Ordering::Relaxed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clone_sees_progress_and_can_cancel() {
        let monitor = Monitor::default();
        let viewer = monitor.clone();
        monitor.begin(Step::Estimating, 10).expect("not cancelled");
        monitor.advance(3).expect("not cancelled");
        assert_eq!(viewer.progress(), Progress { step: Step::Estimating, done: 3, total: 10 });
        viewer.cancel();
        assert_eq!(monitor.advance(1), Err(Cancelled));
    }

    #[test]
    fn every_step_is_found_again_by_its_number() {
        for (i, step) in Step::ALL.into_iter().enumerate() {
            assert_eq!(step as usize, i);
        }
    }
}
