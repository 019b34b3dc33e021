//! Progress of an evaluation on standard error.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};

/// A bar for a terminal; a line for each tenth of the trials otherwise, so that a log shows that work goes on.
pub(super) struct Watch {
    bar: Option<ProgressBar>,
    done: AtomicU64,
    total: u64,
}

impl Watch {
    pub(super) fn new(total: u64) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(total);
            if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} trials, {eta} left") {
                bar.set_style(style);
            }
            bar
        });
        Self { bar, done: AtomicU64::new(0), total }
    }

    /// A trial is done.
    pub(super) fn one_more(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        match &self.bar {
            Some(bar) => bar.inc(1),
            None if self.is_tenth(done) => eprintln!("{done} of {} trials", self.total),
            None => {}
        }
    }

    /// True when `done` is the first trial of a further tenth.
    fn is_tenth(&self, done: u64) -> bool {
        10 * done / self.total.max(1) > 10 * (done - 1) / self.total.max(1)
    }

    pub(super) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_gets_ten_lines_of_many_trials_and_one_each_of_few() {
        let lines = |total: u64| {
            let watch = Watch { bar: None, done: AtomicU64::new(0), total };
            (1..=total).filter(|done| watch.is_tenth(*done)).count()
        };
        assert_eq!((lines(200), lines(37), lines(3)), (10, 10, 3));
    }
}
