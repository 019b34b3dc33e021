//! Where a solid begins and ends in each column of the image.
//!
//! A solid is the convex hull of two (half) discs. In the plane of a column its extent is bounded by the ends of
//! the discs' chords in that plane and by the straight lines that touch both discs: the two generators of the side on which
//! the rays graze it, and for half cylinders the edges of the flat side. All of these are points of the solid, so the
//! extent is from the least to the greatest of those that the column meets. The disc that faces the camera and the flat
//! side are bounded in the same way.

use super::face::Faces;
use super::strip::{Rows, Strip};
use crate::geometry::camera::Intrinsics;
use crate::geometry::lanes::{Group, LANES, Lanes};
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::Vector3;
use pulp::Simd;
use std::ops::Range;

/// Rows that a solid covers in a strip of columns.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Extents {
    /// The whole solid.
    pub whole: Rows,
    /// The disc that faces the camera.
    pub disc: Rows,
    /// The flat side, when it faces the camera.
    pub flat: Rows,
}

/// A disc or half disc.
#[derive(Debug, Clone, Copy, Default)]
struct Disc {
    centre: [f32; 3],
    radius_squared: f32,
}

/// A straight edge in the image, at depth 1.
#[derive(Debug, Clone, Copy, Default)]
struct Edge {
    x: [f32; 2],
    y: f32,
    slope: f32,
}

impl Edge {
    #[inline(always)]
    fn new(a: &Vector3<f64>, b: &Vector3<f64>) -> Self {
        let (mut first, mut second) = (a / a.z, b / b.z);
        if first.x > second.x {
            std::mem::swap(&mut first, &mut second);
        }
        let across = second.x - first.x;
        // An edge along a column: its ends belong to chords or to other edges.
        let slope = if across > 1e-12 { (second.y - first.y) / across } else { 0.0 };
        Self { x: [first.x as f32, second.x as f32], y: first.y as f32, slope: slope as f32 }
    }
}

/// Most edges: two grazed generators, four sides of the flat side.
const MAX_EDGES: usize = 6;

/// What bounds a solid.
#[derive(Debug, Clone, Default)]
pub struct Outline {
    columns: Range<usize>,
    axis: [f32; 3],
    discs: [Disc; 2],
    dome: Option<[f32; 3]>,
    edges: [Edge; MAX_EDGES],
    grazed: usize,
    /// The edges of the flat side follow those that are grazed.
    edge_count: usize,
    facing: Option<usize>,
    shows_flat: bool,
}

impl Outline {
    /// The outline of a solid with these faces.
    #[inline(always)]
    pub fn new(solid: &TaperedCylinder, faces: &Faces, camera: &Intrinsics, width: usize) -> Self {
        let axis = solid.axis();
        let centres = [solid.start, solid.end];
        let mut discs = [Disc::default(); 2];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..2 {
            let (centre, radius) = (&centres[k], solid.radii[k]);
            discs[k] = Disc { centre: f32s(centre), radius_squared: (radius * radius) as f32 };
            let [first, last] = disc_columns(centre, radius, &axis);
            low = low.min(first);
            high = high.max(last);
        }
        let column = |x: f64| x.clamp(0.0, width as f64) as usize;
        let first = column((camera.cx + camera.fx * low).ceil());
        let end = column((camera.cx + camera.fx * high).floor() + 1.0);
        let mut outline = Self {
            columns: first..end.max(first),
            axis: f32s(&axis),
            discs,
            dome: solid.dome.map(|dome| f32s(&dome)),
            edges: [Edge::default(); MAX_EDGES],
            grazed: 0,
            edge_count: 0,
            facing: faces.disc,
            shows_flat: faces.shows_flat,
        };
        outline.add_grazed_generators(solid, &axis);
        outline.grazed = outline.edge_count;
        outline.add_flat_edges(solid, &axis);
        outline
    }

    #[inline(always)]
    fn add_edge(&mut self, a: &Vector3<f64>, b: &Vector3<f64>) {
        self.edges[self.edge_count] = Edge::new(a, b);
        self.edge_count += 1;
    }

