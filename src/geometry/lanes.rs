//! Elementary functions of a register of `f32` numbers, for every width of register.
//!
//! Callers implement [`pulp::WithSimd`] and go through [`pulp::Arch::dispatch`], which picks the widest instruction set
//! at run time. Each lane is computed by itself, and multiplication and addition are fused only where [`Lanes::mul_add`]
//! says so, on every instruction set; so all of them give the same bits, whatever their width. Slices come in whole groups
//! of [`LANES`] numbers.

use pulp::Simd;
use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// Numbers in a group: a multiple of every register's width (AVX-512 has 16 lanes, AVX 8, NEON 4).
pub const LANES: usize = 16;

/// Numbers of a group in memory, where a register of any width can be loaded in one piece.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Group(pub [f32; LANES]);

impl Default for Group {
    fn default() -> Self {
        Self([0.0; LANES])
    }
}

impl Group {
    /// The numbers of the lanes.
    pub const NUMBERS: Self =
        Self([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);

    /// Registers that hold a group.
    pub const fn registers<S: Simd>() -> usize {
        LANES / S::F32_LANES
    }

    /// One register of the group.
    #[inline(always)]
    pub fn lanes<S: Simd>(&self, simd: S, register: usize) -> Lanes<S> {
        Lanes::new(simd, S::as_simd_f32s(&self.0).0[register])
    }

    /// Stores one register of the group.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, register: usize, lanes: Lanes<S>) {
        S::as_mut_simd_f32s(&mut self.0).0[register] = lanes.values;
    }
}

/// One register of numbers.
#[derive(Debug, Clone, Copy)]
pub struct Lanes<S: Simd> {
    simd: S,
    /// The numbers, for loads and stores.
    pub values: S::f32s,
}

impl<S: Simd> Lanes<S> {
    /// Numbers that were loaded.
    #[inline(always)]
    pub fn new(simd: S, values: S::f32s) -> Self {
        Self { simd, values }
    }

    /// The same number in each lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f32) -> Self {
        Self::new(simd, simd.splat_f32s(value))
    }

    /// A point's coordinates, the same in each lane.
    #[inline(always)]
    pub fn splat_point(simd: S, point: &[f32; 3]) -> [Self; 3] {
        [Self::splat(simd, point[0]), Self::splat(simd, point[1]), Self::splat(simd, point[2])]
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self::new(self.simd, self.simd.sqrt_f32s(self.values))
    }

    /// `self · factor + term`, rounded once. Without the instruction (older than AVX2) it is computed in software, slowly.
    #[inline(always)]
    pub fn mul_add(self, factor: Self, term: Self) -> Self {
        Self::new(self.simd, self.simd.mul_add_f32s(self.values, factor.values, term.values))
    }

    /// Absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        // `abs_f32s` is not inlined.
        let magnitude = self.simd.and_u32s(self.to_bits(), self.simd.splat_u32s(0x7fff_ffff));
        Self::from_bits(self.simd, magnitude)
    }

    /// The smaller of two numbers, neither of them NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.min_f32s(self.values, other.values))
    }

    /// The larger of two numbers, neither of them NaN.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.max_f32s(self.values, other.values))
    }

    /// The largest whole number that is not above, for numbers from −2²¹ to 2²¹.
    #[inline(always)]
    pub fn floor(self) -> Self {
        let nearest = self + SHIFT - SHIFT;
        let is_above = self.simd.less_than_f32s(self.values, nearest.values);
        (nearest - 1.0).or_else(is_above, nearest)
    }

    /// The numbers where a condition holds, others where it does not.
    #[inline(always)]
    pub fn or_else(self, condition: S::m32s, others: Self) -> Self {
        Self::new(self.simd, self.simd.select_f32s(condition, self.values, others.values))
    }

    /// The numbers whose bits these are.
    #[inline(always)]
    pub fn from_bits(simd: S, bits: S::u32s) -> Self {
        Self::new(simd, simd.transmute_f32s_u32s(bits))
    }

    #[inline(always)]
    fn to_bits(self) -> S::u32s {
        self.simd.transmute_u32s_f32s(self.values)
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident, $function:ident) => {
        impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self::new(self.simd, self.simd.$function(self.values, other.values))
            }
        }

        impl<S: Simd> $operator<f32> for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                self.$method(Self::splat(self.simd, other))
            }
        }
    };
}

operator!(Add, add, add_f32s);
operator!(Sub, sub, sub_f32s);
operator!(Mul, mul, mul_f32s);
operator!(Div, div, div_f32s);

impl<S: Simd> AddAssign for Lanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// Added to a number below 2²², this leaves the nearest integer in the low bits of the sum; taken away again, it leaves
/// that integer as a number.
const SHIFT: f32 = 12_582_912.0;

