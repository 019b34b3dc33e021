//! White noise: the covariance of the points in seconds without movement, or of their third differences in a movement.
//!
//! # Seconds without movement
//!
//! In each second the course of every coordinate is taken away as a parabola, which holds sway, breathing and a slow
//! offset; what remains is noise. A second counts when the courses stay within [`STILL_M`] and the rest is small, both
//! beyond what noise explains, so that neither a noisy sensor hides a resting subject nor a movement passes for noise.
//!
//! # Third differences
//!
//! White noise of variance σ² has third differences of variance 20 σ². A movement leaves in them what is left of its
//! jerk: at 30 Hz a hand that goes up and down half a metre in two seconds leaves 0.1 mm, where second differences still
//! hold 2 mm. Medians and bounded scores keep jumps out. Noise that middleware has smoothed is smaller here than in
//! seconds without movement, so this is for sensors of which nobody has recorded any.
//!
//! # Shrinkage
//!
//! Few seconds make a covariance of 36 coordinates that is barely invertible. Its correlations are therefore shrunk
//! towards zero by the share that minimises the expected squared error (Ledoit and Wolf 2003; the form for correlations
//! is Schäfer and Strimmer 2005, eq. 10):
//!
//! ```text
//! λ = Σ Var(r_ij) / Σ r_ij²,  i ≠ j
//! ```
//!
//! Var(r_ij) is taken between seconds and not between frames, because middleware smooths and its noise is not
//! independent from frame to frame. With λ > 0 the matrix is positive definite whatever the samples are.

use crate::assessment::noise_model::ObservationCovariance;
use crate::body::{OBSERVATION_DIMENSION, POINT_COUNT};
use crate::pipeline::joint_angles::observation::Observations;
use nalgebra::{SVector, Vector3};

/// Length of a second, nanoseconds.
const SECOND_NS: i64 = 1_000_000_000;
/// After a second with movement the search goes on this much later, nanoseconds.
const STRIDE_NS: i64 = SECOND_NS / 5;
/// Fewest complete frames of a second: its three parameters must leave a rest.
const MIN_FRAMES: usize = 10;
/// Share of a second's frames that must be complete.
const MIN_COMPLETE: f64 = 0.8;
/// Root mean square that the course of a point may have in a second, metres: that of 17 mm/s. People who stand sway by
/// less; the slowest exercise moves a hand twenty times as fast.
const STILL_M: f64 = 0.005;
/// Variance of a course by noise alone that is allowed, as multiple of what is expected. Of two parameters 1 % have more,
/// and a movement that this hides is small beside the noise.
const COURSE_BY_NOISE: f64 = 5.0;
/// Seconds without movement, one after the other, without which none of a stretch counts: ten, or nine of ten when frames
/// and seconds do not fit. Pauses of a movement are shorter.
const MIN_STRETCH: usize = 9;
/// Longest interruption of a stretch, nanoseconds: a second in which noise looked like a movement.
const MAX_INTERRUPTION_NS: i64 = SECOND_NS;
/// Root mean square that the rest may have beside noise, metres.
const REST_M: f64 = 0.002;
/// Standard deviations of noise that the rest is allowed: noise that middleware smooths is larger than second differences
/// show.
const NOISE_SDS: f64 = 3.0;
/// Parameters of a course: place, speed, acceleration.
const COURSE: usize = 3;
/// Least share by which correlations are shrunk. It bounds the condition number of the correlations by 3600, which
/// single precision bears, and outweighs the rounding of a document to four decimals (at most 36 · 0.00005 in any
/// direction).
const MIN_SHRINKAGE: f64 = 0.01;

type Coordinates = SVector<f64, OBSERVATION_DIMENSION>;

/// Frames of a third difference.
const DIFFERENCE: usize = 4;
/// Variance of a third difference of white noise of variance 1: 1 + 9 + 9 + 1.
const DIFFERENCE_VARIANCE: f64 = 20.0;
/// Fewest third differences that a recording must have to count.
const MIN_DIFFERENCES: usize = 30;
/// Bound of a standardised difference in correlations, standard deviations.
const MAX_SCORE: f64 = 3.0;

