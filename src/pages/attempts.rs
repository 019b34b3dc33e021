//! How many sign-ins may fail in a minute. Nobody guesses 256 random bits; the bound keeps a program that tries from costing the
//! service work and its log room. It counts for the process as a whole, since behind a proxy everybody has one address.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time over which failures are counted.
const WINDOW: Duration = Duration::from_secs(60);
/// Failures in that time after which sign-ins wait: far more than the clinicians of a house mistype.
const MOST_FAILURES: usize = 60;

/// Sign-ins that failed lately.
#[derive(Debug, Default)]
pub(super) struct Attempts(Mutex<VecDeque<Instant>>);

impl Attempts {
    /// Time until a sign-in may be tried; zero when it may at once.
    pub(super) fn wait(&self, now: Instant) -> Duration {
        let mut failures = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        while failures.front().is_some_and(|first| now.duration_since(*first) >= WINDOW) {
            failures.pop_front();
        }
        match failures.front() {
            Some(first) if failures.len() >= MOST_FAILURES => WINDOW - now.duration_since(*first),
            _ => Duration::ZERO,
        }
    }

    /// Notes a failure.
    pub(super) fn failed(&self, now: Instant) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push_back(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_sixty_failures_in_a_minute_the_next_waits_for_the_rest_of_the_minute() {
        let attempts = Attempts::default();
        let start = Instant::now();
        for i in 0..MOST_FAILURES {
            assert_eq!(attempts.wait(start), Duration::ZERO, "after {i}");
            attempts.failed(start);
        }
        assert_eq!(attempts.wait(start + Duration::from_secs(20)), Duration::from_secs(40));
        assert_eq!(attempts.wait(start + WINDOW), Duration::ZERO);
    }
}
