//! Orientation from a whole recording at once: the default.
//!
//! 1. In windows of [`SmootherSettings::window`] seconds the errors of the sensor are estimated ([`super::calibration`]).
//! 2. Rates without those errors are integrated, coning included.
//! 3. Specific force is turned by that attitude into an almost inertial frame, where gravity stands almost still while
//!    the accelerations of movement change sign; a low-pass in both directions leaves gravity.
//! 4. The attitude is tilted, by the smallest rotation, so that this gravity points up.
//!
//! Steps 3 and 4 are those of VQF (Laidig and Seel, Information Fusion 91, 2023), made free of delay. Step 1 takes the
//! place of its Kalman updates; `surefoot evaluate orientation` prints both.

use super::calibration::{Calibrated, SensorCalibration, blocks, calibrate};
use super::rest::{Rest, rests};
use super::samples::{Sample, safe};
use super::strapdown::{turn, turned};
use super::zero_phase::low_pass;
use super::{InertialSamples, OrientationError, OrientationEstimate, earth_from_z_up, levelling};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::ops::Range;

/// What is known beforehand of a sensor, and over which times gravity is sought. One set serves all sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmootherSettings {
    /// Standard deviation of the gyroscope's bias, rad/s. Default 1 °/s, the offset of an uncalibrated one.
    pub rate_bias_sd: f64,
    /// Standard deviation of the true mean rate of a rest about the bias, rad/s; the noise of the samples comes on top.
    /// Default 0.01 °/s.
    pub rate_bias_at_rest_sd: f64,
    /// Standard deviation of the gyroscope's gains about one, and of its axes about square, rad/rad. Default 0.0005.
    pub rate_gain_sd: f64,
    /// Standard deviation of the accelerometer's bias, m/s². Default 0.03: 3 mg, one calibrated
    /// by its maker.
    pub acceleration_bias_sd: f64,
    /// Standard deviation of the gyroscope's lateness beside the accelerometer, s. Default 0.01.
    pub rate_delay_sd: f64,
    /// What movement leaves in low-passed acceleration, standard deviation, m/s². Default 0.4.
    pub acceleration_sd: f64,
    /// Time constant of the low-pass before calibration, s. Default 1.5.
    pub calibration_time_constant: f64,
    /// Time constant of the low-pass that shows gravity, s. Default 3, as VQF has it.
    pub inclination_time_constant: f64,
    /// Time for which a sensor's errors are constant, s. Default 600; between windows they change linearly.
    pub window: f64,
}

impl Default for SmootherSettings {
    fn default() -> Self {
        Self {
            rate_bias_sd: 1.0_f64.to_radians(),
            rate_bias_at_rest_sd: 0.01_f64.to_radians(),
            rate_gain_sd: 0.0005,
            acceleration_bias_sd: 0.03,
            rate_delay_sd: 0.01,
            acceleration_sd: 0.4,
            calibration_time_constant: 1.5,
            inclination_time_constant: 3.0,
            window: 600.0,
        }
    }
}

impl SmootherSettings {
    /// Standard deviations of bias, gains, accelerometer's bias and delay, in the order of the parameters.
    pub(super) fn prior_sd(&self) -> [f64; 16] {
        std::array::from_fn(|i| match i {
            0..3 => self.rate_bias_sd,
            3..12 => self.rate_gain_sd,
            12..15 => self.acceleration_bias_sd,
            _ => self.rate_delay_sd,
        })
    }
}

/// Orientation by the smoother.
///
/// # Errors
/// As [`super::estimate`].
pub fn estimate(
    samples: &InertialSamples<'_>,
    settings: &SmootherSettings,
) -> Result<OrientationEstimate, OrientationError> {
    let samples = safe(samples)?;
    let rests = rests(&samples);
    let (ranges, durations) = blocks(&samples);
    let windows = windows(&samples, &rests, settings);
    let mut estimate = OrientationEstimate {
        is_rest: vec![false; samples.len()],
        bias: Vec::with_capacity(samples.len()),
        bias_sd: Vec::with_capacity(samples.len()),
        inclination_sd: Vec::with_capacity(samples.len()),
        ..OrientationEstimate::default()
    };
    for rest in &rests {
        estimate.is_rest[rest.samples.clone()].fill(true);
    }
    let mut inertial = Integration::new(samples.len(), ranges.len());
    let mut elapsed = 0.0;
    for (range, seconds) in ranges.iter().zip(&durations) {
        let found = calibration_at(&windows, elapsed + 0.5 * seconds);
        elapsed += seconds;
        inertial.integrate(&samples, range, &found.calibration);
        for _ in range.clone() {
            estimate.bias.push(found.calibration.rate_bias);
            estimate.bias_sd.push(found.bias_sd);
            estimate.inclination_sd.push(found.disagreement);
        }
    }
    low_pass(&durations, &mut inertial.forces, settings.inclination_time_constant);
    estimate.earth_from_sensor = tilted(&inertial.attitudes, &inertial.forces, &ranges);
    Ok(estimate)
}