/// Sums over stretches of time, each with a covariance of its own: seconds without movement, or moving recordings.
#[derive(Debug, Clone)]
pub(super) struct WhiteNoise {
    stretches: usize,
    seconds: f64,
    /// Sum of the stretches' covariances.
    sum: ObservationCovariance,
    /// Sum of their squares, element by element.
    sum_of_squares: ObservationCovariance,
}

impl Default for WhiteNoise {
    fn default() -> Self {
        let none = ObservationCovariance::zeros();
        Self { stretches: 0, seconds: 0.0, sum: none, sum_of_squares: none }
    }
}

/// A covariance as standard deviations and correlations.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ShrunkCovariance {
    /// Standard deviation of each coordinate, metres.
    pub(super) sd: Coordinates,
    /// Correlations, positive definite; zero beside a coordinate that never moves.
    pub(super) correlation: ObservationCovariance,
    /// Share by which correlations were shrunk.
    pub(super) shrinkage: f64,
}

impl WhiteNoise {
    /// Adds the seconds of a recording in which nobody moves, where there are ten at a stretch; their number is the answer.
    /// `white` is the noise that second differences show.
    pub(super) fn add_still(&mut self, observations: &Observations, white: &[Vector3<f64>; POINT_COUNT]) -> f64 {
        let before = self.seconds;
        let times = &observations.time_ns;
        let Some(last) = times.last() else { return 0.0 };
        // The last frame of a full second comes one interval before its end.
        let interval = observations.duration_s() * 1e9 / (observations.len().max(2) - 1) as f64;
        // Half an interval of tolerance: thirty frames of a thirtieth of a second are a second however they round.
        let second = SECOND_NS - (0.5 * interval) as i64;
        let (mut start, mut stretch, mut stretch_end) = (0, Vec::new(), i64::MIN);
        while start < times.len() && times[start] + second <= last + interval as i64 {
            let end = times.partition_point(|time| *time < times[start] + second);
            match still_covariance(&observations.points[start..end], &times[start..end], white) {
                Some(covariance) => {
                    if times[start].saturating_sub(stretch_end) > MAX_INTERRUPTION_NS {
                        self.push_stretch(&mut stretch);
                    }
                    stretch.push(covariance);
                    stretch_end = times[end - 1];
                    start = end;
                }
                None => start = times.partition_point(|time| *time < times[start] + STRIDE_NS).max(start + 1),
            }
        }
        self.push_stretch(&mut stretch);
        self.seconds - before
    }

    fn push_stretch(&mut self, stretch: &mut Vec<ObservationCovariance>) {
        if stretch.len() >= MIN_STRETCH {
            stretch.iter().for_each(|covariance| self.push(covariance, 1.0));
        }
        stretch.clear();
    }

    /// Adds a recording with movement; the answer is how many seconds of it were used.
    pub(super) fn add_moving(&mut self, observations: &Observations) -> f64 {
        let differences = third_differences(observations);
        if differences.len() < MIN_DIFFERENCES {
            return 0.0;
        }
        let mut magnitudes = vec![0.0; differences.len()];
        let sd = Coordinates::from_fn(|row, _| {
            magnitudes
                .iter_mut()
                .zip(&differences)
                .for_each(|(magnitude, difference)| *magnitude = difference[row].abs());
            let middle = magnitudes.len() / 2;
            // 1.4826 turns the median absolute value of a normal variable into its standard deviation.
            1.4826 * *magnitudes.select_nth_unstable_by(middle, f64::total_cmp).1 / DIFFERENCE_VARIANCE.sqrt()
        });
        let mut products = ObservationCovariance::zeros();
        for difference in &differences {
            let score = Coordinates::from_fn(|row, _| {
                // A coordinate that never changes has no score.
                let scale = (sd[row] * DIFFERENCE_VARIANCE.sqrt()).max(f64::MIN_POSITIVE);
                (difference[row] / scale).clamp(-MAX_SCORE, MAX_SCORE)
            });
            products.ger(1.0, &score, &score, 1.0);
        }
        let covariance = ObservationCovariance::from_fn(|row, column| {
            let scale = (products[(row, row)] * products[(column, column)]).sqrt().max(f64::MIN_POSITIVE);
            products[(row, column)] / scale * sd[row] * sd[column]
        });
        let seconds = observations.duration_s() * differences.len() as f64 / observations.len() as f64;
        self.push(&covariance, seconds);
        seconds
    }

