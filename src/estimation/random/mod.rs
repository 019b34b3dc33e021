//! Reproducible streams of random numbers, one stream for each frame.
//!
//! A stream is ChaCha8 keyed by the seed and numbered by the frame, so a frame's numbers do not depend on how many
//! were drawn before it, nor on threads. A generator that is only a function of its counter needs no order either: as
//! many blocks are computed at once as a register has lanes. The words are those of `rand_chacha`, in batches of
//! sixteen blocks, first word of each block first.

use crate::geometry::lanes::{LANES, Lanes, ln, random_direction, random_uniform};
use pulp::{Simd, WithSimd};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Words of a block, and double rounds (a column round and a diagonal one) of ChaCha8.
const BLOCK_WORDS: usize = 16;
const DOUBLE_ROUNDS: usize = 4;

/// Words of a batch: sixteen blocks, one for each lane of a group.
const BATCH: usize = BLOCK_WORDS * LANES;

/// Source of random numbers of one run.
#[derive(Debug, Clone)]
pub struct RandomStreams {
    key: [u32; 8],
    frame: u64,
    /// Next block of the frame's stream.
    block: u32,
    /// Normal numbers for those who need few, and how many of them are used.
    normals: [f32; BATCH],
    used: usize,
    arch: pulp::Arch,
}

impl RandomStreams {
    /// Streams of a seed.
    pub fn new(seed: u64) -> Self {
        let bytes = ChaCha8Rng::seed_from_u64(seed).get_seed();
        let word = |i: usize| u32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
        Self {
            key: std::array::from_fn(word),
            frame: 0,
            block: 0,
            normals: [0.0; BATCH],
            used: BATCH,
            arch: pulp::Arch::new(),
        }
    }

    /// Goes to the start of a frame's stream.
    pub fn start_frame(&mut self, frame: u64) {
        self.frame = frame;
        self.block = 0;
        self.used = BATCH;
    }

    /// A standard normal number. Costs little: 256 are drawn at once.
    pub fn normal(&mut self) -> f64 {
        if self.used == BATCH {
            let mut normals = self.normals;
            self.fill_normal(&mut normals);
            self.normals = normals;
            self.used = 0;
        }
        self.used += 1;
        f64::from(self.normals[self.used - 1])
    }

    /// Fills a slice with independent standard normal numbers (Box and Muller, 23-bit radius: tails to 5.7 SD).
    pub fn fill_normal(&mut self, out: &mut [f32]) {
        self.fill(out, Distribution::Normal);
    }

    /// Fills a slice with independent exponential numbers of mean 1.
    pub fn fill_exponential(&mut self, out: &mut [f32]) {
        self.fill(out, Distribution::Exponential);
    }

    fn fill(&mut self, out: &mut [f32], distribution: Distribution) {
        let blocks = out.len().div_ceil(BATCH) * LANES;
        let (key, stream, first_block) = (self.key, self.frame, self.block);
        self.arch.dispatch(Fill { key, stream, first_block, distribution, out });
        self.block += blocks as u32;
    }
}

#[derive(Debug, Clone, Copy)]
enum Distribution {
    Normal,
    Exponential,
}

/// Numbers from consecutive blocks of a stream, for any instruction set.
struct Fill<'a> {
    key: [u32; 8],
    stream: u64,
    first_block: u32,
    distribution: Distribution,
    out: &'a mut [f32],
}

impl WithSimd for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (batches, rest) = self.out.as_chunks_mut::<BATCH>();
        let mut block = self.first_block;
        for batch in batches {
            fill_batch(simd, &self.key, self.stream, block, self.distribution, batch);
            block += LANES as u32;
        }
        if !rest.is_empty() {
            let mut batch = [0.0; BATCH];
            fill_batch(simd, &self.key, self.stream, block, self.distribution, &mut batch);
            rest.copy_from_slice(&batch[..rest.len()]);
        }
    }
}

