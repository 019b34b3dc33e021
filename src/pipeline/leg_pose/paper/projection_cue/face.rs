//! The faces of a solid that a camera can see: the side, one of the discs, the flat side.
//!
//! A pixel's ray is `z · d` with `d = (x, y, 1)`. On every face
//!
//! ```text
//! z = c / (B·d + √(dᵀ M d))
//!
//! side   with s = p·u, σ = r0 − κ s (radius at the camera's place along the axis), κ = (r1 − r0) / length:
//!        B = p − (s − κ σ) u,  c = |p|² − s² − σ²,  M = B Bᵀ − c (I − (1 + κ²) u uᵀ)
//! plane  B = normal,  c = normal · point,  M = 0
//! ```
//!
//! The first is the nearer root of the cone's quadratic in the form that does not cancel.

use super::outline::Strip;
use crate::geometry::lanes::Lanes;
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::{Matrix3, Vector3};
use pulp::Simd;

/// Depth on one face.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Face {
    c: f64,
    linear: Vector3<f64>,
    quadratic: Matrix3<f64>,
}

impl Face {
    fn plane(normal: Vector3<f64>, point: &Vector3<f64>) -> Self {
        Self { c: normal.dot(point), linear: normal, quadratic: Matrix3::zeros() }
    }

    fn side(solid: &TaperedCylinder, axis: &Vector3<f64>) -> Option<Self> {
        let start = solid.start;
        let slope = (solid.radii[1] - solid.radii[0]) / solid.length();
        let along = start.dot(axis);
        let radius_at_camera = solid.radii[0] - slope * along;
        let c = start.norm_squared() - along * along - radius_at_camera * radius_at_camera;
        if !c.is_finite() || (c <= 0.0 && radius_at_camera >= 0.0) {
            // The camera looks from within the cone that the solid is cut from: only discs can be seen.
            return None;
        }
        let linear = start - axis * (along - slope * radius_at_camera);
        let quadratic =
            linear * linear.transpose() - (Matrix3::identity() - axis * axis.transpose() * (1.0 + slope * slope)) * c;
        Some(Self { c, linear, quadratic })
    }

    /// The face in a register of a strip's columns.
    #[inline(always)]
    pub fn in_columns<S: Simd>(&self, simd: S, register: usize, strip: &Strip) -> FaceInColumns<S> {
        let x = strip.x(simd, register);
        let (b, m) = (&self.linear, &self.quadratic);
        let [bx, by, bz] = Lanes::splat_point(simd, &[b.x as f32, b.y as f32, b.z as f32]);
        let [xx, yy, zz] = Lanes::splat_point(simd, &[m.m11 as f32, m.m22 as f32, m.m33 as f32]);
        let [xy, xz, yz] = Lanes::splat_point(simd, &[m.m12 as f32, m.m13 as f32, m.m23 as f32]);
        FaceInColumns {
            c: Lanes::splat(simd, self.c as f32),
            b: [x.mul_add(bx, bz), by],
            e: [x.mul_add(x.mul_add(xx, xz + xz), zz), x.mul_add(xy + xy, yz + yz), yy],
            y: strip.y(simd),
            zero: Lanes::splat(simd, 0.0),
        }
    }
}

/// Depth in a register of columns.
pub trait DepthInColumns<S: Simd> {
    /// Depth at a row of the image, metres.
    fn depth(&self, row: Lanes<S>) -> Lanes<S>;
}

/// A face in a register of columns: `z = c / (b0 + b1 y + √(e0 + e1 y + e2 y²))`.
#[derive(Debug, Clone, Copy)]
pub struct FaceInColumns<S: Simd> {
    c: Lanes<S>,
    b: [Lanes<S>; 2],
    e: [Lanes<S>; 3],
    /// y of the first row and from row to row, at depth 1.
    y: [Lanes<S>; 2],
    zero: Lanes<S>,
}

impl<S: Simd> DepthInColumns<S> for FaceInColumns<S> {
    #[inline(always)]
    fn depth(&self, row: Lanes<S>) -> Lanes<S> {
        let y = row.mul_add(self.y[1], self.y[0]);
        let squared = y.mul_add(y.mul_add(self.e[2], self.e[1]), self.e[0]);
        self.c / (y.mul_add(self.b[1], self.b[0]) + squared.max(self.zero).sqrt())
    }
}

/// Which face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FaceKind {
    /// The side of the (half) cone.
    #[default]
    Side,
    /// The disc that faces the camera.
    Disc,
    /// The flat side of a half cylinder.
    Flat,
}

/// The faces of one solid.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Faces {
    by_kind: [Face; 3],
    /// True when the side can be seen.
    pub shows_side: bool,
    /// Which disc faces the camera: 0 at the start, 1 at the end.
    pub disc: Option<usize>,
    /// True when the flat side faces the camera.
    pub shows_flat: bool,
}

impl Faces {
    /// The faces of a solid.
    #[inline(always)]
    pub fn new(solid: &TaperedCylinder) -> Self {
        let axis = solid.axis();
        let side = Face::side(solid, &axis);
        // A disc faces the camera (the origin) when its outward normal points back to it; at most one does.
        let disc = match (solid.start.dot(&axis) > 0.0, solid.end.dot(&axis) < 0.0) {
            (true, _) => Some(0),
            (_, true) => Some(1),
            _ => None,
        };
        let centre = if disc == Some(0) { &solid.start } else { &solid.end };
        // Seen from below, where the dome is on the other side.
        let flat = solid.dome.map(|dome| dome.into_inner()).filter(|dome| dome.dot(&solid.start) > 0.0);
        Self {
            shows_side: side.is_some(),
            disc,
            shows_flat: flat.is_some(),
            by_kind: [
                side.unwrap_or_default(),
                Face::plane(axis, centre),
                flat.map_or_else(Face::default, |normal| Face::plane(normal, &solid.start)),
            ],
        }
    }

    /// One of the faces.
    #[inline(always)]
    pub fn face(&self, kind: FaceKind) -> &Face {
        &self.by_kind[kind as usize]
    }
}
