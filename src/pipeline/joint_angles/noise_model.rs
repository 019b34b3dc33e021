//! Noise of the state-space model: how far joints turn between frames and how far the sensor is off (\[angles\] Table 1).

use crate::body::pose::{PoseVector, attitude_offset, hinge_offset};
use crate::body::skeleton::point_index;
use crate::body::{Limb, OBSERVATION_DIMENSION};
use nalgebra::{Rotation3, SMatrix, Vector3};

/// Covariance of the observation vector y, m².
pub type ObservationCovariance = SMatrix<f64, OBSERVATION_DIMENSION, OBSERVATION_DIMENSION>;

/// Rate at which the standard deviations of the transition are stated, Hz.
pub const TRANSITION_RATE_HZ: f64 = 30.0;

/// A named pair of covariances.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    /// Name in provenance.
    pub name: &'static str,
    /// Standard deviation of each element of θ from one frame to the next at [`TRANSITION_RATE_HZ`], radians (Σθ is
    /// diagonal).
    pub transition_sd: PoseVector,
    /// Covariance Σy of y in the sensor's axes (x and y in the image, z in depth), m².
    pub observation: ObservationCovariance,
}

/// Table 1's columns x, y, z are lateral, vertical and sagittal: in `subject` Z, Y and X.
const TRUNK_SD_DEG: [f64; 3] = [1.60, 2.44, 1.16];
const SHOULDER_SD_DEG: [f64; 3] = [2.88, 5.64, 2.8];
const ELBOW_SD_DEG: f64 = 2.44;
const HIP_SD_DEG: [f64; 3] = [2.76, 3.28, 3.36];
const KNEE_SD_DEG: f64 = 1.31;

/// Table 1, positions relative to the torso joint, millimetres: arm then leg, proximal point first.
const POSITION_SD_MM: [[[f64; 3]; 3]; 2] = [
    [[9.1, 6.7, 12.7], [29.8, 25.2, 20.3], [151.5, 181.7, 14.5]],
    [[6.0, 6.5, 10.1], [8.8, 16.8, 35.1], [19.8, 25.2, 38.1]],
];

impl NoiseModel {
    /// The paper's Table 1.
    ///
    /// The paper's correlations are not published. Those here have one source that is certain: every element of y
    /// has the torso joint's own noise in it. The hip is the quietest point; taking the torso to be as noisy as the
    /// hip, half of the hip's variance is common to all points.
    pub fn nite_table1() -> Self {
        let mut transition_deg = PoseVector::zeros();
        let mut set = |start: usize, [x, y, z]: [f64; 3]| {
            transition_deg[start] = z;
            transition_deg[start + 1] = y;
            transition_deg[start + 2] = x;
        };
        set(0, TRUNK_SD_DEG);
        for limb in Limb::ALL {
            set(attitude_offset(limb.index()), if limb.is_arm() { SHOULDER_SD_DEG } else { HIP_SD_DEG });
        }
        for limb in Limb::ALL {
            transition_deg[hinge_offset(limb.index())] = if limb.is_arm() { ELBOW_SD_DEG } else { KNEE_SD_DEG };
        }
        let hip = POSITION_SD_MM[1][0];
        let mut observation = ObservationCovariance::zeros();
        for limb in Limb::ALL {
            for (level, sd) in POSITION_SD_MM[usize::from(!limb.is_arm())].iter().enumerate() {
                for axis in 0..3 {
                    let row = 3 * point_index(limb, level) + axis;
                    for other in (axis..OBSERVATION_DIMENSION).step_by(3) {
                        let variance = if other == row { sd[axis].powi(2) } else { 0.5 * hip[axis].powi(2) };
                        observation[(row, other)] = variance * 1e-6;
                    }
                }
            }
        }
        Self { name: "nite-table1", transition_sd: transition_deg.map(f64::to_radians), observation }
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

    #[test]
    fn table_1_is_positive_definite_with_its_standard_deviations_on_the_diagonal() {
        let model = NoiseModel::nite_table1();
        assert!(model.observation.cholesky().is_some());
        let hand = model.point_sd(point_index(Limb::LeftArm, 2));
        assert!((hand - Vector3::new(0.1515, 0.1817, 0.0145)).norm() < 1e-12);
        assert_eq!(model.observation, model.observation.transpose());
    }

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
