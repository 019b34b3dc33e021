//! The floor as the camera sees it.
//!
//! ```text
//! height(p) = up · p + camera_height
//! ```
//!
//! Floor axes follow ISB for a subject who faces the camera: X towards the camera along the floor, Y up, Z to the
//! subject's right, which is the left of the image. They stay attached to the camera, so they travel with it.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// A level floor in `sensor`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floor {
    /// Away from the floor, in `sensor`.
    pub up: Unit<Vector3<f64>>,
    /// Height of the camera above the floor, metres.
    pub camera_height: f64,
}

impl Floor {
    /// The floor under a camera that looks down by `tilt` radians and is not rolled.
    pub fn under_camera(camera_height: f64, tilt: f64) -> Self {
        Self { up: Unit::new_normalize(Vector3::new(0.0, -tilt.cos(), -tilt.sin())), camera_height }
    }

    /// Height of a point (in `sensor`, metres) above the floor, metres.
    pub fn height(&self, point: &Vector3<f64>) -> f64 {
        self.up.dot(point) + self.camera_height
    }

    /// Turns floor axes (X towards the camera, Y up, Z to the image's left) into `sensor`.
    pub fn sensor_from_floor(&self) -> Rotation3<f64> {
        let y = self.up.into_inner();
        // A camera that looks straight down or up has no forward direction along the floor: its own "up" serves.
        let towards = -Vector3::z() + y * y.z;
        let towards = if towards.norm() > 1e-6 { towards } else { -Vector3::y() + y * y.y };
        let x = towards.normalize();
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_axes_point_to_the_camera_up_and_to_the_left_of_the_image() {
        let level = Floor::under_camera(0.7, 0.0).sensor_from_floor();
        assert!((level * Vector3::x() + Vector3::z()).norm() < 1e-12);
        assert!((level * Vector3::y() + Vector3::y()).norm() < 1e-12);
        assert!((level * Vector3::z() + Vector3::x()).norm() < 1e-12);
    }

    #[test]
    fn a_tilted_camera_has_the_floor_where_it_looks() {
        let floor = Floor::under_camera(0.7, 0.3);
        // Straight along the optical axis the floor is met at height / sin(tilt).
        assert!(floor.height(&Vector3::new(0.0, 0.0, 0.7 / 0.3f64.sin())).abs() < 1e-12);
        let axes = floor.sensor_from_floor();
        assert!((axes.matrix().determinant() - 1.0).abs() < 1e-12);
        assert!((axes * Vector3::y() - floor.up.into_inner()).norm() < 1e-12);
    }
}