/// Numbers of the sixteen blocks from `block` on. Row `r` of the batch holds what word `r` of each block became.
#[inline(always)]
fn fill_batch<S: Simd>(
    simd: S,
    key: &[u32; 8],
    stream: u64,
    block: u32,
    distribution: Distribution,
    batch: &mut [f32; BATCH],
) {
    const HALF: usize = BLOCK_WORDS / 2;
    let registers = LANES / S::F32_LANES;
    let out = S::as_mut_simd_f32s(batch).0;
    for part in 0..registers {
        let words = chacha8(simd, key, stream, lane_numbers::<S>(simd, block, part));
        for row in 0..HALF {
            let (first, second) = match distribution {
                Distribution::Normal => normal_pair(simd, words[row], words[HALF + row]),
                Distribution::Exponential => (exponential(simd, words[row]), exponential(simd, words[HALF + row])),
            };
            out[row * registers + part] = first.values;
            out[(HALF + row) * registers + part] = second.values;
        }
    }
}

/// Numbers of the blocks in a part of a group's lanes.
#[inline(always)]
fn lane_numbers<S: Simd>(simd: S, first: u32, part: usize) -> S::u32s {
    const NUMBERS: [u32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
    simd.add_u32s(simd.splat_u32s(first), S::as_simd_u32s(&NUMBERS).0[part])
}

/// ChaCha8 (D. J. Bernstein, 2008) of one block in each lane: word `i` of every block.
#[inline(always)]
fn chacha8<S: Simd>(simd: S, key: &[u32; 8], stream: u64, block: S::u32s) -> [S::u32s; BLOCK_WORDS] {
    // "expand 32-byte k"
    const CONSTANTS: [u32; 4] = [0x6170_7865, 0x3320_646e, 0x7962_2d32, 0x6b20_6574];
    let mut start = [simd.splat_u32s(0); BLOCK_WORDS];
    for (word, value) in start.iter_mut().zip(CONSTANTS.iter().chain(key)) {
        *word = simd.splat_u32s(*value);
    }
    start[12] = block;
    start[14] = simd.splat_u32s(stream as u32);
    start[15] = simd.splat_u32s((stream >> 32) as u32);
    let mut state = start;
    for _ in 0..DOUBLE_ROUNDS {
        for column in 0..4 {
            quarter_round(simd, &mut state, [column, 4 + column, 8 + column, 12 + column]);
        }
        for column in 0..4 {
            let diagonal = [column, 4 + (column + 1) % 4, 8 + (column + 2) % 4, 12 + (column + 3) % 4];
            quarter_round(simd, &mut state, diagonal);
        }
    }
    for (word, first) in state.iter_mut().zip(start) {
        *word = simd.add_u32s(*word, first);
    }
    state
}

#[inline(always)]
fn quarter_round<S: Simd>(simd: S, state: &mut [S::u32s; BLOCK_WORDS], [a, b, c, d]: [usize; 4]) {
    for (sum, other, turned, bits) in [(a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)] {
        state[sum] = simd.add_u32s(state[sum], state[other]);
        let mixed = simd.xor_u32s(state[turned], state[sum]);
        let left = simd.wrapping_dyn_shl_u32s(mixed, simd.splat_u32s(bits));
        let right = simd.wrapping_dyn_shr_u32s(mixed, simd.splat_u32s(32 - bits));
        state[turned] = simd.or_u32s(left, right);
    }
}

/// Two independent normal numbers from two words: a radius and a direction.
#[inline(always)]
fn normal_pair<S: Simd>(simd: S, radius: S::u32s, direction: S::u32s) -> (Lanes<S>, Lanes<S>) {
    let radius = (ln(random_uniform(simd, radius)) * -2.0).sqrt();
    let (x, y) = random_direction(simd, direction);
    (radius * x, radius * y)
}

#[inline(always)]
fn exponential<S: Simd>(simd: S, word: S::u32s) -> Lanes<S> {
    ln(random_uniform(simd, word)) * -1.0
}

#[cfg(test)]
mod tests;
