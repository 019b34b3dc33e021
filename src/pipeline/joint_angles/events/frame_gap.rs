//! `frame_gap`: frames that never came, as when a device is busy.

use super::lost_user::is_absence;
use super::{Finding, Scene};

/// A gap begins where the time between two frames is this many times the median: two frames and more are missing. One
/// missing frame is every sensor's everyday.
const INTERVALS: f64 = 2.5;

/// Gaps between frames; `n_frames` says how many are missing by the median interval. Gaps so long that the tracker must
/// have lost its user are left to `lost_user`.
pub(super) fn find(scene: &mut Scene) -> Vec<Finding> {
    let median = scene.median_interval_s();
    let gap = |t: usize| scene.observations.interval_s(t);
    (1..scene.len())
        .filter(|t| gap(*t) > INTERVALS * median && !is_absence(gap(*t), median))
        .map(|t| between("recording", t, gap(t), median))
        .collect()
}

/// The gap that ends at frame `t`.
pub(super) fn between(subject: &str, t: usize, gap_s: f64, median_s: f64) -> Finding {
    // The least interval is a nanosecond: time stamps strictly increase.
    let missing = (gap_s / median_s.max(1e-9)).round() as u64;
    Finding { subject: subject.to_owned(), first: t - 1, last: t, n_frames: missing.saturating_sub(1) }
}