/// Sine and cosine in radians for |x| ≤ 100, to 2 · 10⁻⁷ absolute.
///
/// Reduction by multiples of π/2 in three parts (Cody and Waite), then Taylor polynomials.
#[inline(always)]
pub fn sin_cos<S: Simd>(x: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    // π/2 split so that quadrant × part is exact in f32 for the quadrants in range.
    const PART_1: f32 = 1.570_312_5;
    const PART_2: f32 = 4.837_513e-4;
    const PART_3: f32 = 7.549_79e-8;
    let simd = x.simd;
    let shifted = x * std::f32::consts::FRAC_2_PI + SHIFT;
    let quadrant = shifted - SHIFT;
    let r = ((x - quadrant * PART_1) - quadrant * PART_2) - quadrant * PART_3;
    let (s, c) = sin_cos_of_eighth(r);
    let bits = shifted.to_bits();
    let (one, two, thirty) = (simd.splat_u32s(1), simd.splat_u32s(2), simd.splat_u32s(30));
    let is_odd = simd.equal_u32s(simd.and_u32s(bits, one), one);
    let sine = simd.select_f32s(is_odd, c.values, s.values);
    let cosine = simd.select_f32s(is_odd, s.values, c.values);
    // Quadrants 2 and 3 have a negative sine, 1 and 2 a negative cosine.
    let sine_sign = simd.wrapping_dyn_shl_u32s(simd.and_u32s(bits, two), thirty);
    let cosine_sign = simd.wrapping_dyn_shl_u32s(simd.and_u32s(simd.add_u32s(bits, one), two), thirty);
    (with_sign_flipped(simd, sine, sine_sign), with_sign_flipped(simd, cosine, cosine_sign))
}

#[inline(always)]
fn with_sign_flipped<S: Simd>(simd: S, values: S::f32s, sign: S::u32s) -> Lanes<S> {
    Lanes::new(simd, simd.xor_f32s(values, simd.transmute_f32s_u32s(sign)))
}

/// Sine and cosine for |r| ≤ π/4: Taylor polynomials to the term that f32 can still see.
#[inline(always)]
fn sin_cos_of_eighth<S: Simd>(r: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let r2 = r * r;
    let s = r + r * r2 * (r2 * (r2 * (r2 * (1.0 / 362_880.0) - 1.0 / 5040.0) + 1.0 / 120.0) - 1.0 / 6.0);
    let c = r2 * (r2 * (r2 * (r2 * (1.0 / 40_320.0) - 1.0 / 720.0) + 1.0 / 24.0) - 0.5) + 1.0;
    (s, c)
}

/// A point on the unit circle for each word of random bits, uniform in direction: 23 bits place it on an eighth of the
/// circle to either side of an axis, one chooses the axis and one its direction.
#[inline(always)]
pub fn random_direction<S: Simd>(simd: S, word: S::u32s) -> (Lanes<S>, Lanes<S>) {
    let (one, two) = (simd.splat_u32s(1), simd.splat_u32s(2));
    let (s, c) = sin_cos_of_eighth((random_uniform(simd, word) - 0.5) * std::f32::consts::FRAC_PI_2);
    let sign = simd.wrapping_dyn_shl_u32s(simd.and_u32s(word, one), simd.splat_u32s(31));
    let c = with_sign_flipped(simd, c.values, sign);
    let is_second = simd.equal_u32s(simd.and_u32s(word, two), two);
    let x = simd.select_f32s(is_second, s.values, c.values);
    let y = simd.select_f32s(is_second, c.values, s.values);
    (Lanes::new(simd, x), Lanes::new(simd, y))
}

/// Uniform numbers in (0, 1) from the upper 23 bits of each word, in the middle of their interval: never 0, never 1.
#[inline(always)]
pub fn random_uniform<S: Simd>(simd: S, word: S::u32s) -> Lanes<S> {
    let mantissa = simd.wrapping_dyn_shr_u32s(word, simd.splat_u32s(9));
    // Sign and exponent of a number in [1, 2).
    let bits = simd.or_u32s(mantissa, simd.splat_u32s(0x3f80_0000));
    Lanes::from_bits(simd, bits) - (1.0 - 0.5 * f32::EPSILON)
}