    /// The tangent plane of the generator in direction `e` from the axis holds the camera when `e·p = κ p·u − r0`.
    #[inline(always)]
    fn add_grazed_generators(&mut self, solid: &TaperedCylinder, axis: &Vector3<f64>) {
        let along = solid.start.dot(axis);
        let slope = (solid.radii[1] - solid.radii[0]) / solid.length();
        let across = solid.start - axis * along;
        let distance = across.norm();
        let cosine = (slope * along - solid.radii[0]) / distance;
        if cosine.is_nan() || cosine.abs() >= 1.0 {
            return;
        }
        let sine = (1.0 - cosine * cosine).sqrt();
        let from_camera = across / distance;
        let sideways = axis.cross(&from_camera);
        for sine in [-sine, sine] {
            let direction = from_camera * cosine + sideways * sine;
            if solid.dome.is_none_or(|dome| dome.dot(&direction) >= 0.0) {
                self.add_edge(&(solid.start + direction * solid.radii[0]), &(solid.end + direction * solid.radii[1]));
            }
        }
    }

    #[inline(always)]
    fn add_flat_edges(&mut self, solid: &TaperedCylinder, axis: &Vector3<f64>) {
        let Some(dome) = solid.dome else { return };
        let sideways = axis.cross(&dome);
        let corner = |centre: Vector3<f64>, reach: f64| centre + sideways * reach;
        let [a, b] = [corner(solid.start, solid.radii[0]), corner(solid.start, -solid.radii[0])];
        let [c, d] = [corner(solid.end, solid.radii[1]), corner(solid.end, -solid.radii[1])];
        for (from, to) in [(&a, &c), (&b, &d), (&a, &b), (&c, &d)] {
            self.add_edge(from, to);
        }
    }

    /// Strips that hold the columns that the solid may cover.
    #[inline(always)]
    pub fn strips(&self) -> Range<usize> {
        self.columns.start / LANES..self.columns.end.div_ceil(LANES)
    }

    /// Computes the extents in a strip.
    #[inline(always)]
    pub fn trace<S: Simd>(&self, simd: S, strip: &Strip) -> Extents {
        let mut traced = Extents::default();
        for register in 0..Group::registers::<S>() {
            let [whole, disc, flat] = self.extents(simd, strip.x(simd, register));
            set_rows(&mut traced.whole, register, strip.rows(simd, whole));
            if self.facing.is_some() {
                set_rows(&mut traced.disc, register, strip.rows(simd, disc));
            }
            if self.shows_flat {
                set_rows(&mut traced.flat, register, strip.rows(simd, flat));
            }
        }
        traced
    }

    /// Extents of the solid, of its disc and of its flat side in columns, at depth 1.
    #[inline(always)]
    fn extents<S: Simd>(&self, simd: S, x: Lanes<S>) -> [[Lanes<S>; 2]; 3] {
        let nothing = [Lanes::splat(simd, f32::INFINITY), Lanes::splat(simd, f32::NEG_INFINITY)];
        let (mut whole, mut disc, mut flat) = (nothing, nothing, nothing);
        for k in 0..2 {
            let chord = self.chord(simd, x, &self.discs[k]);
            include(&mut whole, &chord);
            if self.facing == Some(k) {
                disc = chord;
            }
        }
        for (k, edge) in self.edges[..self.edge_count].iter().enumerate() {
            let place = crossing(simd, x, edge);
            include(&mut whole, &place);
            if k >= self.grazed && self.shows_flat {
                include(&mut flat, &place);
            }
        }
        [whole, disc, flat]
    }

