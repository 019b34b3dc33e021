//! What a unit makes of the true specific force and angular rate.

use super::path::IdealReadings;
use super::{STANDARD_GRAVITY, path};
use crate::synthetic::sensor::episode::Episodes;
use crate::synthetic::sensor::{UnitError, standard_normals, unit_stream};
use nalgebra::Vector3;

/// Errors of a unit's sensors. Everything random is drawn anew for each unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitErrors {
    /// Constant bias of the gyroscope, standard deviation of each axis, °/s. Default 0.5: what remains of the ±20 °/s
    /// of MEMS gyroscopes after calibration at another temperature.
    pub gyroscope_bias_deg_s: f64,
    /// Random walk of that bias, standard deviation after one second, °/s. Default 0.003.
    pub gyroscope_walk_deg_s: f64,
    /// White noise of the gyroscope, °/s/√Hz. Default 0.03 (data sheet of the L3G4200D, of the x-IMU's time).
    pub gyroscope_noise_deg_s_per_sqrt_hz: f64,
    /// Constant bias of the accelerometer, standard deviation of each axis, thousandths of g. Default 10.
    pub accelerometer_bias_mg: f64,
    /// White noise of the accelerometer, millionths of g/√Hz. Default 400 (data sheet of the MPU-6050).
    pub accelerometer_noise_ug_per_sqrt_hz: f64,
    /// Error of each axis' scale, standard deviation, share. Default 0.005.
    pub scale_error: f64,
    /// Largest angular rate that is measured, °/s. Default 2000 (x-IMU).
    pub gyroscope_range_deg_s: f64,
    /// Largest acceleration that is measured, g. Default 8 (x-IMU).
    pub accelerometer_range_g: f64,
    /// Stretches whose samples are lost. Default one in 50 s, of 0.05 to 0.4 s.
    pub gaps: Episodes,
}

impl Default for UnitErrors {
    fn default() -> Self {
        Self {
            gyroscope_bias_deg_s: 0.5,
            gyroscope_walk_deg_s: 0.003,
            gyroscope_noise_deg_s_per_sqrt_hz: 0.03,
            accelerometer_bias_mg: 10.0,
            accelerometer_noise_ug_per_sqrt_hz: 400.0,
            scale_error: 0.005,
            gyroscope_range_deg_s: 2000.0,
            accelerometer_range_g: 8.0,
            gaps: Episodes { per_s: 0.02, shortest_s: 0.05, longest_s: 0.4 },
        }
    }
}

impl UnitErrors {
    /// An ideal unit without range.
    pub const NONE: UnitErrors = UnitErrors {
        gyroscope_bias_deg_s: 0.0,
        gyroscope_walk_deg_s: 0.0,
        gyroscope_noise_deg_s_per_sqrt_hz: 0.0,
        accelerometer_bias_mg: 0.0,
        accelerometer_noise_ug_per_sqrt_hz: 0.0,
        scale_error: 0.0,
        gyroscope_range_deg_s: f64::INFINITY,
        accelerometer_range_g: f64::INFINITY,
        gaps: Episodes { per_s: 0.0, shortest_s: 0.0, longest_s: 0.0 },
    };
}

/// Samples of a unit and the bias that its gyroscope had.
pub(super) struct Samples {
    pub(super) acceleration: Vec<Vector3<f64>>,
    pub(super) angular_rate: Vec<Vector3<f64>>,
    /// Bias of the gyroscope in the first sample, rad/s.
    pub(super) gyroscope_bias: Vector3<f64>,
}

impl UnitErrors {
    /// The samples that the unit with a number takes at some times (seconds of the camera's clock) at a rate.
    pub(super) fn measure(
        &self,
        ideal: &IdealReadings,
        times: &[f64],
        rate_hz: f64,
        seed: u64,
        unit: usize,
    ) -> Samples {
        let normals = |kind: UnitError| {
            let mut rng = unit_stream(seed, unit, kind);
            move || standard_normals(&mut rng)
        };
        let mut scale = normals(UnitError::Scale);
        let mut scale = || Vector3::repeat(1.0) + scale() * self.scale_error;
        let [gyroscope_scale, accelerometer_scale] = [scale(), scale()];
        // White noise of a density, sampled at a rate, has the bandwidth of half that rate.
        let bandwidth = (rate_hz / 2.0).sqrt();

        let mut normal = normals(UnitError::Accelerometer);
        let milli_g = STANDARD_GRAVITY / 1000.0;
        let bias = normal() * (self.accelerometer_bias_mg * milli_g);
        let noise = self.accelerometer_noise_ug_per_sqrt_hz * milli_g / 1000.0 * bandwidth;
        let range = self.accelerometer_range_g * STANDARD_GRAVITY;
        let force = |t: &f64| {
            let force = path::value_at(&ideal.force, *t).component_mul(&accelerometer_scale);
            (force + bias + normal() * noise).map(|x| x.clamp(-range, range))
        };
        let acceleration = times.iter().map(force).collect();

        let mut normal = normals(UnitError::Gyroscope);
        let gyroscope_bias = normal() * self.gyroscope_bias_deg_s.to_radians();
        let noise = (self.gyroscope_noise_deg_s_per_sqrt_hz * bandwidth).to_radians();
        let walk = (self.gyroscope_walk_deg_s / rate_hz.sqrt()).to_radians();
        let range = self.gyroscope_range_deg_s.to_radians();
        let mut bias = gyroscope_bias;
        let rate = |t: &f64| {
            let rate = path::value_at(&ideal.rate, *t).component_mul(&gyroscope_scale);
            let measured = (rate + bias + normal() * noise).map(|x| x.clamp(-range, range));
            bias += normal() * walk;
            measured
        };
        Samples { acceleration, angular_rate: times.iter().map(rate).collect(), gyroscope_bias }
    }
}
