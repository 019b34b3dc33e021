//! Wall-clock time, passed in so that tests can turn it by hand.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use time::{Duration, OffsetDateTime};

/// Whoever knows what time it is.
pub trait Clock: fmt::Debug + Send + Sync {
    /// The time in UTC.
    fn now(&self) -> OffsetDateTime;
}

/// The clock of the machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    fn now(&self) -> OffsetDateTime {
        OffsetDateTime::now_utc()
    }
}

/// A clock that stands still until it is turned; clones show the same time.
#[derive(Debug, Clone)]
pub struct ManualClock(Arc<AtomicI64>);

impl ManualClock {
    /// A clock that shows `time`.
    pub fn at(time: OffsetDateTime) -> Self {
        Self(Arc::new(AtomicI64::new(ms_from_time(time))))
    }

    /// Turns the clock forward, or back by a negative duration.
    pub fn advance(&self, by: Duration) {
        self.0.fetch_add(i64::try_from(by.whole_milliseconds()).unwrap_or(i64::MAX), Ordering::SeqCst);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> OffsetDateTime {
        time_from_ms(self.0.load(Ordering::SeqCst)).unwrap_or(OffsetDateTime::UNIX_EPOCH)
    }
}

/// Milliseconds since 1970 UTC, the form in which the database holds a time.
pub(crate) fn ms_from_time(time: OffsetDateTime) -> i64 {
    // Years -9999 to 9999 in milliseconds need 48 bits.
    (time.unix_timestamp_nanos() / 1_000_000) as i64
}

/// The time that is `ms` milliseconds after 1970 UTC; `None` beyond the year 9999.
pub(crate) fn time_from_ms(ms: i64) -> Option<OffsetDateTime> {
    OffsetDateTime::from_unix_timestamp_nanos(i128::from(ms) * 1_000_000).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use time::macros::datetime;

    #[test]
    fn a_time_keeps_its_milliseconds_through_the_database_form() {
        let time = datetime!(2026-11-22 06:31:35.123 UTC);
        assert_eq!(time_from_ms(ms_from_time(time)), Some(time));
    }

    #[test]
    fn a_manual_clock_moves_only_when_turned() {
        let clock = ManualClock::at(datetime!(2026-11-22 00:00 UTC));
        let other = clock.clone();
        clock.advance(Duration::seconds(30));
        assert_eq!(other.now(), datetime!(2026-11-22 00:00:30 UTC));
    }
}
