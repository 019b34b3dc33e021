//! Where a unit's series lies on the camera's clock, to a twentieth of a second.
//!
//! Each lag is scored by how much better the camera's series explains the unit's than a constant does, in nats, summed
//! over windows of some seconds, force and rate:
//!
//! ```text
//! score = − ½ Σ n ln(1 − ρ²),   n = seconds of overlap × independent values per second
//! ```
//!
//! so that a short overlap by which anything can be explained does not win, and a stretch in which the unit was not on
//! the body yet takes nothing away from the rest. Movement that repeats itself explains
//! the unit equally well at several lags; a rival as good as the best makes the answer none.

use super::Refusal;
use super::motion::Motion;
use crate::signal::correlation::{Prepared, overlap};
use std::ops::Range;

/// Nodes of the fine grid to one of the coarse: 50 ms, as long as the smoothing.
const COARSE: usize = 5;

/// Independent values in a second of smoothed movement: people move their limbs below 2 Hz and the deviations between
/// camera and unit last as long.
pub(super) const INDEPENDENT_HZ: f64 = 2.0;

/// Length of a window, seconds.
const WINDOW_S: f64 = 10.0;

/// Correlation below which a window counts nothing: by chance, 20 independent values reach it once in a hundred times.
const COUNTS: f64 = 0.5;

/// Part of the best score above which neighbouring lags belong to the same hill.
const HILL: f64 = 0.7;

/// Part of the best score from which on another hill is a rival.
const RIVAL: f64 = 0.85;

/// Part of the best lag's overlap from which on a rival is also judged by its score for each second.
const RIVAL_OVERLAP: f64 = 0.5;

/// Least score, nats: a hundred lags by chance give half as much.
const MIN_SCORE: f64 = 8.0;

/// Correlation that force or rate must reach.
const MIN_CORRELATION: f64 = 0.6;

/// Least part that is left unexplained: no movement is seen better than to a thousandth.
const EXPLAINED: f64 = 1e-3;

/// Shortest overlap, also of a window, seconds.
const MIN_OVERLAP_S: f64 = 1.5;

/// The series of one side at coarse nodes.
pub(super) struct Coarse {
    force: Option<Prepared>,
    rate: Option<Prepared>,
    len: usize,
    step_s: f64,
}

impl Coarse {
    pub(super) fn new(motion: &Motion) -> Self {
        let thin = |series: &[f64]| Prepared::new(series.iter().copied().step_by(COARSE));
        let len = motion.grid.len.div_ceil(COARSE);
        Self { force: thin(&motion.force), rate: thin(&motion.rate), len, step_s: motion.grid.step_s() * COARSE as f64 }
    }

    /// The same with the rate alone.
    pub(super) fn without_force(mut self) -> Self {
        self.force = None;
        self
    }

    /// The highest score of a unit at any lag in a range, camera minus unit, of the first nodes, seconds; and the
    /// correlation that gives this score over the whole overlap.
    pub(super) fn best_score(&self, unit: &Coarse, range_s: Range<f64>) -> (f64, f64) {
        let lags = self.lags(unit, range_s);
        let best = lags.map(|lag| self.score(unit, lag)).max_by(|a, b| a.score.total_cmp(&b.score));
        let Some(Scored { score, overlap_s, .. }) = best.filter(|best| best.overlap_s > 0.0) else { return (0.0, 0.0) };
        (score, (1.0 - (-2.0 * score / (overlap_s * INDEPENDENT_HZ)).exp()).sqrt())
    }

    /// The lags of a range at which anything overlaps, which also bounds the work when a clock is years away.
    fn lags(&self, unit: &Coarse, range_s: Range<f64>) -> Range<i64> {
        let (first, last) = ((range_s.start / self.step_s).floor() as i64, (range_s.end / self.step_s).ceil() as i64);
        first.max(-(unit.len as i64))..last.saturating_add(1).min(self.len as i64)
    }

