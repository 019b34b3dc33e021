//! The lag between two clocks, from series that show the same movement.
//!
//! For each lag `L` on a grid, the reference is read at `t − L` and compared with the series at its own times `t`. What
//! is minimised is the variance of the difference, so that a constant offset between the two systems plays no part.
//! A parabola through the best grid point and its neighbours gives the lag between grid points.

use super::interpolation::interpolate;

/// The same quantity, measured on two clocks.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    /// Times of `values`, nanoseconds on the first clock.
    pub time_ns: &'a [i64],
    /// Values on the first clock; NaN where there is none.
    pub values: &'a [f64],
    /// Times of `reference_values`, nanoseconds on the second clock.
    pub reference_time_ns: &'a [i64],
    /// Values on the second clock; NaN where there is none.
    pub reference_values: &'a [f64],
}

/// How the search is done.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Largest lag that is tried, to both sides, nanoseconds.
    pub max_lag_ns: i64,
    /// Step of the grid, nanoseconds.
    pub step_ns: i64,
    /// Fraction of the series' samples that must meet a reference, 0 to 1.
    pub min_overlap: f64,
}

/// The best lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// To be added to the second clock to reach the first, nanoseconds.
    pub lag_ns: i64,
    /// Root mean square difference that is left at the best grid point after the constant offset of each pair, in
    /// the series' unit.
    pub rmse_without_offset: f64,
    /// True when the best lag is the largest that was tried: the truth may lie beyond.
    pub is_at_limit: bool,
}

/// Estimates one lag for all pairs; nothing when no lag has enough overlap.
pub fn estimate_lag(pairs: &[Pair<'_>], search: &Search) -> Option<Lag> {
    let n_steps = search.max_lag_ns / search.step_ns;
    let costs: Vec<Option<f64>> =
        (-n_steps..=n_steps).map(|step| mean_variance(pairs, step * search.step_ns, search.min_overlap)).collect();
    let (best, cost) = costs
        .iter()
        .enumerate()
        .filter_map(|(i, cost)| cost.map(|cost| (i, cost)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let neighbour = |i: Option<usize>| i.and_then(|i| costs.get(i)).copied().flatten();
    let (before, after) = (neighbour(best.checked_sub(1)), neighbour(Some(best + 1)));
    let fraction = match (before, after) {
        (Some(before), Some(after)) => vertex(before, cost, after),
        _ => 0.0,
    };
    Some(Lag {
        lag_ns: (best as i64 - n_steps) * search.step_ns + (fraction * search.step_ns as f64).round() as i64,
        rmse_without_offset: cost.sqrt(),
        is_at_limit: before.is_none() || after.is_none(),
    })
}

/// Place of the lowest point of the parabola through −1, 0 and 1, within ±0.5.
fn vertex(before: f64, middle: f64, after: f64) -> f64 {
    let curvature = before - 2.0 * middle + after;
    // A flat bottom (no movement at all) has no place of its own.
    if curvature > 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Variance of the difference at one lag, mean over the pairs; nothing when a pair overlaps too little.
fn mean_variance(pairs: &[Pair<'_>], lag_ns: i64, min_overlap: f64) -> Option<f64> {
    let mut total = 0.0;
    for pair in pairs {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (&time, &value) in pair.time_ns.iter().zip(pair.values) {
            let reference = interpolate(pair.reference_time_ns, pair.reference_values, time.saturating_sub(lag_ns));
            let difference = value - reference;
            if difference.is_finite() {
                n += 1.0;
                sum += difference;
                squares += difference * difference;
            }
        }
        if n < 3.0 || n < min_overlap * pair.time_ns.len() as f64 {
            return None;
        }
        total += (squares / n - (sum / n) * (sum / n)).max(0.0);
    }
    (!pairs.is_empty()).then(|| total / pairs.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SEARCH: Search = Search { max_lag_ns: 700_000_000, step_ns: 10_000_000, min_overlap: 0.5 };

    fn times(n: i64, rate: i64) -> Vec<i64> {
        (0..n).map(|i| i * 1_000_000_000 / rate).collect()
    }

    /// A squat: one smooth bend of 90 units.
    fn squat(time_ns: i64) -> f64 {
        90.0 * (-((time_ns as f64 * 1e-9 - 1.5) / 0.5).powi(2)).exp()
    }

    proptest! {
        #[test]
        fn a_known_lag_is_found_between_the_grid_points_whatever_the_offset(
            lag_ms in -600..600i64, offset in -50.0..50.0f64
        ) {
            let lag = lag_ms * 1_000_000;
            let (time, reference_time) = (times(90, 30), times(300, 100));
            let values: Vec<f64> = time.iter().map(|&t| squat(t) + offset).collect();
            let reference: Vec<f64> = reference_time.iter().map(|&t| squat(t + lag)).collect();
            let pair = Pair {
                time_ns: &time, values: &values, reference_time_ns: &reference_time, reference_values: &reference,
            };
            let found = estimate_lag(&[pair], &SEARCH).expect("enough overlap");
            // 1 ms: a tenth of the grid; linear interpolation of the reference costs far less.
            prop_assert!((found.lag_ns - lag).abs() < 1_000_000, "{} instead of {lag}", found.lag_ns);
            prop_assert!(found.rmse_without_offset < 1.0 && !found.is_at_limit);
        }
    }

    #[test]
    fn series_that_never_meet_have_no_lag() {
        let time = times(30, 30);
        let late: Vec<i64> = time.iter().map(|t| t + 10_000_000_000).collect();
        let values: Vec<f64> = time.iter().map(|&t| squat(t)).collect();
        let pair = Pair { time_ns: &time, values: &values, reference_time_ns: &late, reference_values: &values };
        assert_eq!(estimate_lag(&[pair], &SEARCH), None);
        assert_eq!(estimate_lag(&[], &SEARCH), None);
    }
}