    fn push(&mut self, covariance: &ObservationCovariance, seconds: f64) {
        let symmetric = (covariance + mirrored(covariance)) * 0.5;
        self.stretches += 1;
        self.seconds += seconds;
        self.sum += symmetric;
        self.sum_of_squares += symmetric.component_mul(&symmetric);
    }

    /// Seconds that the noise was taken from.
    pub(super) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The shrunk covariance.
    pub(super) fn covariance(&self) -> ShrunkCovariance {
        let n = self.stretches.max(1) as f64;
        let mean = self.sum / n;
        let sd = Coordinates::from_fn(|row, _| mean[(row, row)].max(0.0).sqrt());
        let (mut variances, mut squares) = (0.0, 0.0);
        let mut correlation = ObservationCovariance::identity();
        for row in 1..OBSERVATION_DIMENSION {
            for column in 0..row {
                let scale = sd[row] * sd[column];
                // A coordinate that never moves goes with none.
                if scale <= f64::MIN_POSITIVE {
                    continue;
                }
                let value = mean[(row, column)] / scale;
                let between = (self.sum_of_squares[(row, column)] / n - mean[(row, column)].powi(2)).max(0.0);
                variances += between / (n - 1.0).max(1.0) / scale.powi(2);
                squares += value.powi(2);
                correlation[(row, column)] = value;
                correlation[(column, row)] = value;
            }
        }
        let shrinkage = if squares > 0.0 { (variances / squares).clamp(MIN_SHRINKAGE, 1.0) } else { 1.0 };
        let correlation = correlation * (1.0 - shrinkage) + ObservationCovariance::identity() * shrinkage;
        ShrunkCovariance { sd, correlation, shrinkage }
    }
}

/// The covariance that the mirror image of a subject who faces the sensor would have: left and right change places, and
/// the axis across the image changes its sign.
fn mirrored(covariance: &ObservationCovariance) -> ObservationCovariance {
    // Limbs stand left before right, three points each.
    let other = |row: usize| {
        let (point, axis) = (row / 3, row % 3);
        let opposite = if (point / 3).is_multiple_of(2) { point + 3 } else { point - 3 };
        (3 * opposite + axis, if axis == 0 { -1.0 } else { 1.0 })
    };
    ObservationCovariance::from_fn(|row, column| {
        let ((row, row_sign), (column, column_sign)) = (other(row), other(column));
        row_sign * column_sign * covariance[(row, column)]
    })
}

