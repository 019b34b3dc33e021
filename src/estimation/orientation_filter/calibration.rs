//! What is wrong with a sensor, found from its own recording.
//!
//! Turned into the frame of the first attitude by integrated rates, gravity must stand still. Where it drifts, the
//! rates were wrong: by a bias, by a gain that is not one or an axis that is not square, or by being late. With the
//! attitude error `φ(t) = −∫ R (δb + δM ω) dt`, the low-passed specific force `a` in that frame obeys
//!
//! ```text
//! a + φ × a − R δa₀ + R (ω × f) δτ = g                  g: gravity, the same for the whole window
//! ```
//!
//! which is linear in what is sought. It is solved with the priors of [`SmootherSettings`] and with the mean rates of
//! rests, and repeated: first for the drift over ten seconds, which is linear even where the drift over the whole
//! window is not, then for all of it. The turn about gravity shows only in rests, and while the sensor's other axes
//! take their turns at being vertical; the rest of it stays with the prior.

use super::normal_equations::{Equation, N_PARAMETERS, NormalEquations, Parameters};
use super::rest::Rest;
use super::samples::Sample;
use super::smoother::SmootherSettings;
use super::strapdown::{turn, turned};
use super::zero_phase::low_pass;
use nalgebra::{Matrix3, Quaternion, SMatrix, UnitQuaternion, Vector3};
use std::ops::Range;

/// Time over which samples are summed up before anything slow is done with them, s: short beside the time constants.
const BLOCK_SECONDS: f64 = 0.05;
/// Time over which drift is linear in any bias that counts as one, s: 2 °/s turn 20° in it.
const LINEAR_SECONDS: f64 = 10.0;
/// Passes over the whole drift; a second moves no set of recordings by more than 0.01°.
const PASSES: usize = 1;
/// Nothing is known of gravity beforehand, m/s²; this keeps the equations definite.
const GRAVITY_SD: f64 = 1e3;

/// Errors of one sensor, constant over a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorCalibration {
    /// Bias of the gyroscope, rad/s.
    pub rate_bias: Vector3<f64>,
    /// Error of gains and axes of the gyroscope: the true rate is `rate − rate_bias − rate_gain · rate`.
    pub rate_gain: Matrix3<f64>,
    /// Bias of the accelerometer, m/s².
    pub acceleration_bias: Vector3<f64>,
    /// Time by which the gyroscope is later than the accelerometer, s.
    pub rate_delay: f64,
}

impl SensorCalibration {
    fn from_parameters(p: &Parameters) -> Self {
        Self {
            rate_bias: p.fixed_rows::<3>(0).into_owned(),
            rate_gain: Matrix3::from_iterator(p.fixed_rows::<9>(3).iter().copied()),
            acceleration_bias: p.fixed_rows::<3>(12).into_owned(),
            rate_delay: p[15],
        }
    }

    /// The rate without its errors, rad/s.
    pub(super) fn true_rate(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        rate - self.rate_bias - self.rate_gain * rate
    }

    /// The specific force without its errors, m/s², as seen from the attitude of the late gyroscope.
    pub(super) fn true_force(&self, acceleration: &Vector3<f64>, true_rate: &Vector3<f64>) -> Vector3<f64> {
        acceleration - self.acceleration_bias + true_rate.cross(acceleration) * self.rate_delay
    }

    /// Between this calibration (`fraction` 0) and another (1).
    pub(super) fn towards(&self, other: &Self, fraction: f64) -> Self {
        Self {
            rate_bias: self.rate_bias.lerp(&other.rate_bias, fraction),
            rate_gain: self.rate_gain * (1.0 - fraction) + other.rate_gain * fraction,
            acceleration_bias: self.acceleration_bias.lerp(&other.acceleration_bias, fraction),
            rate_delay: self.rate_delay + (other.rate_delay - self.rate_delay) * fraction,
        }
    }
}

/// A calibration and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Calibrated {
    pub calibration: SensorCalibration,
    /// Standard deviation of the gyroscope's bias in its worst direction, rad/s.
    pub bias_sd: f64,
    /// Root mean square angle between calibrated gravity and what low-passed acceleration shows, rad.
    pub disagreement: f64,
}

/// Attitude error per unit of bias (first three columns) and gain, at the middle of a block.
type Drift = SMatrix<f64, 3, 12>;

