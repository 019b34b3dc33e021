//! Durable jobs: enqueue, claim, finish.
//!
//! The `jobs` table is the only truth. A job lives like this:
//!
//! ```text
//! queued ──claim──▶ running ──finish──▶ done
//!   ▲  │               │ │ └──fail, for good or too often──▶ failed
//!   │  └──cancel──▶ cancelled ◀──cancel, seen by the worker── ┘
//!   └──fail, to be tried again; lease expired ──┘
//! ```
//!
//! A claim counts an attempt and takes a lease. Whatever a worker writes afterwards is fenced by the attempt's number:
//! if the lease ran out and somebody else has claimed the job, the number differs, nothing is written, and the worker
//! is told [`Lost`](Renewal::Lost). A result is written in the transaction that ends its job, so there is never one
//! without the other.
//!
//! The queue also owns the signals: [`Queue::woken`] for workers, [`Queue::changes`] for whoever watches a job. They
//! only save time; what they say is always in the table too.

mod claiming;
mod consent;
mod enqueueing;
mod finishing;
mod job;
mod messenger;
mod questions;
mod turn;

pub use claiming::Renewal;
pub use consent::Withdrawal;
pub use enqueueing::Submission;
pub use finishing::{Failure, Finish, Trained};
pub use job::{Job, JobError, JobFilter, JobState};
pub use messenger::{Deliveries, Delivery, Messenger};
pub use turn::Crowded;

use crate::config::Config;
use crate::storage::{JobId, Store};
use std::sync::Arc;
use time::Duration;
use tokio::sync::{Notify, broadcast};
use tokio_util::sync::CancellationToken;

/// Code of the error of a job whose workers fell silent too often.
pub const WORKER_LOST: &str = "worker_lost";
/// How far the clocks of machines that share a queue may be apart.
const CLOCK_SLACK: Duration = Duration::minutes(1);
/// Changes that a slow watcher may fall behind before it misses some; it asks the table then.
const CHANGES_KEPT: usize = 1024;

/// How patient the queue is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueSettings {
    /// How long a worker may be silent before its job runs again.
    pub lease: Duration,
    /// How often a job may be begun.
    pub max_attempts: u32,
    /// Pause before the second attempt; each further one waits twice as long as the one before.
    pub first_pause: Duration,
    /// Longest pause between two attempts.
    pub longest_pause: Duration,
    /// How many jobs may wait in all.
    pub most_waiting: u64,
    /// How many jobs of one organisation may wait.
    pub most_waiting_of_organisation: u64,
    /// Whether a recording and a job need the patient's consent.
    pub require_consent: bool,
}

impl Default for QueueSettings {
    fn default() -> Self {
        Self::from(&Config::default())
    }
}

impl From<&Config> for QueueSettings {
    fn from(config: &Config) -> Self {
        Self {
            lease: Duration::seconds(i64::try_from(config.lease_s).unwrap_or(i64::MAX).clamp(1, 86_400)),
            max_attempts: config.max_attempts.max(1),
            first_pause: Duration::seconds(2),
            longest_pause: Duration::minutes(5),
            most_waiting: config.max_waiting_jobs,
            most_waiting_of_organisation: config.max_waiting_jobs_of_organisation,
            require_consent: config.require_consent,
        }
    }
}

impl QueueSettings {
    /// How far ahead the time at which a job is due can lie. One that lies further was written by a clock that has been set back
    /// since, and counts as past: nobody would wait for it.
    fn furthest_due(&self) -> Duration {
        self.lease.max(self.longest_pause) + CLOCK_SLACK
    }

    /// Pause after a failed attempt, the first being 1.
    fn pause_after(&self, attempt: u32) -> Duration {
        // 2^20 times two seconds is far beyond any longest pause, and within a Duration.
        let doublings = attempt.saturating_sub(1).min(20);
        (self.first_pause * 2f64.powi(doublings as i32)).min(self.longest_pause)
    }
}

/// The jobs of a store. A clone is another handle to the same, signals included.
#[derive(Debug, Clone)]
pub struct Queue {
    store: Store,
    settings: QueueSettings,
    wake: Arc<Notify>,
    changes: broadcast::Sender<JobId>,
    messenger: Messenger,
}

impl Queue {
    /// The queue of a store. Make one per process and clone it: the signals reach the clones only.
    pub fn new(store: Store, settings: QueueSettings) -> Self {
        let changes = broadcast::channel(CHANGES_KEPT).0;
        Self { store, settings, wake: Arc::new(Notify::new()), changes, messenger: Messenger::default() }
    }

    /// The same queue, whose news also go to other machines, and come from there until `shutdown`.
    #[must_use]
    pub fn with_messenger(self, messenger: Messenger, shutdown: &CancellationToken) -> Self {
        messenger.listen(&self.changes, shutdown);
        Self { messenger, ..self }
    }

    /// The store that holds the jobs.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// How patient the queue is.
    pub fn settings(&self) -> &QueueSettings {
        &self.settings
    }

    /// Ready once a job may be waiting. Register (`enable`) before looking for a job, so that one which comes between
    /// the look and the wait is not slept through.
    pub fn woken(&self) -> tokio::sync::futures::Notified<'_> {
        self.wake.notified()
    }

    /// Ids of jobs as they change in this process: state and progress. Subscribe before reading the job.
    pub fn changes(&self) -> broadcast::Receiver<JobId> {
        self.changes.subscribe()
    }

    /// News from other machines that jobs wait, for one worker.
    pub fn deliveries(&self) -> Deliveries {
        self.messenger.deliveries()
    }

    fn wake_worker(&self, id: JobId) {
        // Inside of the request's span: so a job is found in the log by the request that asked for it.
        tracing::info!(job = %id, "a job waits");
        self.wake.notify_one();
        self.messenger.tell_waiting(id);
    }

    fn announce(&self, id: JobId) {
        // An error says that nobody watches.
        let _ = self.changes.send(id);
        self.messenger.tell_changed(id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pause_doubles_from_attempt_to_attempt_up_to_a_limit() {
        let settings = QueueSettings::default();
        let pauses: Vec<i64> = [1, 2, 3, 4, 100].map(|a| settings.pause_after(a).whole_seconds()).into();
        assert_eq!(pauses, [2, 4, 8, 16, 300]);
    }
}
