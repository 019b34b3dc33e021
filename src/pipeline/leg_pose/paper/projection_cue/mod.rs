//! Cue 2: depths of the model's projection against the image, pixel by pixel (\[walker\], section 4.4.2).
//!
//! ```text
//! d2 = Σ |zP − zK| / (width · height)       zP, zK: depth of the model and of the foreground, 0 where there is none
//! P2 = exp(−d2 / 3 mm)
//! ```
//!
//! All pixels count, at full resolution, but only those under the model need to be visited:
//!
//! ```text
//! Σ |zP − zK| = Σ over all zK + Σ over the model's pixels (|zP − zK| − zK)
//! ```
//!
//! The solids are convex, so each covers one interval of rows in a column, and its front consists of few smooth
//! [`faces`](face) on which depth along a column has a closed form. Sixteen columns, a [`strip`], are gone through together: the
//! ends of the intervals are found in all of them at once ([`outline`]), faces are sorted by their first rows ([`runs`]), and
//! where several are in a row the nearer depth is taken. There is no depth buffer of the image. The paper rasterises polygons that circumscribe the cylinders; here the surfaces are exact, and solids
//! are closed by discs at their ends.

pub mod face;
pub mod outline;
pub mod runs;
pub mod side;
pub mod strip;

use super::foreground::Foreground;
use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::camera::Intrinsics;
use crate::geometry::lanes::Group;
use crate::geometry::tapered_cylinder::TaperedCylinder;
use face::Faces;
use outline::Outline;
use pulp::Simd;
use runs::{Runs, Scene};
use strip::Strip;

/// Scale of the likelihood, 1/m (λ2 = 1/3 per mm).
pub const LAMBDA_PER_M: f64 = 1000.0 / 3.0;

/// Solids must lie wholly beyond this depth, metres: nearer than any depth camera measures.
const NEAREST: f64 = 0.1;

/// Cue 2 of one frame.
#[derive(Debug)]
pub struct ProjectionCue<'a> {
    foreground: &'a Foreground,
    camera: &'a Intrinsics,
}

/// Memory for one model at a time.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    runs: Runs,
}

impl<'a> ProjectionCue<'a> {
    /// The cue for a frame of a camera.
    pub fn new(foreground: &'a Foreground, camera: &'a Intrinsics) -> Self {
        Self { foreground, camera }
    }

    /// `d2` of a model's solids, metres. `None` when a part of them is behind the camera or too near to it.
    #[inline(always)]
    pub fn distance<S: Simd>(
        &self,
        simd: S,
        solids: &[TaperedCylinder; SOLID_COUNT],
        scratch: &mut Scratch,
    ) -> Option<f64> {
        if !solids.iter().all(is_in_front) {
            return None;
        }
        let Foreground { width, height, .. } = *self.foreground;
        let mut faces = [Faces::default(); SOLID_COUNT];
        let mut outlines = <[Outline; SOLID_COUNT]>::default();
        let (mut first, mut last) = (width, 0);
        for k in 0..SOLID_COUNT {
            faces[k] = Faces::new(&solids[k]);
            outlines[k] = Outline::new(&solids[k], &faces[k], self.camera, width);
            first = first.min(outlines[k].strips().start);
            last = last.max(outlines[k].strips().end);
        }
        let mut sums = Group::default();
        let runs = &mut scratch.runs;
        for number in first..last {
            let strip = Strip::new(number, self.camera, [width, height]);
            let scene = Scene { faces: &faces, strip: &strip, camera: self.camera };
            runs.clear();
            for (solid, outline) in outlines.iter().enumerate() {
                if outline.strips().contains(&number) {
                    runs.add_solid(simd, &scene, solid, &outline.trace(simd, &strip));
                }
            }
            runs.sum(simd, &scene, self.foreground.strip(number), &mut sums);
        }
        let mut sum = self.foreground.depth_sum;
        for lane in sums.0 {
            sum += f64::from(lane);
        }
        Some(sum / (width * height) as f64)
    }
}

/// True when both discs of a solid lie beyond `NEAREST`, whichever way they face.
pub fn is_in_front(solid: &TaperedCylinder) -> bool {
    solid.start.z - solid.radii[0] > NEAREST && solid.end.z - solid.radii[1] > NEAREST
}

#[cfg(test)]
pub(super) mod reference;
#[cfg(test)]
mod tests;