/// Means over a block in the frame of the first attitude: force, axes of the sensor (three), and change of the force per
/// second of delay.
type Channels = [Vector3<f64>; 5];

/// Ranges of samples, each of [`BLOCK_SECONDS`] or one sample, and how long each lasts, s.
pub(super) fn blocks(samples: &[Sample]) -> (Vec<Range<usize>>, Vec<f64>) {
    let (mut ranges, mut durations) = (Vec::new(), Vec::new());
    let (mut start, mut elapsed) = (0, 0.0);
    for (i, sample) in samples.iter().enumerate() {
        elapsed += sample.seconds;
        // Half a nanosecond: sums of time stamps that should reach the limit must not miss it by rounding.
        if elapsed + 5e-10 >= BLOCK_SECONDS || i + 1 == samples.len() {
            ranges.push(start..i + 1);
            durations.push(elapsed);
            (start, elapsed) = (i + 1, 0.0);
        }
    }
    (ranges, durations)
}

/// The calibration of a window of samples, `rests` being those within it.
pub(super) fn calibrate(samples: &[Sample], rests: &[Rest], settings: &SmootherSettings) -> Calibrated {
    let mut parameters = Parameters::zeros();
    if !rests.is_empty() {
        let rate = rests.iter().map(|rest| rest.rate).sum::<Vector3<f64>>() / rests.len() as f64;
        parameters.fixed_rows_mut::<3>(0).copy_from(&rate);
    }
    let (ranges, durations) = blocks(samples);
    let mut found = Calibrated {
        calibration: SensorCalibration::from_parameters(&parameters),
        bias_sd: settings.rate_bias_sd,
        disagreement: std::f64::consts::FRAC_PI_2,
    };
    for pass in 0..=PASSES {
        let (drifts, mut channels) = summed(samples, &ranges, &found.calibration);
        low_pass(&durations, &mut channels, settings.calibration_time_constant);
        let chosen = chosen(&durations, settings.calibration_time_constant * 0.5);
        let equations = if pass == 0 {
            relative_equations(&drifts, &channels, &durations, &chosen)
        } else {
            chosen.iter().map(|&i| equation(&drifts[i], &channels[i], &Vector3::zeros(), true)).collect()
        };
        let mut normal = NormalEquations::new();
        for equation in &equations {
            normal.add(equation, settings.acceleration_sd);
        }
        for (index, sd) in settings.prior_sd().into_iter().enumerate() {
            normal.add_single(index, -parameters[index], sd);
        }
        for index in N_PARAMETERS - 3..N_PARAMETERS {
            normal.add_single(index, 0.0, GRAVITY_SD);
        }
        for rest in rests {
            let sd = settings.rate_bias_at_rest_sd.hypot(rest.rate_sd);
            for axis in 0..3 {
                normal.add_single(axis, rest.rate[axis] - parameters[axis], sd);
            }
        }
        let Some((increment, covariance)) = normal.solve() else { break };
        let gravity = increment.fixed_rows::<3>(N_PARAMETERS - 3).into_owned();
        parameters += increment;
        found.calibration = SensorCalibration::from_parameters(&parameters);
        found.bias_sd = covariance.symmetric_eigenvalues().max().max(0.0).sqrt();
        if pass > 0 {
            found.disagreement = disagreement(&equations, &increment, &gravity);
        }
    }
    found
}

/// Every block that lies at least `spacing` seconds after the one chosen before it.
fn chosen(durations: &[f64], spacing: f64) -> Vec<usize> {
    let mut chosen = Vec::new();
    let mut elapsed = 0.5 * spacing;
    for (i, seconds) in durations.iter().enumerate() {
        elapsed += seconds;
        if elapsed >= spacing {
            chosen.push(i);
            elapsed = 0.0;
        }
    }
    chosen
}

