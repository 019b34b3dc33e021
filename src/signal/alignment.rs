//! The lag between two clocks, from series that show the same movement.
//!
//! For each lag `L` on a grid, the reference is read at `t − L` and compared with the series at its own times `t`. What
//! is minimised is the variance of the difference, so that a constant offset between the two systems plays no part;
//! on request also a constant gain is fitted away, for sensors that see the movement too small.
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
    /// True when a constant gain between the two systems is fitted as well as the offset.
    pub fits_gain: bool,
}

/// The best lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// To be added to the second clock to reach the first, nanoseconds.
    pub lag_ns: i64,
    /// Root mean square difference that is left at the best grid point after the constant offset (and gain) of each
    /// pair, in the series' unit.
    pub rmse_without_offset: f64,
    /// Part of the series' variance that the reference explains at the best grid point, at most 1.
    pub explained: f64,
    /// True when the best lag is the largest that was tried: the truth may lie beyond.
    pub is_at_limit: bool,
}

/// Estimates one lag for all pairs; nothing when no lag has enough overlap.
pub fn estimate_lag(pairs: &[Pair<'_>], search: &Search) -> Option<Lag> {
    let n_steps = search.max_lag_ns / search.step_ns;
    let costs: Vec<Option<Cost>> =
        (-n_steps..=n_steps).map(|step| mean_cost(pairs, step * search.step_ns, search)).collect();
    let (best, Cost { left: cost, variance }) = costs
        .iter()
        .enumerate()
        .filter_map(|(i, cost)| cost.map(|cost| (i, cost)))
        .min_by(|a, b| a.1.left.total_cmp(&b.1.left))?;
    let neighbour = |i: Option<usize>| i.and_then(|i| costs.get(i)).copied().flatten().map(|cost| cost.left);
    let (before, after) = (neighbour(best.checked_sub(1)), neighbour(Some(best + 1)));
    let fraction = match (before, after) {
        (Some(before), Some(after)) => vertex(before, cost, after),
        _ => 0.0,
    };
    Some(Lag {
        lag_ns: (best as i64 - n_steps) * search.step_ns + (fraction * search.step_ns as f64).round() as i64,
        rmse_without_offset: cost.sqrt(),
        explained: if variance > 0.0 { 1.0 - cost / variance } else { 0.0 },
        is_at_limit: before.is_none() || after.is_none(),
    })
}

/// Place of the lowest point of the parabola through −1, 0 and 1, within ±0.5.
fn vertex(before: f64, middle: f64, after: f64) -> f64 {
    let curvature = before - 2.0 * middle + after;
    // A flat bottom (no movement at all) has no place of its own.
    if curvature > 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Mean over the pairs of what one lag leaves unexplained, and of the series' own variance.
#[derive(Debug, Clone, Copy)]
struct Cost {
    left: f64,
    variance: f64,
}

/// The cost of one lag; nothing when a pair overlaps too little.
fn mean_cost(pairs: &[Pair<'_>], lag_ns: i64, search: &Search) -> Option<Cost> {
    let mut total = Cost { left: 0.0, variance: 0.0 };
    let mut both = Vec::new();
    for pair in pairs {
        both.clear();
        for (&time, &value) in pair.time_ns.iter().zip(pair.values) {
            let reference = interpolate(pair.reference_time_ns, pair.reference_values, time.saturating_sub(lag_ns));
            if value.is_finite() && reference.is_finite() {
                both.push((value, reference));
            }
        }
        let n = both.len() as f64;
        if n < 3.0 || n < search.min_overlap * pair.time_ns.len() as f64 {
            return None;
        }
        let mean = both.iter().fold((0.0, 0.0), |sum, (v, r)| (sum.0 + v / n, sum.1 + r / n));
        let (mut vv, mut vr, mut rr) = (0.0, 0.0, 0.0);
        for (v, r) in &both {
            let (v, r) = (v - mean.0, r - mean.1);
            vv += v * v / n;
            vr += v * r / n;
            rr += r * r / n;
        }
        let left = match search.fits_gain {
            true if rr > 0.0 => vv - vr * vr / rr,
            true => vv,
            false => vv - 2.0 * vr + rr,
        };
        total.left += left.max(0.0);
        total.variance += vv;
    }
    let n = pairs.len() as f64;
    (!pairs.is_empty()).then(|| Cost { left: total.left / n, variance: total.variance / n })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SEARCH: Search = Search { max_lag_ns: 700_000_000, step_ns: 10_000_000, min_overlap: 0.5, fits_gain: false };

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
            prop_assert!(found.rmse_without_offset < 1.0 && found.explained > 0.99 && !found.is_at_limit);
        }

        #[test]
        fn a_gain_is_fitted_away_on_request(lag_ms in -300..300i64, gain in 0.3..3.0f64) {
            let lag = lag_ms * 1_000_000;
            let (time, reference_time) = (times(90, 30), times(300, 100));
            let values: Vec<f64> = time.iter().map(|&t| gain * squat(t) - 7.0).collect();
            let reference: Vec<f64> = reference_time.iter().map(|&t| squat(t + lag)).collect();
            let pair = Pair {
                time_ns: &time, values: &values, reference_time_ns: &reference_time, reference_values: &reference,
            };
            let found = estimate_lag(&[pair], &Search { fits_gain: true, ..SEARCH }).expect("enough overlap");
            prop_assert!((found.lag_ns - lag).abs() < 1_000_000, "{} instead of {lag}", found.lag_ns);
            prop_assert!(found.explained > 0.99);
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
