//! Noise of the state-space model: how far joints turn between frames and how far the sensor is off (\[angles\] Table 1).

pub use crate::assessment::noise_model::{NoiseModel, ObservationCovariance};

use crate::assessment::noise_model;
use crate::body::OBSERVATION_DIMENSION;
use crate::body::pose::PoseVector;
use nalgebra::{Rotation3, Vector3};

/// Rate at which the standard deviations of the transition are stated, Hz.
pub const TRANSITION_RATE_HZ: f64 = 30.0;

impl NoiseModel {
    /// The paper's Table 1.
    pub fn nite_table1() -> Self {
        noise_model::nite_table1().clone()
    }

    /// Σy turned from the sensor's axes into another frame.
    pub fn observation_in(&self, other_from_sensor: &Rotation3<f64>) -> ObservationCovariance {
        let mut turned = ObservationCovariance::zeros();
        for row in (0..OBSERVATION_DIMENSION).step_by(3) {
            for column in (0..OBSERVATION_DIMENSION).step_by(3) {
                let block = self.observation.fixed_view::<3, 3>(row, column);
                let block = other_from_sensor.matrix() * block * other_from_sensor.matrix().transpose();
                turned.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
            }
        }
        turned
    }

    /// Standard deviation of a point's coordinates in the sensor's axes, metres.
    pub fn point_sd(&self, point: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.observation[(3 * point + axis, 3 * point + axis)].sqrt())
    }
}

/// Standard deviation of each element of θ over an interval in seconds, radians.
pub fn transition_sd_over(model: &NoiseModel, interval_s: f64) -> PoseVector {
    let factor = (interval_s * TRANSITION_RATE_HZ).max(0.0).sqrt();
    model.transition_sd * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Limb;
    use crate::body::pose::{attitude_offset, hinge_offset};
    use crate::body::skeleton::point_index;

    #[test]
    fn turning_by_90_degrees_about_the_vertical_exchanges_image_and_depth_axes() {
        let quarter = Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let turned = NoiseModel::nite_table1().observation_in(&quarter);
        let row = 3 * point_index(Limb::LeftArm, 2);
        assert!((turned[(row, row)].sqrt() - 0.0145).abs() < 1e-9);
        assert!((turned[(row + 2, row + 2)].sqrt() - 0.1515).abs() < 1e-9);
    }

    #[test]
    fn knees_flex_about_the_lateral_axis_with_table_1s_spread() {
        let model = NoiseModel::nite_table1();
        let sd = transition_sd_over(&model, 4.0 / 30.0).map(f64::to_degrees);
        assert!((sd[hinge_offset(3)] - 2.0 * 1.31).abs() < 1e-9);
        assert!((sd[attitude_offset(2) + 2] - 2.0 * 2.76).abs() < 1e-9);
    }
}
