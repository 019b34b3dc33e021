//! Depth of a solid's side in a strip of columns, without a division.
//!
//! With A = dᵀ (I − (1 + κ²) u uᵀ) d the nearer root of the cone's quadratic is also
//!
//! ```text
//! z = (B·d − √D) / A        D = dᵀ M d; A is the squared sine of the angle between ray and axis, nearly
//! ```
//!
//! Along a column `B·d` is linear and D quadratic, and 1/A is smooth wherever the ray does not run along the side. So 1/A is a
//! polynomial of degree 4 in `t`, which goes from −1 to 1 over the rows of the strip, equal to it at the zeros of the
//! Chebyshev polynomial of degree 5. How true it is, is measured at three more places; where it is not true enough, the face
//! itself is used.

use super::face::{DepthInColumns, Face, quadratic_in_columns};
use super::strip::{Rows, Span, Strip};
use crate::geometry::lanes::{Group, LANES, Lanes};
use pulp::Simd;

/// Coefficients of the polynomial, constant first.
const TERMS: usize = 5;

/// Cosines of 18° and 54°: with 0, where the polynomial equals 1/A.
const OUTER: f32 = 0.951_056_5;
const INNER: f32 = 0.587_785_25;
/// Places and what lies between them, where the polynomial differs most.
const CHECKED: [f32; 3] = [-1.0, 0.809_017, 1.0];
/// Largest difference there, as a share of 1/A: a tenth of a raw step at 0.9 m.
const TOLERANCE: f32 = 2.5e-4;

/// A side in a strip of columns.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Side {
    /// B·d and D by powers of `t`, constant first.
    linear: [Group; 2],
    quadratic: [Group; 3],
    /// 1/A by powers of `t`.
    inverse: [Group; TERMS],
    span: Span,
}

impl Side {
    /// Fits the side in the rows of a strip. False when 1/A is no polynomial in one of the columns.
    #[inline(always)]
    pub fn fit<S: Simd>(&mut self, simd: S, face: &Face, strip: &Strip, span: &Span, rows: &Rows) -> bool {
        self.span = *span;
        let mut worst = Group::default();
        for register in 0..Group::registers::<S>() {
            let in_columns = face.in_columns(simd, register, strip, span);
            set(&mut self.linear, register, &in_columns.linear);
            set(&mut self.quadratic, register, &in_columns.quadratic);
            let divisor = quadratic_in_columns(simd, &face.divisor, strip.x(simd, register), span);
            let inverse = inverse(simd, &divisor);
            set(&mut self.inverse, register, &inverse);
            let (mut error, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
            for t in CHECKED {
                let t = Lanes::splat(simd, t);
                error = error.max((quartic(&inverse, t) * quadratic_at(&divisor, t) - one).abs());
            }
            worst.set(register, error);
        }
        let mut untrue = 0;
        for lane in 0..LANES {
            // Nothing that is not a number is less.
            let is_true = worst.0[lane] < TOLERANCE || rows[0].0[lane] >= rows[1].0[lane];
            untrue += u32::from(!is_true);
        }
        untrue == 0
    }

    /// A register of the columns.
    #[inline(always)]
    pub fn in_columns<S: Simd>(&self, simd: S, register: usize) -> SideInColumns<S> {
        let zero = Lanes::splat(simd, 0.0);
        let mut side = SideInColumns {
            linear: [zero; 2],
            quadratic: [zero; 3],
            inverse: [zero; TERMS],
            span: self.span.lanes(simd),
            zero,
        };
        get(&mut side.linear, register, &self.linear, simd);
        get(&mut side.quadratic, register, &self.quadratic, simd);
        get(&mut side.inverse, register, &self.inverse, simd);
        side
    }
}

#[inline(always)]
fn set<S: Simd>(groups: &mut [Group], register: usize, lanes: &[Lanes<S>]) {
    for (group, lanes) in groups.iter_mut().zip(lanes) {
        group.set(register, *lanes);
    }
}

#[inline(always)]
fn get<S: Simd>(lanes: &mut [Lanes<S>], register: usize, groups: &[Group], simd: S) {
    for (lanes, group) in lanes.iter_mut().zip(groups) {
        *lanes = group.lanes(simd, register);
    }
}

/// A side in a register of columns.
#[derive(Debug, Clone, Copy)]
pub struct SideInColumns<S: Simd> {
    linear: [Lanes<S>; 2],
    quadratic: [Lanes<S>; 3],
    inverse: [Lanes<S>; TERMS],
    span: [Lanes<S>; 2],
    zero: Lanes<S>,
}

impl<S: Simd> DepthInColumns<S> for SideInColumns<S> {
    #[inline(always)]
    fn depth(&self, row: Lanes<S>) -> Lanes<S> {
        let t = row.mul_add(self.span[1], self.span[0]);
        let root = quadratic_at(&self.quadratic, t).max(self.zero).sqrt();
        (t.mul_add(self.linear[1], self.linear[0]) - root) * quartic(&self.inverse, t)
    }
}

/// The polynomial that equals the inverse of a quadratic at five places.
#[inline(always)]
fn inverse<S: Simd>(simd: S, divisor: &[Lanes<S>; 3]) -> [Lanes<S>; TERMS] {
    let one = Lanes::splat(simd, 1.0);
    let (a, b) = (one / quadratic_at(divisor, one * OUTER), one / quadratic_at(divisor, one * -OUTER));
    let (c, d) = (one / quadratic_at(divisor, one * INNER), one / quadratic_at(divisor, one * -INNER));
    let centre = one / divisor[0];
    // Even and odd part at both distances from the middle; each gives two coefficients by two equations.
    let even_outer = ((a + b) * 0.5 - centre) * (1.0 / (OUTER * OUTER));
    let even_inner = ((c + d) * 0.5 - centre) * (1.0 / (INNER * INNER));
    let (odd_outer, odd_inner) = ((a - b) * (0.5 / OUTER), (c - d) * (0.5 / INNER));
    let between = 1.0 / (OUTER * OUTER - INNER * INNER);
    let (fourth, third) = ((even_outer - even_inner) * between, (odd_outer - odd_inner) * between);
    let second = even_inner - fourth * (INNER * INNER);
    let first = odd_inner - third * (INNER * INNER);
    [centre, first, second, third, fourth]
}

#[inline(always)]
fn quartic<S: Simd>(coefficients: &[Lanes<S>; TERMS], t: Lanes<S>) -> Lanes<S> {
    let [c0, c1, c2, c3, c4] = *coefficients;
    c4.mul_add(t, c3).mul_add(t, c2).mul_add(t, c1).mul_add(t, c0)
}

#[inline(always)]
fn quadratic_at<S: Simd>(coefficients: &[Lanes<S>; 3], t: Lanes<S>) -> Lanes<S> {
    let [c0, c1, c2] = *coefficients;
    c2.mul_add(t, c1).mul_add(t, c0)
}
