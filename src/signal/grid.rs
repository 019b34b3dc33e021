//! Series on a regular grid of time: averaged onto it, smoothed, read between its nodes.
//!
//! Everything here is symmetric in time, so that nothing shifts a series against another one.

use super::interpolation::NS_PER_S;
use nalgebra::Vector3;

/// A regular grid of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Time of the first node, nanoseconds.
    pub start_ns: i64,
    /// Distance of two nodes, nanoseconds, positive.
    pub step_ns: i64,
    /// Number of nodes.
    pub len: usize,
}

impl Grid {
    /// The grid whose cells, one step wide and centred on the nodes, fill the time from `first_ns` to `last_ns`.
    pub fn between(first_ns: i64, last_ns: i64, step_ns: i64) -> Self {
        let len = (last_ns.saturating_sub(first_ns) / step_ns).max(0) as usize;
        Self { start_ns: first_ns + step_ns / 2, step_ns, len }
    }

    /// Time of node `i`, nanoseconds.
    pub fn time_ns(&self, i: usize) -> i64 {
        self.start_ns + i as i64 * self.step_ns
    }

    /// Distance of two nodes, seconds.
    pub fn step_s(&self) -> f64 {
        self.step_ns as f64 / NS_PER_S
    }
}

/// Mean over each cell of the polygon through the samples; NaN in a cell that touches an interval without samples
/// longer than `max_gap_ns`.
///
/// The mean of the polygon, not of the samples, is exactly centred on the node whatever the sampling: many samples to
/// a cell, few, none, or irregular ones. `time_ns` is strictly increasing and as long as `values`; the grid lies
/// between the first and the last of them.
pub fn cell_means(grid: &Grid, time_ns: &[i64], values: &[Vector3<f64>], max_gap_ns: i64) -> Vec<Vector3<f64>> {
    let mut means = Vec::with_capacity(grid.len);
    let lower = grid.start_ns - grid.step_ns / 2;
    let seconds = |time: i64| (time - lower) as f64 / NS_PER_S;
    // The integral of the polygon at the last edge that was passed, and at the sample before it.
    let (mut at_edge, mut at_sample) = (Vector3::zeros(), Vector3::zeros());
    let mut touches_gap = false;
    let mut edge = 0;
    for i in 1..time_ns.len().min(values.len()) {
        let (from, to) = (seconds(time_ns[i - 1]), seconds(time_ns[i]));
        let slope = (values[i] - values[i - 1]) / (to - from);
        let is_gap = time_ns[i] - time_ns[i - 1] > max_gap_ns;
        touches_gap |= is_gap;
        while edge <= grid.len {
            let edge_s = edge as f64 * grid.step_s();
            if edge_s > to {
                break;
            }
            let elapsed = edge_s - from;
            let integral = at_sample + (values[i - 1] + slope * (0.5 * elapsed)) * elapsed;
            if edge > 0 {
                let mean = (integral - at_edge) / grid.step_s();
                means.push(if touches_gap { Vector3::repeat(f64::NAN) } else { mean });
                touches_gap = is_gap;
            }
            at_edge = integral;
            edge += 1;
        }
        at_sample += (values[i - 1] + values[i]) * (0.5 * (to - from));
    }
    // Rounding may leave the last edge a hair behind the last sample.
    means.resize(grid.len, Vector3::repeat(f64::NAN));
    means
}

/// Smooths in place with a kernel close to a Gaussian of `sd` steps; NaN where the kernel meets a NaN or an end.
///
/// Three running means in a row have the shape of a Gaussian to a few per cent and cost the same for any `sd`
/// (W. M. Wells, IEEE PAMI 8, 1986). Two neighbouring odd widths are mixed to come close to the variance.
pub fn smooth(values: &mut Vec<Vector3<f64>>, sd: f64) {
    for width in running_mean_widths(sd) {
        running_mean(values, width);
    }
}

/// Number of running means.
const PASSES: usize = 3;

/// Odd widths of the running means whose variances, (w² − 1)/12 each, add up to about `sd`².
fn running_mean_widths(sd: f64) -> [usize; PASSES] {
    let n = PASSES as f64;
    let ideal = (12.0 * sd * sd / n + 1.0).sqrt();
    let narrow = ((ideal as usize).saturating_sub(1) / 2) * 2 + 1;
    let w = narrow as f64;
    // How many of the passes keep the narrow width so that the sum of variances is nearest: the wide one is w + 2.
    let n_narrow = ((n * (w * w + 4.0 * w + 3.0) - 12.0 * sd * sd) / (4.0 * w + 4.0)).round();
    std::array::from_fn(|i| if (i as f64) < n_narrow { narrow } else { narrow + 2 })
}

