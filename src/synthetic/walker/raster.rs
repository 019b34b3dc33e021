//! A z-buffer: which triangle each pixel sees, and how far away.

use crate::geometry::camera::Intrinsics;
use nalgebra::{Point3, Vector3};

/// No triangle.
pub const NOTHING: u32 = u32::MAX;

/// Triangles that come nearer to the camera's plane than this are not drawn, metres.
const NEAREST_M: f64 = 0.05;

/// What each pixel sees.
#[derive(Debug, Clone)]
pub struct ZBuffer {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Depth, metres; infinite where nothing is seen.
    pub depth: Vec<f32>,
    /// Number of the triangle, or [`NOTHING`].
    pub triangle: Vec<u32>,
}

impl ZBuffer {
    /// A buffer that has seen nothing.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = width * height;
        Self { width, height, depth: vec![f32::INFINITY; pixels], triangle: vec![NOTHING; pixels] }
    }

    /// Draws a triangle (corners in `sensor`, metres) under a number.
    pub fn draw(&mut self, camera: &Intrinsics, corners: [&Point3<f64>; 3], number: u32) {
        if corners.iter().any(|corner| corner.z < NEAREST_M) {
            return;
        }
        let [a, b, c] = corners.map(|p| [camera.cx + camera.fx * p.x / p.z, camera.cy + camera.fy * p.y / p.z]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area == 0.0 {
            return;
        }
        let Some(rows) = covered([a[1], b[1], c[1]], self.height) else { return };
        let Some(columns) = covered([a[0], b[0], c[0]], self.width) else { return };
        // The inverse of the depth is linear in the image.
        let inverse = corners.map(|p| 1.0 / p.z);
        for row in rows {
            for column in columns.clone() {
                let p = [column as f64, row as f64];
                let side =
                    |u: [f64; 2], v: [f64; 2]| ((v[0] - u[0]) * (p[1] - u[1]) - (p[0] - u[0]) * (v[1] - u[1])) / area;
                let (wa, wb) = (side(b, c), side(c, a));
                let wc = 1.0 - wa - wb;
                if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                    continue;
                }
                let z = (1.0 / (wa * inverse[0] + wb * inverse[1] + wc * inverse[2])) as f32;
                let pixel = row * self.width + column;
                if z < self.depth[pixel] {
                    self.depth[pixel] = z;
                    self.triangle[pixel] = number;
                }
            }
        }
    }

    /// Draws the floor behind everything: a plane with a normal and `normal · p = offset`, in `sensor`.
    pub fn draw_plane(&mut self, camera: &Intrinsics, normal: &Vector3<f64>, offset: f64, number: u32) {
        for (pixel, (depth, triangle)) in self.depth.iter_mut().zip(&mut self.triangle).enumerate() {
            let ray = camera.point_in_sensor((pixel % self.width) as f64, (pixel / self.width) as f64, 1.0);
            let z = (offset / normal.dot(&ray)) as f32;
            if z > 0.0 && z < *depth {
                (*depth, *triangle) = (z, number);
            }
        }
    }
}

/// Whole numbers between the least and the greatest of three, within `0..n`.
fn covered(values: [f64; 3], n: usize) -> Option<std::ops::Range<usize>> {
    let low = values.into_iter().fold(f64::INFINITY, f64::min).ceil().max(0.0);
    let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max).floor().min(n as f64 - 1.0);
    (low <= high).then(|| low as usize..high as usize + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5 };

    #[test]
    fn a_slanted_triangle_has_the_depth_of_its_plane_and_the_nearer_one_wins() {
        let mut buffer = ZBuffer::new(64, 48);
        let far = [Point3::new(-3.0, -3.0, 2.0), Point3::new(3.0, -3.0, 2.0), Point3::new(0.0, 4.0, 2.0)];
        // In the plane z = 1 + x.
        let near = [Point3::new(-0.1, -0.2, 0.9), Point3::new(0.2, -0.1, 1.2), Point3::new(0.0, 0.2, 1.0)];
        buffer.draw(&CAMERA, far.each_ref(), 0);
        buffer.draw(&CAMERA, near.each_ref(), 1);
        let mut seen = 0;
        for (pixel, number) in buffer.triangle.iter().enumerate() {
            if *number == 1 {
                let z = f64::from(buffer.depth[pixel]);
                let point = CAMERA.point_in_sensor((pixel % 64) as f64, (pixel / 64) as f64, z);
                assert!((point.z - 1.0 - point.x).abs() < 1e-5);
                seen += 1;
            }
        }
        assert!(seen > 200, "{seen}");
        assert!((buffer.depth[0] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn the_floor_is_seen_below_the_horizon_only() {
        let mut buffer = ZBuffer::new(64, 48);
        // The camera 0.5 m above the floor, looking level: y down.
        buffer.draw_plane(&CAMERA, &Vector3::y(), 0.5, 7);
        assert_eq!(buffer.triangle[10 * 64], NOTHING);
        assert!((f64::from(buffer.depth[40 * 64]) - 0.5 * 100.0 / (40.0 - 23.5)).abs() < 1e-4);
    }
}
