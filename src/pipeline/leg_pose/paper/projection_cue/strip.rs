//! Strips of the image: as many columns as a group has lanes.

use crate::geometry::camera::Intrinsics;
use crate::geometry::lanes::{Group, LANES, Lanes};
use pulp::Simd;

/// Rows in the columns of a strip: from the first number to the one before the second; none where they do not ascend.
pub type Rows = [Group; 2];

/// The columns of a strip as the camera sees them.
#[derive(Debug, Clone, Copy)]
pub struct Strip {
    /// Their x at depth 1. Beyond the image's last column it is not a number, which nothing meets.
    x: Group,
    focal: f32,
    centre: f32,
    height: f32,
}

impl Strip {
    /// The columns from `strip · LANES` on of images of a size.
    #[inline(always)]
    pub fn new(strip: usize, camera: &Intrinsics, [width, height]: [usize; 2]) -> Self {
        let x = |lane: usize| {
            let column = strip * LANES + lane;
            if column < width { ((column as f64 - camera.cx) / camera.fx) as f32 } else { f32::NAN }
        };
        Self {
            x: Group(std::array::from_fn(x)),
            focal: camera.fy as f32,
            centre: camera.cy as f32,
            height: height as f32,
        }
    }

    /// One register of the columns' x at depth 1.
    #[inline(always)]
    pub fn x<S: Simd>(&self, simd: S, register: usize) -> Lanes<S> {
        self.x.lanes(simd, register)
    }

    /// The whole rows of the image between two y at depth 1: the first, and the one after the last.
    #[inline(always)]
    pub fn rows<S: Simd>(&self, simd: S, [low, high]: [Lanes<S>; 2]) -> [Lanes<S>; 2] {
        let (focal, centre) = (Lanes::splat(simd, self.focal), Lanes::splat(simd, self.centre));
        let (none, end) = (Lanes::splat(simd, -1.0), Lanes::splat(simd, self.height));
        let before = low.mul_add(Lanes::splat(simd, 0.0) - focal, Lanes::splat(simd, 0.0) - centre);
        let before = before.min(Lanes::splat(simd, 0.0)).max(none - self.height + 1.0);
        let last = high.mul_add(focal, centre).max(none).min(end - 1.0);
        [Lanes::splat(simd, 0.0) - before.floor(), last.floor() + 1.0]
    }
}

/// Rows from one to another, with a coordinate `t` that goes from −1 to 1 over them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Span {
    middle: f32,
    reach: f32,
    /// y at depth 1 in the middle, and from there to `t` = 1.
    pub y: [f64; 2],
}

impl Span {
    /// The rows from `low` to `high`, which is above it.
    #[inline(always)]
    pub fn new([low, high]: [u32; 2], camera: &Intrinsics) -> Self {
        let (middle, reach) = (0.5 * f64::from(low + high), 0.5 * f64::from(high - low));
        Self { middle: middle as f32, reach: reach as f32, y: [(middle - camera.cy) / camera.fy, reach / camera.fy] }
    }

    /// `t` in the first row of the image, and its step from row to row.
    #[inline(always)]
    pub fn lanes<S: Simd>(&self, simd: S) -> [Lanes<S>; 2] {
        [Lanes::splat(simd, -self.middle / self.reach), Lanes::splat(simd, 1.0 / self.reach)]
    }
}
