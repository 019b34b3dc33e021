//! The floor in a depth image, and the axes that it gives.
//!
//! Most of what a camera on a walker sees without its user is floor, so the floor is the plane with the most points on
//! it: planes through three random pixels are tried, the best is refined by least squares on its own points. In the
//! `floor` frame x points to the right in the image, y up and z against the camera's horizontal direction of view: where
//! the walker goes when its user walks forwards. Its origin lies on the floor below the camera.

use crate::geometry::camera::{DepthMap, Intrinsics};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Pixels between two that are looked at, along rows and columns.
const STRIDE: usize = 6;
/// Planes tried. With half of the pixels on the floor one in eight triples hits it; 300 miss it once in 10^17.
const CANDIDATES: usize = 300;
/// A point this near to a plane at 1 m is on it, metres: three quantisation steps of a structured-light sensor.
const ON_PLANE_AT_1M: f64 = 0.009;
/// The largest angle between the floor's normal and the image's vertical: cameras are tilted, not laid on their side.
const MAX_TILT: f64 = 65.0 * std::f64::consts::PI / 180.0;
/// Heights at which a camera on a walker may be, metres.
const CAMERA_HEIGHT: std::ops::Range<f64> = 0.15..2.0;
/// The least number of looked-at pixels on the floor that determine it.
const MIN_POINTS: usize = 60;

/// Where the floor is, seen from the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Floor {
    /// Rotation from `sensor` to `floor`.
    pub floor_from_sensor: Rotation3<f64>,
    /// Height of the camera above the floor, metres.
    pub camera_height: f64,
    /// Root mean square distance of the floor's points from the plane, metres.
    pub residual: f64,
    /// Share of the pixels with a depth that lie on the floor, 0 to 1.
    pub share: f64,
}

impl Floor {
    /// The floor whose upward normal, in `sensor`, is given.
    fn from_plane(up: Vector3<f64>, camera_height: f64) -> Option<Self> {
        let view = Vector3::z();
        let away = (view - up * up.dot(&view)).try_normalize(1e-6)?;
        let towards = -away;
        let right = up.cross(&towards);
        let axes = Matrix3::from_rows(&[right.transpose(), up.transpose(), towards.transpose()]);
        let floor_from_sensor = Rotation3::from_matrix_unchecked(axes);
        Some(Self { floor_from_sensor, camera_height, residual: 0.0, share: 0.0 })
    }

    /// Finds the floor in an image. `None` when no plane below the camera holds enough points.
    pub fn find(image: &DepthMap, camera: &Intrinsics) -> Option<Self> {
        let points = sampled_points(image, camera);
        if points.len() < MIN_POINTS {
            return None;
        }
        let mut random = ChaCha8Rng::seed_from_u64(points.len() as u64);
        let mut best: Option<(usize, Vector3<f64>, f64)> = None;
        for _ in 0..CANDIDATES {
            let [a, b, c] = std::array::from_fn(|_| points[random.random_range(0..points.len())]);
            let Some((up, height)) = plane_through(&a, &b, &c) else { continue };
            let count = points.iter().filter(|p| is_on_plane(p, &up, height)).count();
            if best.is_none_or(|(most, ..)| count > most) {
                best = Some((count, up, height));
            }
        }
        let (_, mut up, mut height) = best?;
        let mut on_floor = Vec::new();
        for _ in 0..3 {
            on_floor = points.iter().copied().filter(|p| is_on_plane(p, &up, height)).collect();
            if on_floor.len() < MIN_POINTS {
                return None;
            }
            (up, height) = least_squares_plane(&on_floor)?;
        }
        let squares: f64 = on_floor.iter().map(|p| (p.dot(&up) + height).powi(2)).sum();
        let residual = (squares / on_floor.len() as f64).sqrt();
        let share = on_floor.len() as f64 / points.len() as f64;
        Some(Self { residual, share, ..Self::from_plane(up, height)? })
    }

    /// A point in `floor`, metres, from one in `sensor`.
    pub fn point_from_sensor(&self, point_in_sensor: &Vector3<f64>) -> Vector3<f64> {
        self.floor_from_sensor * point_in_sensor + Vector3::new(0.0, self.camera_height, 0.0)
    }

    /// A point in `sensor`, metres, from one in `floor`.
    pub fn sensor_from_point(&self, point_in_floor: &Vector3<f64>) -> Vector3<f64> {
        self.floor_from_sensor.inverse() * (point_in_floor - Vector3::new(0.0, self.camera_height, 0.0))
    }

