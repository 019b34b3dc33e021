//! The paper's comparison: colours and gradients in two cameras at the sides (\[walker\], section 4.4.4).
//!
//! ```text
//! h, g     of each segment in each camera: histogram of colours (HSV) and of oriented gradients in the pixels that the
//!          segment's projection covers
//! h0, g0   the same in the first image, over the pixels that are labelled as the segment
//! P      = exp(−λ Σ over segments and cameras (|h − h0|₁ + |g − g0|₁) / n)        n: segments and cameras with a template
//! ```
//!
//! The paper sets its factors by hand and does not say them; [`LAMBDA`] is ours. A segment that a state moves out of an image
//! in which it was labelled is as far as histograms can be. Where segments overlap, the one whose middle is nearer hides the
//! other, column by column.

pub mod histogram;

use super::projection_cue::face::Faces;
use super::projection_cue::is_in_front;
use super::projection_cue::outline::Outline;
use super::projection_cue::strip::Strip;
use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::camera::Intrinsics;
use crate::geometry::lanes::LANES;
use crate::geometry::tapered_cylinder::TaperedCylinder;
use crate::recording::side_camera::{SideCamera, SideImages};
use histogram::{BINS, ColumnSums, Histograms, Sums, add_pixel};
use nalgebra::Isometry3;
use pulp::Simd;

/// Scale of the likelihood: by hand, as in the paper, so that some dozens of 5000 particles survive.
pub const LAMBDA: f64 = 60.0;

/// The largest L1 distance of two histograms.
const FARTHEST: f32 = 2.0;

/// What segments looked like in the first images of both cameras.
#[derive(Debug, Clone)]
pub struct Templates {
    views: [Template; 2],
}

#[derive(Debug, Clone)]
struct Template {
    intrinsics: Intrinsics,
    camera_from_sensor: Isometry3<f64>,
    segments: [Option<Histograms>; SOLID_COUNT],
}

impl Templates {
    /// The templates in the labelled first images. `None` when labels and images differ in size or nothing is labelled.
    pub fn new(cameras: &[SideCamera; 2]) -> Option<Self> {
        let view = |k: usize| {
            let camera = &cameras[k];
            let image = &camera.first;
            if camera.labels.len() != image.pixels.len() {
                return None;
            }
            let mut sums = [[0.0; BINS]; SOLID_COUNT];
            for (pixel, label) in camera.labels.iter().enumerate() {
                if let Some(sums) = (*label as usize).checked_sub(1).and_then(|segment| sums.get_mut(segment)) {
                    add_pixel(image, pixel % image.width, pixel / image.width, sums);
                }
            }
            Some(Template {
                intrinsics: camera.intrinsics,
                camera_from_sensor: camera.camera_from_sensor,
                segments: sums.each_ref().map(Histograms::of_sums),
            })
        };
        let views = [view(0)?, view(1)?];
        let has_any = views.iter().any(|view| view.segments.iter().any(Option::is_some));
        has_any.then_some(Self { views })
    }

    /// The cue for what both cameras see at another time.
    pub fn cue(&self, images: &SideImages) -> ColourCue {
        ColourCue { templates: self.clone(), sums: images.each_ref().map(ColumnSums::new) }
    }
}

/// The cue of one frame.
#[derive(Debug, Clone)]
pub struct ColourCue {
    templates: Templates,
    sums: [ColumnSums; 2],
}

impl ColourCue {
    /// Mean L1 distance of both histograms over segments and cameras, 0 to 4. `None` when a part of the model is behind a
    /// camera.
    #[inline(always)]
    pub fn distance<S: Simd>(&self, simd: S, solids: &[TaperedCylinder; SOLID_COUNT]) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0u32);
        for (template, sums) in self.templates.views.iter().zip(&self.sums) {
            let regions = regions(simd, solids, template, sums)?;
            for (template, region) in template.segments.iter().zip(&regions) {
                let Some(template) = template else { continue };
                let [colours, directions] = match Histograms::of_sums(region) {
                    Some(histograms) => histograms.distances(template),
                    None => [FARTHEST; 2],
                };
                sum += f64::from(colours + directions);
                count += 1;
            }
        }
        Some(sum / f64::from(count.max(1)))
    }
}

/// Sums over the pixels that each solid covers in a camera's image.
#[inline(always)]
fn regions<S: Simd>(
    simd: S,
    solids: &[TaperedCylinder; SOLID_COUNT],
    view: &Template,
    sums: &ColumnSums,
) -> Option<[Sums; SOLID_COUNT]> {
    let pose = &view.camera_from_sensor;
    let moved = solids.map(|solid| TaperedCylinder {
        start: pose.rotation * solid.start + pose.translation.vector,
        end: pose.rotation * solid.end + pose.translation.vector,
        radii: solid.radii,
        dome: solid.dome.map(|dome| pose.rotation * dome),
    });
    if !moved.iter().all(is_in_front) {
        return None;
    }
    let outlines = moved.each_ref().map(|solid| Outline::new(solid, &Faces::new(solid), &view.intrinsics, sums.width));
    let (mut first, mut last) = (sums.width, 0);
    for outline in &outlines {
        first = first.min(outline.strips().start);
        last = last.max(outline.strips().end);
    }
    // Nearest first.
    let middle = |k: usize| moved[k].start.z + moved[k].end.z;
    let mut order: [usize; SOLID_COUNT] = std::array::from_fn(|k| k);
    order.sort_unstable_by(|a, b| middle(*a).total_cmp(&middle(*b)));
    let mut regions = [[0.0; BINS]; SOLID_COUNT];
    for number in first..last {
        let strip = Strip::new(number, &view.intrinsics, [sums.width, sums.height]);
        let rows = outlines.each_ref().map(|outline| outline.trace(simd, &strip).whole);
        for lane in 0..LANES.min(sums.width - number * LANES) {
            let mut free = Stretches::whole(sums.height);
            for solid in order {
                let rows = [rows[solid][0].0[lane] as usize, rows[solid][1].0[lane] as usize];
                free.take(rows, |rows| sums.add(number * LANES + lane, rows, &mut regions[solid]));
            }
        }
    }
    Some(regions)
}

/// Stretches of rows in a column that nothing covers yet, in order.
struct Stretches {
    rows: [[usize; 2]; SOLID_COUNT + 1],
    count: usize,
}

impl Stretches {
    #[inline(always)]
    fn whole(height: usize) -> Self {
        let mut rows = [[0; 2]; SOLID_COUNT + 1];
        rows[0] = [0, height];
        Self { rows, count: 1 }
    }

    /// Takes what is free of some rows, and tells each stretch of it.
    #[inline(always)]
    fn take(&mut self, [start, end]: [usize; 2], mut taken: impl FnMut([usize; 2])) {
        if start >= end {
            return;
        }
        let mut left = [[0; 2]; SOLID_COUNT + 1];
        let mut count = 0;
        for [low, high] in &self.rows[..self.count] {
            let [from, to] = [start.max(*low), end.min(*high)];
            if from >= to {
                left[count] = [*low, *high];
                count += 1;
                continue;
            }
            taken([from, to]);
            // One cut adds at most one stretch, and there are at most as many cuts as solids.
            for rest in [[*low, from], [to, *high]] {
                if rest[0] < rest[1] {
                    left[count] = rest;
                    count += 1;
                }
            }
        }
        (self.rows, self.count) = (left, count);
    }
}

#[cfg(test)]
mod tests;
