//! Whose turn it is, and how many may wait.
//!
//! A job's turn is the time at which it would be done if its organisation had the service to itself and let what costs less go
//! first: now, its own expected computation, and that of the organisation's waiting jobs that cost no more. Due jobs run in the
//! order of their turns. So a short recording is not stuck behind long ones, an organisation that brings a thousand at once
//! spreads them over the time they take and delays nobody else by more than one, and nothing waits for ever, since turns
//! stay where they are while the clock goes on.

use super::Queue;
use crate::assessment::Settings;
use crate::storage::database::query;
use crate::storage::{Access, StorageError};
use std::time::Duration;

/// Computation of any job, whatever it assesses.
const BASE_MS: u32 = 50;
/// Shortest and longest time after which somebody who was sent away is asked to come again.
const SHORTEST_WAIT: Duration = Duration::from_secs(5);
const LONGEST_WAIT: Duration = Duration::from_secs(600);

/// The expected computation of a job: milliseconds of any, and of every megabyte of its recording. A guess that only the order
/// rests on, after the costs of the default methods in docs/scaling.md.
pub(super) fn expected_cost(settings: &Settings) -> (u32, u32) {
    let per_megabyte = match settings {
        Settings::JointAngles(_) => 100,
        Settings::SkeletonFusion(_) => 60,
        Settings::LegPose(_) => 60,
        Settings::NoiseModel(_) => 2000,
    };
    (BASE_MS, per_megabyte)
}

/// Too many jobs wait for one more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crowded {
    /// True when they are the caller's organisation's; false when they are everybody's.
    pub is_own: bool,
    /// How many wait.
    pub waiting: u64,
    /// When it is worth coming again.
    pub retry_after: Duration,
}

impl Queue {
    /// Expected computation of all jobs that wait, on one worker.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn expected_wait(&self) -> Result<Duration, StorageError> {
        let ms: i64 = query("SELECT CAST(coalesce(sum(expected_ms), 0) AS BIGINT) FROM jobs WHERE state = 'queued'")
            .fetch_value(self.store.reader())
            .await?;
        Ok(Duration::from_millis(ms.unsigned_abs()))
    }

    /// Whether one more job of the caller's organisation may wait.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn room(&self, access: &Access) -> Result<Result<(), Crowded>, StorageError> {
        let row = query(
            "SELECT count(*) AS n_all, CAST(coalesce(sum(expected_ms), 0) AS BIGINT) AS ms_all,
                    count(CASE WHEN organisation_id = $1 THEN 1 END) AS n_own,
                    CAST(coalesce(sum(CASE WHEN organisation_id = $1 THEN expected_ms END), 0) AS BIGINT) AS ms_own
             FROM jobs WHERE state = 'queued'",
        )
        .bind(access.organisation)
        .fetch_one(self.store.reader())
        .await?;
        let crowd = |of: [&str; 2], most: u64, is_own| -> Result<Option<Crowded>, StorageError> {
            let [waiting, ms] = [row.try_get::<i64>(of[0])?, row.try_get::<i64>(of[1])?].map(i64::unsigned_abs);
            let retry_after = Duration::from_millis(ms / 10).clamp(SHORTEST_WAIT, LONGEST_WAIT);
            Ok((waiting >= most).then_some(Crowded { is_own, waiting, retry_after }))
        };
        let own = crowd(["n_own", "ms_own"], self.settings.most_waiting_of_organisation, true)?;
        let all = crowd(["n_all", "ms_all"], self.settings.most_waiting, false)?;
        Ok(own.or(all).map_or(Ok(()), Err))
    }
}