    fn score(&self, unit: &Coarse, lag: i64) -> Scored {
        let mut scored = Scored { lag, score: 0.0, overlap_s: 0.0, correlation: 0.0 };
        let window = (WINDOW_S / self.step_s) as usize;
        for start in (0..self.len).step_by(window) {
            let nodes = overlap(unit.len, self.len, start..start + window, -lag);
            let overlap_s = nodes.len() as f64 * self.step_s;
            if overlap_s < MIN_OVERLAP_S {
                continue;
            }
            scored.overlap_s += overlap_s;
            for (seen, felt) in [(&self.force, &unit.force), (&self.rate, &unit.rate)] {
                let (Some(seen), Some(felt)) = (seen, felt) else { continue };
                let rho = felt.correlation(seen, nodes.clone(), -lag);
                if rho > COUNTS {
                    scored.score -= 0.5 * overlap_s * INDEPENDENT_HZ * (1.0 - rho * rho).max(EXPLAINED).ln();
                    scored.correlation = scored.correlation.max(rho);
                }
            }
        }
        scored
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Scored {
    lag: i64,
    score: f64,
    overlap_s: f64,
    correlation: f64,
}

/// What was found: camera node = unit node + lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Lag of the first nodes against each other, seconds.
    pub lag_s: f64,
    /// Nats.
    pub score: f64,
}

/// The lag within `range_s` (camera minus unit, of the first nodes, seconds) at which the unit fits best.
pub(super) fn search(camera: &Coarse, unit: &Coarse, range_s: Range<f64>) -> Result<Found, Refusal> {
    let lags = camera.lags(unit, range_s);
    let scores: Vec<Scored> = lags.map(|lag| camera.score(unit, lag)).collect();
    judge(&scores, camera.step_s)
}

/// The best of the lags at which a train of the unit may coincide with one of the camera (both in fine nodes).
pub(super) fn search_jumps(
    camera: &Coarse,
    camera_trains: &[Vec<f64>],
    unit: &Coarse,
    unit_trains: &[Vec<f64>],
) -> Result<Found, Refusal> {
    // A flight's middle is known to a tenth of a second; the neighbours beyond show that the top is a top.
    const AROUND: i64 = 4;
    let mut lags: Vec<i64> = Vec::new();
    for flight in camera_trains.iter().flatten() {
        for other in unit_trains.iter().flatten() {
            let lag = ((flight - other) / COARSE as f64).round() as i64;
            lags.extend(lag - AROUND..=lag + AROUND);
        }
    }
    lags.sort_unstable();
    lags.dedup();
    let scores: Vec<Scored> = lags.into_iter().map(|lag| camera.score(unit, lag)).collect();
    judge(&scores, camera.step_s)
}

/// The best lag, unless it is not good enough or not alone.
fn judge(scores: &[Scored], step_s: f64) -> Result<Found, Refusal> {
    if scores.iter().all(|s| s.overlap_s < MIN_OVERLAP_S) {
        return Err(Refusal::NoOverlap);
    }
    let Some(best) = scores.iter().copied().max_by(|a, b| a.score.total_cmp(&b.score)) else {
        return Err(Refusal::NoOverlap);
    };
    if best.score < MIN_SCORE || best.correlation < MIN_CORRELATION {
        return Err(Refusal::NoSharedMovement);
    }
    let top = scores.iter().position(|s| s.lag == best.lag).unwrap_or(0);
    let is_hill = |s: &&Scored| s.score > HILL * best.score;
    let before = top - scores[..top].iter().rev().take_while(is_hill).count();
    let after = top + scores[top..].iter().take_while(is_hill).count();
    let per_second = |s: &Scored| s.score / s.overlap_s;
    let rival = scores[..before].iter().chain(&scores[after..]).find(|s| {
        s.score > RIVAL * best.score
            || (s.overlap_s > RIVAL_OVERLAP * best.overlap_s && per_second(s) > RIVAL.sqrt() * per_second(&best))
    });
    match rival {
        Some(rival) => Err(Refusal::Ambiguous { lags_s: [best.lag, rival.lag].map(|lag| lag as f64 * step_s) }),
        None => Ok(Found { lag_s: best.lag as f64 * step_s, score: best.score }),
    }
}
