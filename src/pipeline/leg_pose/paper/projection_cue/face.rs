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

use super::strip::{Span, Strip};
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
    /// Of the side: A = dᵀ (I − (1 + κ²) u uᵀ) d, which `(B·d)² − dᵀ M d = c A` holds for.
    pub divisor: Matrix3<f64>,
}

impl Face {
    fn plane(normal: Vector3<f64>, point: &Vector3<f64>) -> Self {
        Self { c: normal.dot(point), linear: normal, ..Self::default() }
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
        let divisor = Matrix3::identity() - axis * axis.transpose() * (1.0 + slope * slope);
        let quadratic = linear * linear.transpose() - divisor * c;
        Some(Self { c, linear, quadratic, divisor })
    }

    /// The face in a register of a strip's columns.
    #[inline(always)]
    pub fn in_columns<S: Simd>(&self, simd: S, register: usize, strip: &Strip, span: &Span) -> FaceInColumns<S> {
        let x = strip.x(simd, register);
        let (b, [y, reach]) = (&self.linear, span.y);
        let splat = |value: f64| Lanes::splat(simd, value as f32);
        FaceInColumns {
            constant: splat(self.c),
            linear: [x.mul_add(splat(b.x), splat(b.y * y + b.z)), splat(b.y * reach)],
            quadratic: quadratic_in_columns(simd, &self.quadratic, x, span),
            span: span.lanes(simd),
            zero: splat(0.0),
        }
    }
}

/// `dᵀ M d` for the rays of columns at x, by powers of a span's `t`, constant first.
#[inline(always)]
pub fn quadratic_in_columns<S: Simd>(simd: S, m: &Matrix3<f64>, x: Lanes<S>, span: &Span) -> [Lanes<S>; 3] {
    let [y, reach] = span.y;
    let [square, across, constant] = Lanes::splat_point(
        simd,
        &[m.m11 as f32, (2.0 * (m.m12 * y + m.m13)) as f32, ((m.m22 * y + 2.0 * m.m23) * y + m.m33) as f32],
    );
    let [mixed, first, second] = Lanes::splat_point(
        simd,
        &[(2.0 * m.m12 * reach) as f32, (2.0 * reach * (m.m22 * y + m.m23)) as f32, (m.m22 * reach * reach) as f32],
    );
    [x.mul_add(x.mul_add(square, across), constant), x.mul_add(mixed, first), second]
}

/// Depth in a register of columns.
pub trait DepthInColumns<S: Simd> {
    /// Depth at a row of the image, metres.
    fn depth(&self, row: Lanes<S>) -> Lanes<S>;
}

/// A face in a register of columns: `z = c / (b0 + b1 t + √(e0 + e1 t + e2 t²))`.
#[derive(Debug, Clone, Copy)]
pub struct FaceInColumns<S: Simd> {
    constant: Lanes<S>,
    /// b: B·d by powers of `t`.
    pub linear: [Lanes<S>; 2],
    /// e: dᵀ M d by powers of `t`.
    pub quadratic: [Lanes<S>; 3],
    span: [Lanes<S>; 2],
    zero: Lanes<S>,
}

impl<S: Simd> DepthInColumns<S> for FaceInColumns<S> {
    #[inline(always)]
    fn depth(&self, row: Lanes<S>) -> Lanes<S> {
        let t = row.mul_add(self.span[1], self.span[0]);
        let [e0, e1, e2] = self.quadratic;
        let squared = t.mul_add(t.mul_add(e2, e1), e0);
        self.constant / (t.mul_add(self.linear[1], self.linear[0]) + squared.max(self.zero).sqrt())
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