/// Mean over an odd number of nodes centred on each.
fn running_mean(values: &mut Vec<Vector3<f64>>, width: usize) {
    let missing = Vector3::repeat(f64::NAN);
    let half = width / 2;
    let mut means = vec![missing; values.len()];
    let (mut sum, mut n_run) = (Vector3::zeros(), 0);
    for i in 0..values.len() {
        if values[i].x.is_nan() {
            (sum, n_run) = (Vector3::zeros(), 0);
            continue;
        }
        sum += values[i];
        n_run += 1;
        if n_run > width {
            sum -= values[i - width];
            n_run = width;
        }
        if n_run == width {
            means[i - half] = sum / width as f64;
        }
    }
    *values = means;
}

/// Value between the nodes on the cubic through the four around it (Catmull–Rom), `position` in steps from the first
/// node; NaN outside and beside a NaN.
pub fn read(values: &[f64], position: f64) -> f64 {
    let floor = position.floor();
    if !(floor >= 1.0 && floor + 2.0 < values.len() as f64) {
        return f64::NAN;
    }
    let (i, x) = (floor as usize, position - floor);
    let [a, b, c, d] = [values[i - 1], values[i], values[i + 1], values[i + 2]];
    b + 0.5 * x * (c - a + x * (2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(t: i64) -> Vector3<f64> {
        Vector3::new(t as f64, 1.0, -2.0 * t as f64)
    }

    #[test]
    fn cells_of_a_straight_line_have_the_value_of_their_node_however_it_was_sampled() {
        for times in [vec![0, 3, 4, 9, 17, 30, 41, 80], (0..=80).collect(), vec![0, 80]] {
            let values: Vec<_> = times.iter().map(|&t| polygon(t)).collect();
            let grid = Grid::between(0, 80, 10);
            let means = cell_means(&grid, &times, &values, i64::MAX);
            assert_eq!(means.len(), 8);
            for (i, mean) in means.iter().enumerate() {
                assert!((mean - polygon(grid.time_ns(i))).norm() < 1e-6, "{i}: {mean}");
            }
        }
    }

    #[test]
    fn cells_that_touch_a_gap_are_missing() {
        let times = [0, 5, 10, 15, 20, 48, 50, 55, 60, 65, 70];
        let values: Vec<_> = times.iter().map(|&t| polygon(t)).collect();
        let means = cell_means(&Grid::between(0, 70, 10), &times, &values, 10);
        let is_missing: Vec<bool> = means.iter().map(|m| m.x.is_nan()).collect();
        assert_eq!(is_missing, [false, false, true, true, true, false, false]);
    }

    #[test]
    fn smoothing_keeps_the_place_of_a_pulse_and_has_the_asked_width() {
        for sd in [2.0, 5.0, 6.3, 9.0] {
            let mut pulse = vec![Vector3::zeros(); 201];
            pulse[100].x = 1.0;
            smooth(&mut pulse, sd);
            let seen = || pulse.iter().enumerate().filter(|(_, v)| v.x.is_finite());
            let sum: f64 = seen().map(|(_, v)| v.x).sum();
            let mean: f64 = seen().map(|(i, v)| i as f64 * v.x).sum();
            let variance: f64 = seen().map(|(i, v)| (i as f64 - 100.0).powi(2) * v.x).sum();
            assert!((sum - 1.0).abs() < 1e-9 && (mean - 100.0).abs() < 1e-9);
            // Odd widths only: within a tenth.
            assert!((variance.sqrt() / sd - 1.0).abs() < 0.1, "{} instead of {sd}", variance.sqrt());
        }
    }

    #[test]
    fn smoothing_spreads_what_is_missing_by_the_reach_of_the_kernel() {
        let mut values = vec![Vector3::repeat(1.0); 100];
        values[50] = Vector3::repeat(f64::NAN);
        smooth(&mut values, 3.0);
        assert!(values[30].x == 1.0 && values[48].x.is_nan() && values[52].x.is_nan() && values[70].x == 1.0);
    }

    #[test]
    fn a_parabola_is_read_exactly_between_the_nodes() {
        let values: Vec<f64> = (0..10).map(|i| f64::from(i * i)).collect();
        assert!((read(&values, 4.25) - 4.25 * 4.25).abs() < 1e-12);
        assert!(read(&values, 0.5).is_nan() && read(&values, 8.5).is_nan() && read(&values, f64::NAN).is_nan());
    }
}