    /// Angle by which the camera looks down, radians.
    pub fn tilt(&self) -> f64 {
        // The view direction's component along up is −sin(tilt).
        (-self.floor_from_sensor[(1, 2)]).clamp(-1.0, 1.0).asin()
    }
}

fn sampled_points(image: &DepthMap, camera: &Intrinsics) -> Vec<Vector3<f64>> {
    let mut points = Vec::new();
    for j in (0..image.height).step_by(STRIDE) {
        for i in (0..image.width).step_by(STRIDE) {
            let z = f64::from(image.depth[j * image.width + i]);
            if z > 0.0 {
                points.push(camera.point_in_sensor(i as f64, j as f64, z));
            }
        }
    }
    points
}

/// Quantisation of a structured-light sensor grows with the square of the distance.
fn is_on_plane(point: &Vector3<f64>, up: &Vector3<f64>, height: f64) -> bool {
    (point.dot(up) + height).abs() < ON_PLANE_AT_1M * (point.z * point.z).max(0.5)
}

/// Upward normal and camera height of the plane through three points, when it can be a floor.
fn plane_through(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
    let normal = (b - a).cross(&(c - a)).try_normalize(1e-4)?;
    floor_like(if normal.y > 0.0 { -normal } else { normal }, a)
}

fn floor_like(up: Vector3<f64>, on_plane: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
    let height = -on_plane.dot(&up);
    (-up.y > MAX_TILT.cos() && CAMERA_HEIGHT.contains(&height)).then_some((up, height))
}

/// The plane of least squared distance, weighted by the inverse of the points' noise.
fn least_squares_plane(points: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64)> {
    let weight = |p: &Vector3<f64>| 1.0 / (p.z * p.z).max(0.5).powi(2);
    let total: f64 = points.iter().map(weight).sum();
    let mean = points.iter().map(|p| p * weight(p)).sum::<Vector3<f64>>() / total;
    let scatter: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose() * weight(p)).sum();
    let eigen = scatter.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    floor_like(if normal.y > 0.0 { -normal } else { normal }, &mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5 };

    /// A floor seen from `height` by a camera that looks down by `tilt`, with a box in front of it.
    fn scene(height: f64, tilt: f64) -> DepthMap {
        let mut image = DepthMap::empty(640, 480);
        for j in 0..480 {
            for i in 0..640 {
                let ray = CAMERA.point_in_sensor(i as f64, j as f64, 1.0);
                let down = ray.y * tilt.cos() + tilt.sin();
                let z = if down > 0.0 { height / down } else { 0.0 };
                let boxed = (200..440).contains(&i) && (100..400).contains(&j);
                image.depth[j * 640 + i] = if boxed {
                    0.9
                } else if z < 3.0 {
                    z as f32
                } else {
                    0.0
                };
            }
        }
        image
    }

    #[test]
    fn height_and_tilt_are_found_with_somebody_in_the_image() {
        for tilt_deg in [5.0_f64, 12.0, 35.0] {
            let floor = Floor::find(&scene(0.7, tilt_deg.to_radians()), &CAMERA).unwrap();
            assert!((floor.camera_height - 0.7).abs() < 1e-3, "{floor:?}");
            assert!((floor.tilt().to_degrees() - tilt_deg).abs() < 0.1, "{floor:?}");
        }
    }

    #[test]
    fn axes_are_right_handed_with_a_point_ahead_of_the_camera_at_negative_z() {
        let floor = Floor::find(&scene(0.7, 0.2), &CAMERA).unwrap();
        assert!((floor.floor_from_sensor.matrix().determinant() - 1.0).abs() < 1e-9);
        let point = floor.point_from_sensor(&Vector3::new(0.1, 0.0, 1.0));
        assert!(point.x > 0.05 && point.z < -0.9, "{point}");
        let back = floor.sensor_from_point(&point);
        assert!((back - Vector3::new(0.1, 0.0, 1.0)).norm() < 1e-12);
    }

    #[test]
    fn an_image_without_a_floor_has_none() {
        assert_eq!(Floor::find(&DepthMap::empty(640, 480), &CAMERA), None);
        let wall = DepthMap { depth: vec![1.0; 640 * 480], ..DepthMap::empty(640, 480) };
        assert_eq!(Floor::find(&wall, &CAMERA), None);
    }
}