/// Natural logarithm of positive, normal numbers, to 3 · 10⁻⁷ relative or absolute, whichever is larger.
///
/// `ln x = e ln 2 + 2 artanh((m − 1)/(m + 1))` with the mantissa `m` brought into [√½, √2].
#[inline(always)]
pub fn ln<S: Simd>(x: Lanes<S>) -> Lanes<S> {
    // Bits of 1, of √½, and of 2²³, whose low bits are an integer.
    const ONE: u32 = 0x3f80_0000;
    const ROOT_OF_HALF: u32 = 0x3f35_04f3;
    const INTEGER: u32 = 0x4b00_0000;
    let simd = x.simd;
    let fraction_bits = simd.splat_u32s(23);
    let bits = x.to_bits();
    // Counting from the bits of √½, the exponent field is 127 + e.
    let field = simd.wrapping_dyn_shr_u32s(simd.add_u32s(bits, simd.splat_u32s(ONE - ROOT_OF_HALF)), fraction_bits);
    let e = Lanes::from_bits(simd, simd.or_u32s(field, simd.splat_u32s(INTEGER))) - (8_388_608.0 + 127.0);
    let scale = simd.sub_u32s(simd.wrapping_dyn_shl_u32s(field, fraction_bits), simd.splat_u32s(ONE));
    let m = Lanes::from_bits(simd, simd.sub_u32s(bits, scale));
    let z = (m - 1.0) / (m + 1.0);
    let z2 = z * z;
    let series = z * (z2 * (z2 * (z2 * (z2 * (2.0 / 9.0) + 2.0 / 7.0) + 2.0 / 5.0) + 2.0 / 3.0) + 2.0);
    e * std::f32::consts::LN_2 + series
}

/// Exponential for x ≤ 0, to 2 · 10⁻⁷ relative; 0 below −87, where f32 ends.
///
/// `eˣ = 2ⁿ eʳ` with |r| ≤ ln 2 / 2, the second factor by its Taylor polynomial.
#[inline(always)]
pub fn exp<S: Simd>(x: Lanes<S>) -> Lanes<S> {
    // ln 2 split so that n × part is exact in f32.
    const PART_1: f32 = 0.693_359_4;
    const PART_2: f32 = -2.121_944_4e-4;
    const LOWEST: f32 = -87.0;
    let simd = x.simd;
    let is_zero = simd.less_than_f32s(x.values, simd.splat_f32s(LOWEST));
    let x = Lanes::new(simd, simd.select_f32s(is_zero, simd.splat_f32s(LOWEST), x.values));
    let shifted = x * std::f32::consts::LOG2_E + SHIFT;
    let n = shifted - SHIFT;
    let r = (x - n * PART_1) - n * PART_2;
    let tail = r * (r * (r * (r * (r * (1.0 / 5040.0) + 1.0 / 720.0) + 1.0 / 120.0) + 1.0 / 24.0) + 1.0 / 6.0) + 0.5;
    let fraction = (r * r) * tail + r + 1.0;
    // The bits of SHIFT leave to the left; what stays is the exponent field of 2ⁿ.
    let exponent =
        simd.wrapping_dyn_shl_u32s(simd.add_u32s(shifted.to_bits(), simd.splat_u32s(127)), simd.splat_u32s(23));
    let value = fraction * Lanes::from_bits(simd, exponent);
    Lanes::new(simd, simd.select_f32s(is_zero, simd.splat_f32s(0.0), value.values))
}