    /// The chord of a disc in the plane of each column, as the least and the greatest y at depth 1.
    ///
    /// The plane's normal is N = (1, 0, −x). The chord runs along u × N; its middle lies `N·centre / |N_d|` from the
    /// centre, with N_d the part of N in the disc's plane.
    #[inline(always)]
    fn chord<S: Simd>(&self, simd: S, x: Lanes<S>, disc: &Disc) -> [Lanes<S>; 2] {
        let [ux, uy, uz] = Lanes::splat_point(simd, &self.axis);
        let [cx, cy, cz] = Lanes::splat_point(simd, &disc.centre);
        let zero = Lanes::splat(simd, 0.0);
        let normal_along = ux - x * uz;
        // The tiny term keeps the division finite for a disc in the column's plane.
        let in_plane = x * x + Lanes::splat(simd, 1.0 + 1e-12) - normal_along * normal_along;
        let offset = cx - x * cz;
        let share = offset / in_plane;
        let remaining = Lanes::splat(simd, disc.radius_squared) - offset * share;
        let is_met = simd.less_than_or_equal_f32s(zero.values, remaining.values);
        let norm = in_plane.max(Lanes::splat(simd, 1e-12)).sqrt();
        let half = remaining.max(zero).sqrt();
        // Middle of the chord and its direction; their x follows from y and z.
        let turned = share * normal_along;
        let (y, z) = (cy + turned * uy, cz + share * x + turned * uz);
        let rise = uz + ux * x;
        let (along_y, along_z) = (rise / norm, zero - uy / norm);
        let (mut from, mut to) = (zero - half, half);
        let mut is_seen = is_met;
        if let Some(dome) = self.dome {
            let [gx, gy, gz] = Lanes::splat_point(simd, &dome);
            let height = share * (x * gz - gx);
            let gain = (rise * gy - uy * (x * gx + gz)) / norm;
            let level = (zero - height) / gain;
            let rises = simd.less_than_f32s(zero.values, gain.values);
            from = Lanes::new(simd, simd.select_f32s(rises, from.max(level).values, from.values));
            to = Lanes::new(simd, simd.select_f32s(rises, to.values, to.min(level).values));
            is_seen = simd.and_m32s(is_seen, simd.less_than_or_equal_f32s(from.values, to.values));
        }
        let a = (y + from * along_y) / (z + from * along_z);
        let b = (y + to * along_y) / (z + to * along_z);
        let [none_low, none_high] = [Lanes::splat(simd, f32::INFINITY), Lanes::splat(simd, f32::NEG_INFINITY)];
        [
            Lanes::new(simd, simd.select_f32s(is_seen, a.min(b).values, none_low.values)),
            Lanes::new(simd, simd.select_f32s(is_seen, a.max(b).values, none_high.values)),
        ]
    }
}

#[inline(always)]
fn set_rows<S: Simd>(rows: &mut Rows, register: usize, lanes: [Lanes<S>; 2]) {
    rows[0].set(register, lanes[0]);
    rows[1].set(register, lanes[1]);
}

/// Widens an extent so that it holds another one.
#[inline(always)]
fn include<S: Simd>(extent: &mut [Lanes<S>; 2], other: &[Lanes<S>; 2]) {
    extent[0] = extent[0].min(other[0]);
    extent[1] = extent[1].max(other[1]);
}

/// Where columns meet an edge; nothing where they do not.
#[inline(always)]
fn crossing<S: Simd>(simd: S, x: Lanes<S>, edge: &Edge) -> [Lanes<S>; 2] {
    let is_met = simd.and_m32s(
        simd.less_than_or_equal_f32s(Lanes::splat(simd, edge.x[0]).values, x.values),
        simd.less_than_or_equal_f32s(x.values, Lanes::splat(simd, edge.x[1]).values),
    );
    let y = (x - Lanes::splat(simd, edge.x[0])).mul_add(Lanes::splat(simd, edge.slope), Lanes::splat(simd, edge.y));
    [
        Lanes::new(simd, simd.select_f32s(is_met, y.values, Lanes::splat(simd, f32::INFINITY).values)),
        Lanes::new(simd, simd.select_f32s(is_met, y.values, Lanes::splat(simd, f32::NEG_INFINITY).values)),
    ]
}

/// Least and greatest x at depth 1 of a disc in front of the camera.
///
/// The planes `x = const` that touch it fulfil `(N·c)² = r² (|N|² − (N·u)²)`, a quadratic in x.
#[inline(always)]
fn disc_columns(centre: &Vector3<f64>, radius: f64, axis: &Vector3<f64>) -> [f64; 2] {
    let squared = radius * radius;
    let a = centre.z * centre.z - squared * (1.0 - axis.z * axis.z);
    let b = centre.x * centre.z + squared * axis.x * axis.z;
    let c = centre.x * centre.x - squared * (1.0 - axis.x * axis.x);
    let root = (b * b - a * c).max(0.0).sqrt();
    [(b - root) / a, (b + root) / a]
}

fn f32s(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}