/// A calibration and the middle of the window that it was found in, s since the first sample.
struct Window {
    middle: f64,
    found: Calibrated,
}

/// The calibration of each window; windows are equally long.
fn windows(samples: &[Sample], rests: &[Rest], settings: &SmootherSettings) -> Vec<Window> {
    let total: f64 = samples.iter().skip(1).map(|sample| sample.seconds).sum();
    let n_windows = (total / settings.window).ceil().max(1.0);
    let length = total / n_windows;
    let mut windows = Vec::new();
    let (mut start, mut elapsed) = (0, 0.0);
    for i in 0..samples.len() {
        elapsed += if i > 0 { samples[i].seconds } else { 0.0 };
        // The last window ends with the samples, whatever rounding did to the sum.
        let is_full = elapsed >= length * (windows.len() + 1) as f64 && ((windows.len() + 1) as f64) < n_windows;
        if is_full || i + 1 == samples.len() {
            let inside = |rest: &&Rest| rest.samples.start >= start && rest.samples.end <= i + 1;
            let rests: Vec<Rest> = rests.iter().filter(inside).cloned().collect();
            let found = calibrate(&samples[start..=i], &rests, settings);
            windows.push(Window { middle: length * (windows.len() as f64 + 0.5), found });
            start = i + 1;
        }
    }
    windows
}

/// The calibration at a time in seconds, linear between the middles of windows.
fn calibration_at(windows: &[Window], seconds: f64) -> Calibrated {
    let later = windows.partition_point(|window| window.middle <= seconds).clamp(1, windows.len().max(2) - 1);
    let (a, b) = (&windows[later - 1], &windows[later.min(windows.len() - 1)]);
    let fraction = ((seconds - a.middle) / (b.middle - a.middle).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    if windows.len() == 1 {
        return a.found;
    }
    Calibrated {
        calibration: a.found.calibration.towards(&b.found.calibration, fraction),
        bias_sd: a.found.bias_sd + (b.found.bias_sd - a.found.bias_sd) * fraction,
        disagreement: a.found.disagreement + (b.found.disagreement - a.found.disagreement) * fraction,
    }
}

/// Attitudes in the frame of the first one, and the mean force of each block in it.
struct Integration {
    attitude: Quaternion<f64>,
    before: Option<Vector3<f64>>,
    attitudes: Vec<Quaternion<f64>>,
    forces: Vec<[Vector3<f64>; 1]>,
}

impl Integration {
    fn new(n_samples: usize, n_blocks: usize) -> Self {
        Self {
            attitude: Quaternion::identity(),
            before: None,
            attitudes: Vec::with_capacity(n_samples),
            forces: Vec::with_capacity(n_blocks),
        }
    }

    /// Adds one block of samples.
    fn integrate(&mut self, samples: &[Sample], range: &Range<usize>, calibration: &SensorCalibration) {
        let mut sum = Vector3::zeros();
        let mut n = 0.0;
        for sample in &samples[range.clone()] {
            let rate = calibration.true_rate(&sample.rate);
            if let Some(before) = self.before {
                self.attitude = turned(&self.attitude, &turn(&before, &rate, sample.seconds));
            }
            self.before = Some(rate);
            if sample.is_force {
                let force = calibration.true_force(&sample.acceleration, &rate);
                sum += UnitQuaternion::new_unchecked(self.attitude) * force;
                n += 1.0;
            }
            // The gyroscope is late: the sensor has turned on since.
            self.attitudes.push(turned(&self.attitude, &(rate * calibration.rate_delay)));
        }
        let last = self.forces.last().map_or(Vector3::zeros(), |[force]| *force);
        self.forces.push([if n > 0.0 { sum / n } else { last }]);
    }
}

/// Attitudes tilted so that the low-passed force of their block points up; between blocks the tilt is interpolated.
fn tilted(
    attitudes: &[Quaternion<f64>],
    forces: &[[Vector3<f64>; 1]],
    ranges: &[Range<usize>],
) -> Vec<UnitQuaternion<f64>> {
    // Each tilt continues the one before, so that together they never turn about the vertical.
    let mut tilt = UnitQuaternion::identity();
    let tilts: Vec<Quaternion<f64>> = forces
        .iter()
        .map(|[force]| {
            tilt = levelling(&(tilt * force)) * tilt;
            tilt.renormalize_fast();
            (earth_from_z_up() * tilt).into_inner()
        })
        .collect();
    let mut tilted = Vec::with_capacity(attitudes.len());
    for (b, range) in ranges.iter().enumerate() {
        let n = range.len() as f64;
        for (k, attitude) in attitudes[range.clone()].iter().enumerate() {
            // Blocks are short and their samples almost regular: the place within the block stands for the time.
            let place = (k as f64 + 0.5) / n - 0.5;
            let neighbour = if place < 0.0 { b.saturating_sub(1) } else { (b + 1).min(tilts.len() - 1) };
            let mixed = tilts[b] * (1.0 - place.abs()) + tilts[neighbour] * place.abs();
            tilted.push(UnitQuaternion::new_normalize(mixed * attitude));
        }
    }
    tilted
}
