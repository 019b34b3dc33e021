//! Reproducible streams of standard normal numbers, one stream for each frame.
//!
//! A stream is ChaCha8 keyed by the seed and numbered by the frame, so a frame's numbers do not depend on how many
//! were drawn before it, nor on threads.

use crate::geometry::lanes::{LANES, Lanes, ln, sin_cos};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Source of random numbers of one run.
#[derive(Debug, Clone)]
pub struct RandomStreams {
    rng: ChaCha8Rng,
    bits: Vec<u8>,
    arch: pulp::Arch,
}

impl RandomStreams {
    /// Streams of a seed.
    pub fn new(seed: u64) -> Self {
        Self { rng: ChaCha8Rng::seed_from_u64(seed), bits: Vec::new(), arch: pulp::Arch::new() }
    }

    /// Goes to the start of a frame's stream.
    pub fn start_frame(&mut self, frame: u64) {
        self.rng.set_stream(frame);
        self.rng.set_word_pos(0);
    }

    /// A uniform number in the open interval (0, 1).
    pub fn uniform(&mut self) -> f64 {
        // 52 bits and a half: never 0, never 1.
        ((self.rng.next_u64() >> 12) as f64 + 0.5) * 2f64.powi(-52)
    }

    /// A standard normal number.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Fills a slice with independent standard normal numbers (Box and Muller, 24-bit uniforms: tails to 5.8 SD).
    ///
    /// # Panics
    /// When the length is not a multiple of [`LANES`].
    pub fn fill_normal(&mut self, out: &mut [f32]) {
        assert!(out.len().is_multiple_of(LANES), "particles come in groups of {LANES}");
        // One pair of uniforms makes a pair of normals; an odd group draws one group more.
        let groups = out.len() / LANES;
        let drawn = groups.next_multiple_of(2) * LANES;
        self.bits.resize(4 * drawn, 0);
        self.rng.fill_bytes(&mut self.bits);
        self.arch.dispatch(BoxMuller { bits: &self.bits, out });
    }
}

/// The transform of all drawn bits, to be compiled for each instruction set (a closure is not compiled into the function
/// that has the instruction set's features).
struct BoxMuller<'a> {
    bits: &'a [u8],
    out: &'a mut [f32],
}

impl pulp::NullaryFnOnce for BoxMuller<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (pair, bits) in self.bits.chunks_exact(8 * LANES).enumerate() {
            let (u, v) = bits.split_at(4 * LANES);
            let (a, b) = normal_pair(&uniform_lanes(u), &uniform_lanes(v));
            let start = 2 * pair * LANES;
            self.out[start..start + LANES].copy_from_slice(&a);
            if let Some(second) = self.out.get_mut(start + LANES..start + 2 * LANES) {
                second.copy_from_slice(&b);
            }
        }
    }
}

/// Sixteen uniforms in (0, 1) from 64 random bytes: 24 bits and a half each.
#[inline(always)]
fn uniform_lanes(bytes: &[u8]) -> Lanes {
    let mut out = [0.0; LANES];
    for (i, value) in out.iter_mut().enumerate() {
        let word = u32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
        // The shift leaves 24 bits, which fit an i32: its conversion is a single vector instruction, that of a u32 is not.
        *value = ((word >> 8) as i32 as f32 + 0.5) * (1.0 / 16_777_216.0);
    }
    out
}

#[inline(always)]
fn normal_pair(u: &Lanes, v: &Lanes) -> (Lanes, Lanes) {
    let log = ln(u);
    let mut angle = [0.0; LANES];
    for i in 0..LANES {
        angle[i] = v[i] * std::f32::consts::TAU;
    }
    let (sine, cosine) = sin_cos(&angle);
    let (mut a, mut b) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        // The uniform next to 1 rounds to 1, whose logarithm is 0: the maximum keeps the root's argument positive.
        let radius = (-2.0 * log[i]).max(0.0).sqrt();
        a[i] = radius * cosine[i];
        b[i] = radius * sine[i];
    }
    (a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_have_mean_0_variance_1_and_normal_tails() {
        let mut streams = RandomStreams::new(7);
        let mut values = vec![0.0; 1 << 20];
        streams.fill_normal(&mut values);
        let n = values.len() as f64;
        let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
        let variance = values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / n;
        let beyond = values.iter().filter(|v| v.abs() > 3.0).count() as f64 / n;
        // Standard errors for a million numbers: 0.001, 0.0014 and 0.00005; the bounds are 5 of them.
        assert!(mean.abs() < 0.005 && (variance - 1.0).abs() < 0.007, "mean {mean}, variance {variance}");
        assert!((beyond - 0.0027).abs() < 0.00025, "{beyond} beyond 3 SD");
    }

    #[test]
    fn a_frame_has_the_same_numbers_whatever_was_drawn_before() {
        let mut a = RandomStreams::new(3);
        let mut b = RandomStreams::new(3);
        b.start_frame(4);
        b.fill_normal(&mut [0.0; 48]);
        let (mut from_a, mut from_b) = ([0.0; 32], [0.0; 32]);
        a.start_frame(9);
        b.start_frame(9);
        a.fill_normal(&mut from_a);
        b.fill_normal(&mut from_b);
        assert_eq!(from_a, from_b);
        b.start_frame(10);
        b.fill_normal(&mut from_b);
        assert_ne!(from_a, from_b);
    }

    #[test]
    fn an_odd_number_of_groups_is_filled_to_the_end() {
        let mut values = [f32::NAN; 3 * LANES];
        RandomStreams::new(1).fill_normal(&mut values);
        assert!(values.iter().all(|v| v.is_finite()));
    }
}