/// Covariance of what remains beside the courses of the points; `None` when a point moves or too few frames are complete.
fn still_covariance(
    points: &[[Vector3<f64>; POINT_COUNT]],
    time_ns: &[i64],
    white: &[Vector3<f64>; POINT_COUNT],
) -> Option<ObservationCovariance> {
    let is_complete = |frame: &[Vector3<f64>; POINT_COUNT]| frame.iter().all(|p| p.iter().all(|c| c.is_finite()));
    let frames: Vec<usize> = (0..points.len()).filter(|t| is_complete(&points[*t])).collect();
    let n = frames.len();
    if n < MIN_FRAMES || (n as f64) < MIN_COMPLETE * points.len() as f64 {
        return None;
    }
    let course = course_basis(&frames, time_ns)?;
    let mut rest: Vec<Coordinates> =
        frames.iter().map(|t| Coordinates::from_fn(|row, _| points[*t][row / 3][row % 3])).collect();
    let mut drift = Coordinates::zeros();
    for (degree, basis) in course.iter().enumerate() {
        let amount: Coordinates = rest.iter().zip(basis).map(|(coordinates, weight)| coordinates * *weight).sum();
        rest.iter_mut().zip(basis).for_each(|(coordinates, weight)| *coordinates -= amount * *weight);
        if degree > 0 {
            drift += amount.component_mul(&amount);
        }
    }
    let mut covariance = ObservationCovariance::zeros();
    rest.iter().for_each(|coordinates| covariance.ger(1.0, coordinates, coordinates, 1.0));
    for (p, white) in white.iter().enumerate() {
        let noise = white.norm_squared();
        let over_axes = |values: &dyn Fn(usize) -> f64| (0..3).map(|axis| values(3 * p + axis)).sum::<f64>() / n as f64;
        let (drift, rest) = (over_axes(&|row| drift[row]), over_axes(&|row| covariance[(row, row)]));
        // Noise alone gives each of the two parameters of a drift a variance of its own size.
        let drift_by_noise = COURSE_BY_NOISE * noise * (COURSE - 1) as f64 / n as f64;
        if drift > STILL_M.powi(2) + drift_by_noise || rest > REST_M.powi(2) + NOISE_SDS.powi(2) * noise {
            return None;
        }
    }
    Some(covariance / (n - COURSE) as f64)
}

/// Third differences of complete frames that follow each other regularly, metres.
fn third_differences(observations: &Observations) -> Vec<Coordinates> {
    /// Share by which the intervals of one difference may differ.
    const REGULAR: f64 = 0.3;
    let mut differences = Vec::with_capacity(observations.len());
    for (points, times) in observations.points.windows(DIFFERENCE).zip(observations.time_ns.windows(DIFFERENCE)) {
        let intervals: [i64; DIFFERENCE - 1] = std::array::from_fn(|i| times[i + 1] - times[i]);
        let (shortest, longest) = (intervals.iter().min().copied(), intervals.iter().max().copied());
        if longest.unwrap_or(0) as f64 > (1.0 + REGULAR) * shortest.unwrap_or(0) as f64 {
            continue;
        }
        let difference = Coordinates::from_fn(|row, _| {
            let at = |frame: usize| points[frame][row / 3][row % 3];
            at(3) - 3.0 * at(2) + 3.0 * at(1) - at(0)
        });
        if difference.iter().all(|value| value.is_finite()) {
            differences.push(difference);
        }
    }
    differences
}

/// Place, speed and acceleration as orthonormal weights of the frames; `None` when the frames' times do not tell them
/// apart.
fn course_basis(frames: &[usize], time_ns: &[i64]) -> Option<[Vec<f64>; COURSE]> {
    let first = time_ns[*frames.first()?];
    let time: Vec<f64> = frames.iter().map(|t| (time_ns[*t] - first) as f64 / SECOND_NS as f64 - 0.5).collect();
    let mut basis: [Vec<f64>; COURSE] =
        std::array::from_fn(|degree| time.iter().map(|t| t.powi(degree as i32)).collect());
    for degree in 0..COURSE {
        for lower in 0..degree {
            let (before, from) = basis.split_at_mut(degree);
            let along: f64 = before[lower].iter().zip(&from[0]).map(|(a, b)| a * b).sum();
            from[0].iter_mut().zip(&before[lower]).for_each(|(value, weight)| *value -= along * weight);
        }
        let length = basis[degree].iter().map(|value| value.powi(2)).sum::<f64>().sqrt();
        if length < 1e-6 {
            return None;
        }
        basis[degree].iter_mut().for_each(|value| *value /= length);
    }
    Some(basis)
}

#[cfg(test)]
mod tests;
