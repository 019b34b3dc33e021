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
pub(super) const INVERSE_DEPTH_STEP: f32 = 0.00307;
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
/// Share of the image that near things fill from which on they are no legs: two thick thighs at 0.6 m fill half of it.
const BLOCKED_SHARE: f64 = 0.7;
/// Share of the image without depth from which on nothing is seen.
const BLIND_SHARE: f64 = 0.97;
/// The focal length for which a pixel counts as one, pixels: that of a Kinect v1.
pub(super) const REFERENCE_FOCAL: f64 = 580.0;

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
    /// Pixels that the point stands for, as a Kinect v1 has them.
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
    /// True when nothing is seen, or when something fills the image: then there are no points.
    pub blocked: bool,
}

/// What every frame of a recording is prepared with.
#[derive(Debug, Clone, PartialEq)]
pub struct Preparation {
    camera: Intrinsics,
    floor: Floor,
    region: Region,
    /// Pixels between points near the floor.
    stride: usize,
    /// Inverse depth of the background, 1/m; 0 where it is not known.
    background: Vec<f32>,
}

impl Preparation {
    /// Prepares for frames of this camera. Without a background the floor's plane alone is removed.
    pub fn new(camera: Intrinsics, floor: Floor, region: Region, background: Option<&DepthMap>) -> Self {
        let background = background.map_or(Vec::new(), |b| b.depth.iter().map(|z| inverse(*z)).collect());
        // Cameras of other resolutions give as many points.
        let stride = ((DENSE_STRIDE as f64 * camera.fx / REFERENCE_FOCAL).round() as usize).max(1);
        Self { camera, floor, region, stride, background }
    }

    /// The floor that points are given on.
    pub fn floor(&self) -> &Floor {
        &self.floor
    }

    /// The camera.
    pub fn camera(&self) -> &Intrinsics {
        &self.camera
    }

    /// Pixels between the looked-at ones.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Takes what was learned to stand still (inverse depths, 1/m) in place of a background, and drops it from frames that
    /// were prepared before.
    pub(super) fn learn<'a>(
        &mut self,
        still: Vec<f32>,
        width: usize,
        earlier: impl Iterator<Item = &'a mut Foreground>,
    ) {
        self.background = still;
        let this = &*self;
        for foreground in earlier {
            foreground.points.retain(|point| {
                let in_sensor = this.floor.sensor_from_point(&point.position);
                this.camera.pixel_of_point(&in_sensor).is_none_or(|place| {
                    let [i, j] = place.map(|k| k.round().max(0.0) as usize);
                    this.is_changed(j * width + i, in_sensor.z as f32)
                })
            });
        }
    }

    /// True where a pixel at this depth shows something within the region and above the floor.
    pub(super) fn is_above_floor(&self, [i, j]: [usize; 2], z: f32) -> bool {
        let in_sensor = self.camera.point_in_sensor(i as f64, j as f64, f64::from(z));
        let height = self.floor.point_from_sensor(&in_sensor).y;
        self.region.contains(&in_sensor) && (DENSE_BELOW..MAX_HEIGHT).contains(&height)
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
        let (mut looked_at, mut seen, mut unchanged, mut near) = (0_u32, 0_u32, 0_u32, 0_u32);
        let (dense, sparse) = (self.stride, self.stride * SPARSE_STRIDE / DENSE_STRIDE);
        let pixel_weight = (REFERENCE_FOCAL / self.camera.fx) * (REFERENCE_FOCAL / self.camera.fy);
        let up = self.floor.floor_from_sensor.matrix().row(1).transpose();
        for j in (0..image.height).step_by(dense) {
            for i in (0..image.width).step_by(dense) {
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
                let height = up.dot(&in_sensor) + self.floor.camera_height;
                if height < FLOOR_TOLERANCE * in_sensor.z.max(1.0).powi(2) {
                    continue;
                }
                near += u32::from(in_sensor.z < self.region.depth[1]);
                if height >= MAX_HEIGHT || !self.region.contains(&in_sensor) {
                    continue;
                }
                let is_low = height < DENSE_BELOW;
                if is_low || (i % sparse == 0 && j % sparse == 0) {
                    let stride = if is_low { dense } else { sparse };
                    let position = self.floor.point_from_sensor(&in_sensor);
                    result.points.push(ForegroundPoint { position, pixels: (stride * stride) as f64 * pixel_weight });
                }
            }
        }
        result.missing = 1.0 - f64::from(seen) / f64::from(looked_at.max(1));
        result.blocked = result.missing > BLIND_SHARE || f64::from(near) > BLOCKED_SHARE * f64::from(looked_at.max(1));
        if result.blocked {
            result.points.clear();
        }
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
