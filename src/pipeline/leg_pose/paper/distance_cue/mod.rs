//! Cue 1: distances in space between the model's axes and the foreground (\[walker\], section 4.4.1).
//!
//! ```text
//! M        both ends of each segment's axis and n = 10 points between them, evenly spaced, each with the radius w_m there
//! F        every tenth point of the foreground
//! d_FM   = mean over f in F of | w_m* − |f − m*| |     m* the nearest of all m to f
//! d_MF   = mean over m in M of | w_m  − min_f |f − m| |
//! d1     = (d_FM + d_MF) / 2                           P1 = exp(−d1 / 5 mm)
//! ```
//!
//! Both sums are computed as they stand, fast: the nearest of a segment's points has a closed form (the projection onto the
//! axis, rounded to the spacing), which leaves six distances for each f, fewer
//! where a block of points is far from a segment; the nearest f is looked up in a [`nearest`] field
//! that is built once a frame. The deviation is in F: the paper draws it at random for each frame.

pub mod nearest;

use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::lanes::{LANES, Lanes};
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::Vector3;
use nearest::{Block, NearestField, Spheres};
use pulp::Simd;

/// Steps between the points of an axis: both ends and n = 10 points between them.
const STEPS: usize = 11;
/// Model points of a segment.
pub const POINTS_OF_SEGMENT: usize = STEPS + 1;
/// Scale of the likelihood, 1/m (λ1 = 1/5 per mm).
pub const LAMBDA_PER_M: f64 = 1000.0 / 5.0;

/// Both directed distances, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distances {
    /// Mean from the foreground to the model (`d_FM`, Eq. 4).
    pub from_foreground: f64,
    /// Mean from the model to the foreground (`d_MF`, Eq. 5).
    pub from_model: f64,
}

impl Distances {
    /// Their mean (`d1`, Eq. 6).
    pub fn mean(&self) -> f64 {
        0.5 * (self.from_foreground + self.from_model)
    }
}

/// Cue 1 of one frame.
#[derive(Debug)]
pub struct DistanceCue {
    /// Centre of the foreground: numbers near zero lose least in `f32`.
    origin: Vector3<f64>,
    nearest: NearestField,
}

impl DistanceCue {
    /// The cue for points of the foreground (in `sensor`, metres). Up to 15 points of them are left out, so that whole
    /// registers remain. `None` when fewer remain than fill one.
    pub fn new(points: &[[f32; 3]]) -> Option<Self> {
        let count = points.len() / LANES * LANES;
        if count == 0 {
            return None;
        }
        let sum: Vector3<f64> = points.iter().map(|p| Vector3::from(p.map(f64::from))).sum();
        let origin = sum / points.len() as f64;
        let shift = [origin.x as f32, origin.y as f32, origin.z as f32];
        let shifted = points[..count].iter().map(|p| std::array::from_fn(|axis| p[axis] - shift[axis])).collect();
        // The points were moved by the rounded origin.
        Some(Self { origin: Vector3::from(shift.map(f64::from)), nearest: NearestField::new(shifted) })
    }

    /// Distances of a model's solids (in `sensor`).
    #[inline(always)]
    pub fn distances<S: Simd>(&self, simd: S, solids: &[TaperedCylinder; SOLID_COUNT]) -> Distances {
        let mut axes = [Axis::default(); SOLID_COUNT];
        for (axis, solid) in axes.iter_mut().zip(solids) {
            *axis = Axis::new(solid, &self.origin);
        }
        let points = self.nearest.blocks().len() * LANES;
        let from_foreground = sum_from_foreground(simd, &self.nearest, &axes) / points as f64;
        let mut sum = 0.0;
        for axis in &axes {
            for k in 0..POINTS_OF_SEGMENT {
                let k = k as f32;
                let mut point = axis.start;
                for (coordinate, step) in point.iter_mut().zip(axis.step) {
                    *coordinate += k * step;
                }
                let distance = self.nearest.distance(simd, &point);
                sum += f64::from((axis.radius + k * axis.radius_step - distance).abs());
            }
        }
        Distances { from_foreground, from_model: sum / (SOLID_COUNT * POINTS_OF_SEGMENT) as f64 }
    }
}

/// Points of a segment's axis relative to the origin: `start + k · step` with radius `radius + k · radius_step`.
#[derive(Debug, Clone, Copy, Default)]
struct Axis {
    start: [f32; 3],
    step: [f32; 3],
    radius: f32,
    radius_step: f32,
    /// `step / |step|²`, and its product with the start: they give the k nearest to a point.
    inverse_step: [f32; 3],
    start_in_steps: f32,
    /// `|step|²`, `−2 start`, `|start|²`: they give a point's squared distance, less its own square.
    step_squared: f32,
    minus_twice_start: [f32; 3],
    start_squared: f32,
}

impl Axis {
    #[inline(always)]
    fn new(solid: &TaperedCylinder, origin: &Vector3<f64>) -> Self {
        /// Keeps the division finite for a segment without a length, metres squared.
        const SHORTEST: f64 = 1e-12;
        let (start, step) = (solid.start - origin, (solid.end - solid.start) / STEPS as f64);
        let step_squared = step.norm_squared().max(SHORTEST);
        let inverse = step / step_squared;
        let f32s = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        Self {
            start: f32s(start),
            step: f32s(step),
            radius: solid.radii[0] as f32,
            radius_step: ((solid.radii[1] - solid.radii[0]) / STEPS as f64) as f32,
            inverse_step: f32s(inverse),
            start_in_steps: start.dot(&inverse) as f32,
            step_squared: step_squared as f32,
            minus_twice_start: f32s(start * -2.0),
            start_squared: start.norm_squared() as f32,
        }
    }
}