/// Sum of a function of the numbers in `f64`, in an order that does not depend on the instruction set.
#[inline(always)]
pub fn sum_of(values: &[f32], function: impl Fn(f64) -> f64) -> f64 {
    let mut partial = [0.0; LANES];
    let (groups, rest) = values.as_chunks::<LANES>();
    for group in groups {
        for i in 0..LANES {
            partial[i] += function(f64::from(group[i]));
        }
    }
    for (sum, value) in partial.iter_mut().zip(rest) {
        *sum += function(f64::from(*value));
    }
    partial.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Scalar, WithSimd};

    struct Apply<'a, F> {
        function: F,
        input: &'a [f32],
    }

    /// A function of one register, for any width of it.
    trait Function {
        fn apply<S: Simd>(&self, x: Lanes<S>) -> [Lanes<S>; 2];
    }

    impl<F: Function> WithSimd for Apply<'_, F> {
        type Output = [Vec<f32>; 2];

        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let mut out = [vec![0.0; self.input.len()], vec![0.0; self.input.len()]];
            for (k, x) in S::as_simd_f32s(self.input).0.iter().enumerate() {
                let [a, b] = self.function.apply(Lanes::new(simd, *x));
                S::as_mut_simd_f32s(&mut out[0]).0[k] = a.values;
                S::as_mut_simd_f32s(&mut out[1]).0[k] = b.values;
            }
            out
        }
    }

    /// The function's values, which must be the same bits on the widest instruction set and on none.
    fn values_of(function: impl Function + Copy, input: &[f32]) -> [Vec<f32>; 2] {
        assert!(input.len().is_multiple_of(LANES), "whole groups");
        let wide = pulp::Arch::new().dispatch(Apply { function, input });
        let narrow = Apply { function, input }.with_simd(Scalar::new());
        let bits = |values: &[Vec<f32>; 2]| values.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(&wide) == bits(&narrow), "the instruction sets differ");
        wide
    }

    macro_rules! function {
        ($name:ident, |$x:ident| $values:expr) => {
            #[derive(Clone, Copy)]
            struct $name;
            impl Function for $name {
                fn apply<S: Simd>(&self, $x: Lanes<S>) -> [Lanes<S>; 2] {
                    $values
                }
            }
        };
    }

    function!(SinCos, |x| sin_cos(x).into());
    function!(Logarithm, |x| [ln(x), x]);
    function!(Exponential, |x| [exp(x), x]);
    function!(Direction, |x| random_direction(x.simd, x.to_bits()).into());
    function!(Floor, |x| [x.floor(), x]);
    function!(Uniform, |x| [random_uniform(x.simd, x.to_bits()), x]);

    #[test]
    fn sine_and_cosine_agree_with_the_library_to_2e_7() {
        let input: Vec<f32> = (0..40_000).map(|k| (k as f32 - 20_000.0) * 0.005).collect();
        let [sine, cosine] = values_of(SinCos, &input);
        for (x, (s, c)) in input.iter().zip(sine.iter().zip(&cosine)) {
            let (exact_s, exact_c) = f64::from(*x).sin_cos();
            assert!((f64::from(*s) - exact_s).abs() < 2e-7, "sin {x}");
            assert!((f64::from(*c) - exact_c).abs() < 2e-7, "cos {x}");
        }
    }

    #[test]
    fn floors_are_those_of_the_library() {
        let mut input: Vec<f32> = (-4000..4000).map(|k| k as f32 * 0.125).collect();
        input.extend([-0.0, 1e-30, -1e-30, 0.999_999_94, 1_000_000.5, -1_000_000.5, 2_000_000.0, 479.999_97].repeat(2));
        for (x, found) in input.iter().zip(&values_of(Floor, &input)[0]) {
            assert_eq!(*found, x.floor(), "{x}");
        }
    }

    #[test]
    fn the_logarithm_agrees_with_the_library_to_3e_7() {
        let mut input: Vec<f32> = (1..40_000).map(|k| k as f32 * 2.5e-5).collect();
        input.push(f32::MIN_POSITIVE);
        for (x, found) in input.iter().zip(&values_of(Logarithm, &input)[0]) {
            let exact = f64::from(*x).ln();
            let error = (f64::from(*found) - exact).abs();
            assert!(error < 3e-7 * exact.abs().max(1.0), "ln {x}: {error}");
        }
    }

    #[test]
    fn the_exponential_agrees_with_the_library_to_2e_7_and_ends_in_zero() {
        let mut input: Vec<f32> = (0..86_000).map(|k| k as f32 * -1e-3).collect();
        input.extend([-87.5, -1e4, -1e30, f32::NEG_INFINITY].repeat(4));
        let found = &values_of(Exponential, &input)[0];
        for (x, found) in input.iter().zip(&found[..86_000]) {
            let exact = f64::from(*x).exp();
            assert!((f64::from(*found) / exact - 1.0).abs() < 2e-7, "exp {x} = {found}");
        }
        assert_eq!(found[0], 1.0);
        assert_eq!(found[86_000..], [0.0; LANES]);
    }

    #[test]
    fn directions_lie_on_the_circle_and_fill_its_quadrants_evenly() {
        // Words that step through the circle: each value of the two low bits with evenly spread upper ones.
        let words: Vec<f32> = (0..1u32 << 16).map(|k| f32::from_bits((k << 16) | (k & 3))).collect();
        let [x, y] = values_of(Direction, &words);
        let mut counts = [0; 8];
        for (x, y) in x.iter().zip(&y) {
            assert!((f64::from(*x).hypot(f64::from(*y)) - 1.0).abs() < 2e-7);
            let turn = f64::from(*y).atan2(f64::from(*x)) / std::f64::consts::TAU;
            counts[((turn + 1.0) * 8.0) as usize % 8] += 1;
        }
        assert!(counts.iter().all(|n| (8190..=8194).contains(n)), "{counts:?}");
    }

    #[test]
    fn uniforms_are_symmetric_and_never_0_or_1() {
        let bits = [0, u32::MAX, 1 << 31, (1 << 31) - 1].map(f32::from_bits);
        let mut input = [0.0; LANES];
        input[..4].copy_from_slice(&bits);
        let found = &values_of(Uniform, &input)[0];
        let half = 0.5f32.powi(24);
        assert_eq!(found[..4], [half, 1.0 - half, 0.5 + half, 0.5 - half]);
    }
}
