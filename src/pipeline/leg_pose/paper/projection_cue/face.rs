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

use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::{Matrix3, Vector3};

/// Depth on one face.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Face {
    c: f64,
    linear: Vector3<f64>,
    quadratic: Matrix3<f64>,
}

/// A face along a column: `z = c / (b0 + b1 k + √(e0 + e1 k + e2 k²))` at the k-th row from a first one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FaceInColumn {
    /// Numerator.
    pub c: f32,
    /// Linear part of the denominator.
    pub b: [f32; 2],
    /// Under the root.
    pub e: [f32; 3],
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

    /// The numerator `c`.
    #[inline(always)]
    pub fn constant_f32(&self) -> f32 {
        self.c as f32
    }

    /// B.
    #[inline(always)]
    pub fn linear_f32(&self) -> [f32; 3] {
        [self.linear.x as f32, self.linear.y as f32, self.linear.z as f32]
    }

    /// The upper triangle of M: xx, xy, xz; yy, yz, zz.
    #[inline(always)]
    pub fn quadratic_f32(&self) -> [[f32; 3]; 2] {
        let m = &self.quadratic;
        [[m[(0, 0)] as f32, m[(0, 1)] as f32, m[(0, 2)] as f32], [m[(1, 1)] as f32, m[(1, 2)] as f32, m[(2, 2)] as f32]]
    }

    /// The face in the column at x, from the row at y on, rows `pitch` apart (x, y and pitch at depth 1).
    #[inline(always)]
    pub fn in_column(&self, x: f64, y: f64, pitch: f64) -> FaceInColumn {
        let (b, m) = (&self.linear, &self.quadratic);
        let across = m[(0, 1)] * x + m[(1, 2)];
        let constant = (m[(0, 0)] * x + 2.0 * m[(0, 2)]) * x + m[(2, 2)];
        FaceInColumn {
            c: self.c as f32,
            b: [(b.x * x + b.y * y + b.z) as f32, (b.y * pitch) as f32],
            e: [
                (constant + (2.0 * across + m[(1, 1)] * y) * y) as f32,
                (2.0 * (across + m[(1, 1)] * y) * pitch) as f32,
                (m[(1, 1)] * pitch * pitch) as f32,
            ],
        }
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