/// One pass of integration: the sums of each block.
fn summed(samples: &[Sample], ranges: &[Range<usize>], calibration: &SensorCalibration) -> (Vec<Drift>, Vec<Channels>) {
    let mut attitude = Quaternion::identity();
    let mut before = samples.first().map_or(Vector3::zeros(), |first| calibration.true_rate(&first.rate));
    let mut drift = Drift::zeros();
    let mut force = Vector3::zeros();
    let mut drifts = Vec::with_capacity(ranges.len());
    let mut channels: Vec<Channels> = Vec::with_capacity(ranges.len());
    for range in ranges {
        let mut axes = Matrix3::zeros();
        let mut gains = [Matrix3::<f64>::zeros(); 3];
        let mut force_sum = Vector3::zeros();
        let mut delay_sum = Vector3::zeros();
        let (mut n, mut seconds) = (0.0, 0.0);
        for i in range.clone() {
            let sample = &samples[i];
            let rate = calibration.true_rate(&sample.rate);
            if i > 0 {
                attitude = turned(&attitude, &turn(&before, &rate, sample.seconds));
            }
            before = rate;
            let rotation = UnitQuaternion::new_unchecked(attitude).to_rotation_matrix().into_inner();
            let weighted = rotation * sample.seconds;
            axes += weighted;
            for (gain, rate) in gains.iter_mut().zip(sample.rate.iter()) {
                *gain += weighted * *rate;
            }
            seconds += sample.seconds;
            if sample.is_force {
                force_sum += rotation * calibration.true_force(&sample.acceleration, &rate);
                delay_sum += rotation * rate.cross(&sample.acceleration);
                n += 1.0;
            }
        }
        let mut change = Drift::zeros();
        change.fixed_columns_mut::<3>(0).copy_from(&-axes);
        for (k, gain) in gains.iter().enumerate() {
            change.fixed_columns_mut::<3>(3 + 3 * k).copy_from(&-gain);
        }
        // Without an acceleration the direction of gravity is the last one.
        let mut delay = Vector3::zeros();
        if n > 0.0 {
            force = force_sum / n;
            delay = delay_sum / n;
        }
        let mean = if seconds > 0.0 { axes / seconds } else { Matrix3::identity() };
        drifts.push(drift + change * 0.5);
        channels.push([
            force,
            mean.column(0).into_owned(),
            mean.column(1).into_owned(),
            mean.column(2).into_owned(),
            delay,
        ]);
        drift += change;
    }
    (drifts, channels)
}

/// The equation of the module's doc for one block, `before` being what the force should equal beside gravity.
fn equation(drift: &Drift, channels: &Channels, before: &Vector3<f64>, has_gravity: bool) -> Equation {
    let mut rows = SMatrix::<f64, 3, N_PARAMETERS>::zeros();
    rows.fixed_columns_mut::<12>(0).copy_from(&(-channels[0].cross_matrix() * drift));
    for axis in 0..3 {
        rows.set_column(12 + axis, &-channels[1 + axis]);
    }
    rows.set_column(15, &channels[4]);
    if has_gravity {
        rows.fixed_columns_mut::<3>(N_PARAMETERS - 3).copy_from(&-Matrix3::identity());
    }
    Equation { rows, values: before - channels[0] }
}

/// Equations of the drift over [`LINEAR_SECONDS`], in which gravity cancels.
fn relative_equations(drifts: &[Drift], channels: &[Channels], durations: &[f64], chosen: &[usize]) -> Vec<Equation> {
    let mut equations = Vec::new();
    let mut earlier = 0;
    let mut elapsed = 0.0;
    let mut times = vec![0.0; durations.len()];
    for (time, seconds) in times.iter_mut().zip(durations) {
        elapsed += seconds;
        *time = elapsed;
    }
    for &i in chosen {
        while earlier + 1 < i && times[i] - times[earlier + 1] >= LINEAR_SECONDS {
            earlier += 1;
        }
        if times[i] - times[earlier] < 0.5 * LINEAR_SECONDS {
            continue;
        }
        let drift = drifts[i] - drifts[earlier];
        let mut changed = channels[i];
        for (changed, before) in changed.iter_mut().zip(&channels[earlier]).skip(1) {
            *changed -= before;
        }
        equations.push(equation(&drift, &changed, &channels[earlier][0], false));
    }
    equations
}

/// Root mean square angle between gravity and the forces of the equations, as far as it is across gravity.
fn disagreement(equations: &[Equation], increment: &Parameters, gravity: &Vector3<f64>) -> f64 {
    let Some(up) = gravity.try_normalize(0.0) else { return std::f64::consts::FRAC_PI_2 };
    let across = |equation: &Equation| {
        let residual = equation.rows * increment - equation.values;
        (residual - up * residual.dot(&up)).norm_squared()
    };
    let sum: f64 = equations.iter().map(across).sum();
    (sum / equations.len().max(1) as f64).sqrt() / gravity.norm()
}
