//! A pinhole camera and the depth images that it makes.
//!
//! The `sensor` frame is x right in the image, y down, z away from the camera. Pixel (i, j) is column i from the left,
//! row j from the top; a point at depth z is seen there when `i = cx + fx x / z` and `j = cy + fy y / z`.

use nalgebra::Vector3;

/// Focal lengths and principal point, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Focal length along the rows.
    pub fx: f64,
    /// Focal length along the columns.
    pub fy: f64,
    /// Column of the optical axis.
    pub cx: f64,
    /// Row of the optical axis.
    pub cy: f64,
}

impl Intrinsics {
    /// The point at depth `z` (metres) in the middle of a pixel, in `sensor`, metres.
    pub fn point_in_sensor(&self, i: f64, j: f64, z: f64) -> Vector3<f64> {
        Vector3::new((i - self.cx) * z / self.fx, (j - self.cy) * z / self.fy, z)
    }

    /// Where a point (in `sensor`, metres) is seen, as column and row; `None` behind the camera.
    pub fn pixel_of_point(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        (point.z > 0.0).then(|| [self.cx + self.fx * point.x / point.z, self.cy + self.fy * point.y / point.z])
    }
}

/// One depth image: the z of what each pixel sees, metres, row by row from the upper left corner; 0 where it saw nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` values, metres.
    pub depth: Vec<f32>,
}

impl DepthMap {
    /// An image in which nothing is seen.
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, depth: vec![0.0; width * height] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_seen_at_the_pixel_that_it_was_computed_from() {
        let camera = Intrinsics { fx: 580.0, fy: 575.0, cx: 319.5, cy: 239.5 };
        let point = camera.point_in_sensor(100.0, 400.0, 1.2);
        assert!(point.x < 0.0 && point.y > 0.0 && point.z == 1.2);
        let pixel = camera.pixel_of_point(&point).unwrap();
        assert!((pixel[0] - 100.0).abs() < 1e-9 && (pixel[1] - 400.0).abs() < 1e-9);
        assert_eq!(camera.pixel_of_point(&Vector3::new(0.0, 0.0, -1.0)), None);
    }
}
