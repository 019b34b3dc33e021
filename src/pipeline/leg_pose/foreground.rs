//! From a depth image to the points of whoever walks behind the walker.
//!
//! What moves with the walker (its frame, the floor seen from it) is in the background image and goes by comparison with
//! it, in steps of inverse depth, in which a structured-light sensor is equally sharp at all distances (\[walker\] 4.2 does
//! the same with raw values). What remains of the floor goes by its plane. The rest is thinned, densely near the floor,
//! where a foot has few pixels, and sparsely above.

use super::floor::Floor;
use crate::geometry::camera::{DepthMap, Intrinsics};
use nalgebra::Vector3;

/// Inverse depth per raw step of a Kinect v1, 1/m (\[walker\] Eq. 1).
const INVERSE_DEPTH_STEP: f32 = 0.00307;
/// Steps by which a pixel must differ from the background.
const MIN_STEPS: f32 = 3.0;
/// Points lower than this are floor, metres at 1 m distance: the plane's tolerance.
const FLOOR_TOLERANCE: f64 = 0.012;
/// Points higher than this are not legs, metres.
const MAX_HEIGHT: f64 = 1.05;
/// Below this height points are taken densely, metres: feet and ankles.
const DENSE_BELOW: f64 = 0.16;
/// Pixels between two points near the floor.
const DENSE_STRIDE: usize = 3;
/// Pixels between two points above; a multiple of the dense one.
const SPARSE_STRIDE: usize = 6;

/// The part of space in which legs are looked for, in `sensor`, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Nearest and farthest depth.
    pub depth: [f64; 2],
    /// Leftmost and rightmost x.
    pub x: [f64; 2],
}

impl Default for Region {
    /// Wide enough for any walker: half a metre to either side, and as far as somebody with hands on the grips can be.
    /// The paper's box (z ≤ 1.5, −0.245 ≤ x ≤ 0.175) is that of its own camera.
    fn default() -> Self {
        Self { depth: [0.3, 1.9], x: [-0.5, 0.5] }
    }
}

/// One point of the foreground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForegroundPoint {
    /// Position in `floor`, metres.
    pub position: Vector3<f64>,
    /// Pixels that the point stands for.
    pub pixels: f64,
}

/// A frame, prepared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Foreground {
    /// Thinned points of the foreground.
    pub points: Vec<ForegroundPoint>,
    /// Share of all pixels without a depth, 0 to 1.
    pub missing: f64,
    /// Share of the pixels with a depth that are as in the background, 0 to 1; 1 without a background.
    pub unchanged: f64,
}

/// What every frame of a recording is prepared with.
#[derive(Debug, Clone, PartialEq)]
pub struct Preparation {
    camera: Intrinsics,
    floor: Floor,
    region: Region,
    /// Inverse depth of the background, 1/m; 0 where it is not known.
    background: Vec<f32>,
}

impl Preparation {
    /// Prepares for frames of this camera. Without a background the floor's plane alone is removed.
    pub fn new(camera: Intrinsics, floor: Floor, region: Region, background: Option<&DepthMap>) -> Self {
        let background = background.map_or(Vec::new(), |b| b.depth.iter().map(|z| inverse(*z)).collect());
        Self { camera, floor, region, background }
    }

    /// The floor that points are given on.
    pub fn floor(&self) -> &Floor {
        &self.floor
    }

    /// The camera.
    pub fn camera(&self) -> &Intrinsics {
        &self.camera
    }

    /// True where a pixel with this depth is not as in the background.
    fn is_changed(&self, pixel: usize, z: f32) -> bool {
        match self.background.get(pixel) {
            Some(&background) if background > 0.0 => (inverse(z) - background).abs() >= MIN_STEPS * INVERSE_DEPTH_STEP,
            _ => true,
        }
    }

    /// The points of one frame.
    pub fn prepare(&self, image: &DepthMap) -> Foreground {
        let mut result = Foreground::default();
        let (mut looked_at, mut seen, mut unchanged) = (0_u32, 0_u32, 0_u32);
        let rotation = self.floor.floor_from_sensor.matrix();
        for j in (0..image.height).step_by(DENSE_STRIDE) {
            for i in (0..image.width).step_by(DENSE_STRIDE) {
                looked_at += 1;
                let pixel = j * image.width + i;
                let z = image.depth[pixel];
                if z <= 0.0 {
                    continue;
                }
                seen += 1;
                if !self.is_changed(pixel, z) {
                    unchanged += 1;
                    continue;
                }
                let in_sensor = self.camera.point_in_sensor(i as f64, j as f64, f64::from(z));
                if !self.region.contains(&in_sensor) {
                    continue;
                }
                let height = rotation.row(1).transpose().dot(&in_sensor) + self.floor.camera_height;
                if !(FLOOR_TOLERANCE * in_sensor.z.max(1.0).powi(2)..MAX_HEIGHT).contains(&height) {
                    continue;
                }
                let sparse = i % SPARSE_STRIDE == 0 && j % SPARSE_STRIDE == 0;
                if height < DENSE_BELOW || sparse {
                    let stride = if height < DENSE_BELOW { DENSE_STRIDE } else { SPARSE_STRIDE };
                    let position = self.floor.point_from_sensor(&in_sensor);
                    result.points.push(ForegroundPoint { position, pixels: (stride * stride) as f64 });
                }
            }
        }
        result.missing = 1.0 - f64::from(seen) / f64::from(looked_at.max(1));
        result.unchanged = if self.background.is_empty() { 1.0 } else { f64::from(unchanged) / f64::from(seen.max(1)) };
        result
    }
}

impl Region {
    fn contains(&self, point: &Vector3<f64>) -> bool {
        (self.depth[0]..=self.depth[1]).contains(&point.z) && (self.x[0]..=self.x[1]).contains(&point.x)
    }
}

fn inverse(z: f32) -> f32 {
    if z > 0.0 { 1.0 / z } else { 0.0 }
}