/// Σ over f of | w_m* − |f − m*| |, metres.
///
/// Most blocks of points are near one or two segments, and only those can hold the nearest m: a point in a sphere of radius
/// r about c is at most r nearer to a segment, or farther from it, than c is.
#[inline(always)]
fn sum_from_foreground<S: Simd>(simd: S, field: &NearestField, axes: &[Axis; SOLID_COUNT]) -> f64 {
    let zero = Lanes::splat(simd, 0.0);
    let mut sums = [0.0f32; LANES];
    for (group, blocks) in field.spheres().iter().zip(field.blocks().chunks(LANES)) {
        let mut segments = [0.0f32; LANES];
        for (register, segments) in S::as_mut_simd_f32s(&mut segments).0.iter_mut().enumerate() {
            *segments = near_segments(simd, group, register, axes).values;
        }
        for (block, segments) in blocks.iter().zip(segments) {
            for (register, sum) in S::as_mut_simd_f32s(&mut sums).0.iter_mut().enumerate() {
                let mut nearest = Nearest { squared: Lanes::splat(simd, f32::INFINITY), radius: zero };
                let mut remaining = segments as u32;
                while remaining != 0 {
                    nearest.meet(simd, block, register, &axes[remaining.trailing_zeros() as usize]);
                    remaining &= remaining - 1;
                }
                let distance = (nearest.squared + block.lanes(simd, 3, register)).max(zero).sqrt();
                *sum = (Lanes::new(simd, *sum) + (nearest.radius - distance).abs()).values;
            }
        }
    }
    let mut total = 0.0;
    for sum in sums {
        total += f64::from(sum);
    }
    total
}

/// Segments that can be nearest to a point in each of some spheres, as the sum of two to the power of their numbers.
#[inline(always)]
fn near_segments<S: Simd>(simd: S, group: &Spheres, register: usize, axes: &[Axis; SOLID_COUNT]) -> Lanes<S> {
    /// What rounding may add to a distance, metres.
    const ROUNDING: f32 = 1e-4;
    let zero = Lanes::splat(simd, 0.0);
    let mut distances = [zero; SOLID_COUNT];
    let mut least = Lanes::splat(simd, f32::INFINITY);
    for (distance, axis) in distances.iter_mut().zip(axes) {
        let mut nearest = Nearest { squared: Lanes::splat(simd, f32::INFINITY), radius: zero };
        nearest.meet(simd, &group.centres, register, axis);
        *distance = (nearest.squared + group.centres.lanes(simd, 3, register)).max(zero).sqrt();
        least = least.min(*distance);
    }
    let reach = least + group.radii(simd, register) * 2.0 + ROUNDING;
    let mut segments = zero;
    let mut bit = 1.0;
    for distance in distances {
        let is_near = simd.less_than_or_equal_f32s(distance.values, reach.values);
        segments += Lanes::new(simd, simd.select_f32s(is_near, simd.splat_f32s(bit), zero.values));
        bit *= 2.0;
    }
    segments
}

/// The nearest model point so far of each point in a register.
struct Nearest<S: Simd> {
    /// Squared distance less the square of the point's own norm.
    squared: Lanes<S>,
    /// Radius at the model point.
    radius: Lanes<S>,
}

impl<S: Simd> Nearest<S> {
    /// Compares with the points of a segment.
    ///
    /// With `s = (f − start) · step / |step|²` and `k` the nearest whole number in range,
    /// `|f − m_k|² = |f|² − 2 f·start + |start|² − |step|² k (2 s − k)`; `|f|²` is the same for all segments.
    #[inline(always)]
    fn meet(&mut self, simd: S, points: &Block, register: usize, axis: &Axis) {
        /// Added and taken away again, this rounds a small number to the nearest whole one.
        const ROUND: f32 = 12_582_912.0;
        let (x, y) = (points.lanes(simd, 0, register), points.lanes(simd, 1, register));
        let z = points.lanes(simd, 2, register);
        let [ux, uy, uz] = Lanes::splat_point(simd, &axis.inverse_step);
        let [px, py, pz] = Lanes::splat_point(simd, &axis.minus_twice_start);
        let s = x.mul_add(ux, y.mul_add(uy, z.mul_add(uz, Lanes::splat(simd, -axis.start_in_steps))));
        let whole = (s + ROUND) - ROUND;
        let k = whole.max(Lanes::splat(simd, 0.0)).min(Lanes::splat(simd, STEPS as f32));
        let from_start = x.mul_add(px, y.mul_add(py, z.mul_add(pz, Lanes::splat(simd, axis.start_squared))));
        let gain = k * (s * 2.0 - k);
        let squared = gain.mul_add(Lanes::splat(simd, -axis.step_squared), from_start);
        let is_nearer = simd.less_than_f32s(squared.values, self.squared.values);
        let radius = k.mul_add(Lanes::splat(simd, axis.radius_step), Lanes::splat(simd, axis.radius));
        self.radius = Lanes::new(simd, simd.select_f32s(is_nearer, radius.values, self.radius.values));
        self.squared = squared.min(self.squared);
    }
}

#[cfg(test)]
pub(super) mod reference;
#[cfg(test)]
mod tests;
