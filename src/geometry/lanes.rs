//! Elementary functions of sixteen `f32` numbers at once, written so that the compiler turns them into vector code.
//!
//! Callers wrap their loops in [`pulp::Arch::dispatch`], which picks the widest instruction set at run time. No fused
//! multiply-add is used, so every instruction set gives the same bits.

/// Numbers handled together: one AVX-512 register, two AVX ones, four SSE ones.
pub const LANES: usize = 16;

/// Sixteen numbers.
pub type Lanes = [f32; LANES];

/// Applies a function to each lane.
#[inline(always)]
pub fn map(a: &Lanes, f: impl Fn(f32) -> f32) -> Lanes {
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        out[i] = f(a[i]);
    }
    out
}

/// Combines two sets of lanes.
#[inline(always)]
pub fn zip(a: &Lanes, b: &Lanes, f: impl Fn(f32, f32) -> f32) -> Lanes {
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        out[i] = f(a[i], b[i]);
    }
    out
}

/// Nearest integer by the addition of 1.5 · 2²³, valid for |x| < 2²²; a call to `round` would not become vector code.
#[inline(always)]
fn nearest_integer(x: f32) -> f32 {
    const SHIFT: f32 = 12_582_912.0;
    (x + SHIFT) - SHIFT
}

/// Sine and cosine in radians for |x| ≤ 100, to 2 · 10⁻⁷ absolute.
///
/// Reduction by multiples of π/2 in three parts (Cody and Waite), then Taylor polynomials to the term that f32 can
/// still see on ±π/4.
#[inline(always)]
pub fn sin_cos(x: &Lanes) -> (Lanes, Lanes) {
    // π/2 split so that quadrant × part is exact in f32 for the quadrants in range.
    const PART_1: f32 = 1.570_312_5;
    const PART_2: f32 = 4.837_513e-4;
    const PART_3: f32 = 7.549_79e-8;
    let (mut sine, mut cosine) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        let quadrant = nearest_integer(x[i] * std::f32::consts::FRAC_2_PI);
        let r = ((x[i] - quadrant * PART_1) - quadrant * PART_2) - quadrant * PART_3;
        let r2 = r * r;
        let s = r + r * r2 * (-1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (-1.0 / 5040.0 + r2 * (1.0 / 362_880.0))));
        let c = 1.0 + r2 * (-0.5 + r2 * (1.0 / 24.0 + r2 * (-1.0 / 720.0 + r2 * (1.0 / 40_320.0))));
        let q = quadrant as i32;
        let (a, b) = if q & 1 == 0 { (s, c) } else { (c, s) };
        sine[i] = if q & 2 == 0 { a } else { -a };
        cosine[i] = if (q + 1) & 2 == 0 { b } else { -b };
    }
    (sine, cosine)
}

/// Natural logarithm of positive, normal numbers, to 3 · 10⁻⁷ relative or absolute, whichever is larger.
///
/// `ln x = e ln 2 + 2 artanh((m − 1)/(m + 1))` with the mantissa `m` brought into [√½, √2].
#[inline(always)]
pub fn ln(x: &Lanes) -> Lanes {
    map(x, |x| {
        let bits = x.to_bits();
        // Subtracting the bits of √½ makes the exponent field count from there.
        let shifted = bits.wrapping_sub(0x3f35_04f3) as i32 >> 23;
        let m = f32::from_bits(bits.wrapping_sub((shifted << 23) as u32));
        let z = (m - 1.0) / (m + 1.0);
        let z2 = z * z;
        let series = z * (2.0 + z2 * (2.0 / 3.0 + z2 * (2.0 / 5.0 + z2 * (2.0 / 7.0 + z2 * (2.0 / 9.0)))));
        shifted as f32 * std::f32::consts::LN_2 + series
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_agree_with_the_library_to_2e_7() {
        for k in 0..40_000 {
            let x = [(k as f32 - 20_000.0) * 0.005; LANES];
            let (s, c) = sin_cos(&x);
            let (exact_s, exact_c) = f64::from(x[0]).sin_cos();
            assert!((f64::from(s[3]) - exact_s).abs() < 2e-7, "sin {}", x[0]);
            assert!((f64::from(c[3]) - exact_c).abs() < 2e-7, "cos {}", x[0]);
        }
    }

    #[test]
    fn the_logarithm_agrees_with_the_library_to_3e_7() {
        for k in 1..40_000 {
            let x = k as f32 * 2.5e-5;
            let exact = f64::from(x).ln();
            let error = (f64::from(ln(&[x; LANES])[7]) - exact).abs();
            assert!(error < 3e-7 * exact.abs().max(1.0), "ln {x}: {error}");
        }
        assert!((ln(&[f32::MIN_POSITIVE; LANES])[0] - f32::MIN_POSITIVE.ln()).abs() < 1e-4);
    }
}
