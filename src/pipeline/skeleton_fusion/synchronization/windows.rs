//! The offset of a unit in each of many windows, from the lag at which force and rate fit best there.

use super::line::Line;
use super::motion::Motion;
use super::search::INDEPENDENT_HZ;
use crate::signal::correlation::{Prepared, top_of_parabola};
use crate::signal::grid::read;

/// Length of a window, seconds: a few movements, in which a drift of 200 ppm makes 2 ms.
const WINDOW_S: std::ops::RangeInclusive<f64> = 2.5..=10.0;

/// Windows that a short recording is cut into.
const WINDOWS: f64 = 4.0;

/// Correlation below which a window says nothing.
const MIN_CORRELATION: f64 = 0.5;

/// Standard deviations below which nothing moves, of force (m/s²) and rate (rad/s): the smoothed jitter of a camera.
const MIN_MOVEMENT: [f64; 2] = [0.15, 0.05];

/// Part of a window in which both sides must have been seen.
const MIN_SEEN: f64 = 0.7;

/// What one window says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Observation {
    /// Middle of the window, seconds from the unit's first node.
    pub unit_s: f64,
    /// Camera's time minus unit's time there, both from their first node, seconds.
    pub difference_s: f64,
    /// Its variance as far as noise makes it, s².
    pub variance: f64,
    /// Middle of the window on the camera's clock, seconds from its first node.
    pub camera_s: f64,
}

/// Observes every window around where `line` predicts the unit, `slack_s` to both sides.
pub(super) fn observe(camera: &Motion, unit: &Motion, line: &Line, slack_s: f64) -> Vec<Observation> {
    let step_s = camera.grid.step_s();
    let node = |seconds: f64| (seconds / step_s).max(0.0) as usize;
    let first = node(line.camera_s(0.0)).min(camera.grid.len);
    let last = node(line.camera_s(unit.grid.len as f64 * step_s)).clamp(first, camera.grid.len);
    let overlap_s = (last - first) as f64 * step_s;
    let length = node((overlap_s / WINDOWS).clamp(*WINDOW_S.start(), *WINDOW_S.end())).min(last - first);
    if length == 0 {
        return Vec::new();
    }
    let reach = (slack_s / step_s).ceil() as usize + 1;
    let mut observations = Vec::new();
    for start in (first..=last - length).step_by(length) {
        let middle_s = (start as f64 + 0.5 * (length - 1) as f64) * step_s;
        let unit_s = line.unit_s(middle_s);
        let predicted_s = middle_s - unit_s;
        // Where in the unit each node of the window and `reach` nodes to both sides of it are predicted.
        let place = |i: usize| line.unit_s((start + i) as f64 * step_s - reach as f64 * step_s) / step_s;
        let places = || (0..length + 2 * reach).map(place);
        for (channel, (seen, units)) in
            [(&camera.force, &unit.force), (&camera.rate, &unit.rate)].into_iter().enumerate()
        {
            let seen = &seen[start..start + length];
            let moved: Vec<f64> = places().map(|place| read(units, place)).collect();
            if let Some((lag, variance)) = best_lag(seen, &moved, reach, MIN_MOVEMENT[channel], step_s) {
                observations.push(Observation {
                    unit_s,
                    // What comes `lag` steps late in the unit is mapped `lag` steps too late.
                    difference_s: predicted_s - lag * step_s,
                    variance: variance * step_s * step_s,
                    camera_s: middle_s,
                });
            }
        }
    }
    observations
}

/// Steps by which `moved`, less the `reach` it has in advance, is late against `seen`, and its variance in steps².
///
/// For y = g x(t − τ) + noise the variance of τ is σ² / (n g² ⟨ẋ²⟩), in terms of the correlation ρ and its curvature κ
/// relative to ρ: (1 − ρ²) / (n ρ² κ).
fn best_lag(seen: &[f64], moved: &[f64], reach: usize, min_movement: f64, step_s: f64) -> Option<(f64, f64)> {
    let n_seen = seen.iter().zip(&moved[reach..]).filter(|(a, b)| a.is_finite() && b.is_finite()).count();
    if (n_seen as f64) < MIN_SEEN * seen.len() as f64 {
        return None;
    }
    let (seen, moved) = (Prepared::new(seen.iter().copied())?, Prepared::new(moved.iter().copied())?);
    if seen.sd() < min_movement || moved.sd() < min_movement {
        return None;
    }
    let correlations: Vec<f64> =
        (0..=2 * reach as i64).map(|lag| moved.correlation(&seen, 0..seen.len(), lag)).collect();
    let top = (0..correlations.len()).max_by(|&a, &b| correlations[a].total_cmp(&correlations[b]))?;
    let best = correlations[top];
    if best < MIN_CORRELATION || top == 0 || top == 2 * reach {
        return None;
    }
    let (fraction, curvature) = top_of_parabola(correlations[top - 1], best, correlations[top + 1])?;
    let n = n_seen as f64 * step_s * INDEPENDENT_HZ;
    let variance = (1.0 - best * best).max(0.0) / (n * best * best * (-curvature / best));
    Some((top as f64 + fraction - reach as f64, variance))
}
