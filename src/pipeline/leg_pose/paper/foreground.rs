//! From a depth image to the foreground: the paper's two filters (\[walker\], section 4.2).
//!
//! ```text
//! |raw − background raw| ≥ threshold        what is floor stays within some steps of it
//! z, x inside the region, y free            what is beside or behind the user is outside
//! ```
//!
//! A raw step is a step of inverse depth (\[walker\] Eq. 1), so images in metres are compared as `1/z` and need no raw
//! values. Where the background saw nothing, whatever the image sees is foreground, as with raw values.

use crate::geometry::camera::{DepthMap, Intrinsics};
use crate::geometry::lanes::{Group, LANES};
use crate::pipeline::leg_pose::foreground::Region;

/// Inverse depth per raw step of a Kinect v1, 1/m (\[walker\] Eq. 1).
const INVERSE_DEPTH_STEP: f32 = 0.00307;

/// Cue 1 uses one foreground point of so many (\[walker\], section 4.4.1: 10 %).
pub const SAMPLING: usize = 10;

/// A prepared frame. It lies in strips of [`LANES`] columns, because the projections of upright legs run along columns and
/// a register holds one row of a strip.
#[derive(Debug, Clone, PartialEq)]
pub struct Foreground {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Strip by strip, row by row: twice the depth of the foreground, metres, 0 elsewhere. Twice, because that is what
    /// cue 2 compares with ([`projection_cue`](super::projection_cue)).
    twice_depth: Vec<Group>,
    /// Pixels of the foreground.
    pub pixels: usize,
    /// Sum of the foreground's depths, metres.
    pub depth_sum: f64,
    /// Every tenth point of the foreground, counted along the columns, in `sensor`, metres.
    pub points: Vec<[f32; 3]>,
    /// Share of all pixels that saw nothing, 0 to 1.
    pub missing: f64,
}

impl Foreground {
    /// The foreground of an image against a background of the same size.
    ///
    /// # Panics
    /// When the sizes differ from each other or from the number of depths.
    pub fn find(
        image: &DepthMap,
        background: &DepthMap,
        camera: &Intrinsics,
        region: &Region,
        threshold_steps: f64,
    ) -> Self {
        let (width, height) = (image.width, image.height);
        assert_eq!((width, height), (background.width, background.height), "image and background of one camera");
        assert!(image.depth.len() == width * height && background.depth.len() == width * height, "whole images");
        let threshold = threshold_steps as f32 * INVERSE_DEPTH_STEP;
        let [near, far] = region.depth.map(|z| z as f32);
        let mut strips = vec![Group::default(); width.div_ceil(LANES) * height];
        let mut seen = 0usize;
        // Row by row, as the images lie in memory; the strips are few enough to stay in the cache.
        for j in 0..height {
            let rows = j * width..(j + 1) * width;
            for (i, (z, floor)) in image.depth[rows.clone()].iter().zip(&background.depth[rows]).enumerate() {
                let is_seen = *z > 0.0 && z.is_finite();
                seen += usize::from(is_seen);
                // A background that saw nothing is infinitely far in inverse depth from whatever is seen.
                let steps = (1.0 / z - 1.0 / floor).abs();
                let differs = steps >= threshold || steps.is_nan();
                if is_seen && differs && *z >= near && *z <= far {
                    strips[i / LANES * height + j].0[i % LANES] = 2.0 * *z;
                }
            }
        }
        let mut foreground = Self {
            width,
            height,
            twice_depth: strips,
            pixels: 0,
            depth_sum: 0.0,
            points: Vec::new(),
            missing: 1.0 - seen as f64 / (width * height).max(1) as f64,
        };
        foreground.collect(camera, region);
        foreground
    }

    /// Applies the bounds on x, counts, sums and samples.
    fn collect(&mut self, camera: &Intrinsics, region: &Region) {
        for i in 0..self.width {
            let slope = (i as f64 - camera.cx) / camera.fx;
            let strip = &mut self.twice_depth[i / LANES * self.height..][..self.height];
            for (j, row) in strip.iter_mut().enumerate() {
                let twice = &mut row.0[i % LANES];
                if *twice == 0.0 {
                    continue;
                }
                let z = 0.5 * *twice;
                let depth = f64::from(z);
                if !(region.x[0]..=region.x[1]).contains(&(slope * depth)) {
                    *twice = 0.0;
                    continue;
                }
                if self.pixels.is_multiple_of(SAMPLING) {
                    let y = (j as f64 - camera.cy) / camera.fy * depth;
                    self.points.push([(slope * depth) as f32, y as f32, z]);
                }
                self.pixels += 1;
                self.depth_sum += depth;
            }
        }
    }

    /// Twice the depths of a strip: the [`LANES`] columns from `strip · LANES` on, row by row.
    #[inline(always)]
    pub fn strip(&self, strip: usize) -> &[Group] {
        &self.twice_depth[strip * self.height..][..self.height]
    }

    /// Depth of the foreground at a pixel, metres; 0 where there is none.
    pub fn depth(&self, i: usize, j: usize) -> f32 {
        0.5 * self.strip(i / LANES)[j].0[i % LANES]
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::PAPER_REGION;
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { fx: 50.0, fy: 50.0, cx: 31.5, cy: 23.5 };

    fn found(image: &DepthMap, background: &DepthMap) -> Foreground {
        Foreground::find(image, background, &CAMERA, &PAPER_REGION, 4.0)
    }

    fn flat(z: f32) -> DepthMap {
        DepthMap { width: 64, height: 48, depth: vec![z; 64 * 48] }
    }

    #[test]
    fn what_is_near_the_background_or_outside_the_region_is_no_foreground() {
        let mut image = flat(1.2);
        let pixel = |i: usize, j: usize| j * 64 + i;
        image.depth[pixel(30, 20)] = 0.9;
        // A centimetre at 1.2 m is two raw steps.
        image.depth[pixel(31, 20)] = 1.19;
        image.depth[pixel(5, 20)] = 0.9;
        image.depth[pixel(32, 20)] = 1.6;
        image.depth[pixel(33, 20)] = f32::NAN;
        image.depth[pixel(34, 20)] = -1.0;
        image.depth[pixel(35, 20)] = f32::INFINITY;
        let foreground = found(&image, &flat(1.2));
        assert_eq!((foreground.pixels, foreground.depth(30, 20)), (1, 0.9));
        assert_eq!(foreground.points.len(), 1);
        assert!((foreground.missing - 3.0 / 3072.0).abs() < 1e-12);
    }

    #[test]
    fn without_a_background_everything_in_the_region_is_foreground() {
        let foreground = found(&flat(1.0), &flat(0.0));
        // x from −0.245 to 0.175 m at 1 m: columns 20 to 40.
        assert_eq!(foreground.pixels, 21 * 48);
        assert_eq!(foreground.points.len(), (21usize * 48).div_ceil(10));
        assert!((foreground.depth_sum - 1008.0).abs() < 1e-9);
    }

    #[test]
    fn an_empty_image_is_missing_altogether() {
        let foreground = found(&flat(0.0), &flat(1.0));
        assert_eq!((foreground.pixels, foreground.missing), (0, 1.0));
    }
}
