use super::*;
use pulp::Scalar;
use rand::Rng;
use statrs::distribution::{ContinuousCDF, Exp, Normal};

/// A million numbers of one stream.
const COUNT: usize = 1 << 20;

fn drawn(seed: u64, fill: impl Fn(&mut RandomStreams, &mut [f32])) -> Vec<f64> {
    let mut values = vec![0.0; COUNT];
    fill(&mut RandomStreams::new(seed), &mut values);
    values.into_iter().map(f64::from).collect()
}

fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    values.sum::<f64>() / COUNT as f64
}

/// Largest distance between the numbers' distribution and the exact one (Kolmogorov and Smirnov), times √n.
fn kolmogorov_distance(mut values: Vec<f64>, exact: &impl ContinuousCDF<f64, f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let distance = |(i, value): (usize, &f64)| (exact.cdf(*value) - (i as f64 + 0.5) / n).abs() + 0.5 / n;
    values.iter().enumerate().map(distance).fold(0.0, f64::max) * n.sqrt()
}

#[test]
fn the_words_are_those_of_rand_chacha() {
    let (seed, frame) = (7, 0x0123_4567_89ab_cdef);
    let mut reference = ChaCha8Rng::seed_from_u64(seed);
    reference.set_stream(frame);
    let mut blocks = [0u32; 2 * BATCH];
    blocks.fill_with(|| reference.next_u32());
    let simd = Scalar::new();
    for block in 0..2 * LANES {
        let words = chacha8(simd, &RandomStreams::new(seed).key, frame, block as u32);
        assert_eq!(words, blocks[BLOCK_WORDS * block..][..BLOCK_WORDS], "block {block}");
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let key = RandomStreams::new(5).key;
    for distribution in [Distribution::Normal, Distribution::Exponential] {
        let (mut wide, mut narrow) = ([0.0; 3 * BATCH / 2], [0.0; 3 * BATCH / 2]);
        let fill = |out| Fill { key, stream: 3, first_block: 16, distribution, out };
        pulp::Arch::new().dispatch(fill(&mut wide));
        fill(&mut narrow).with_simd(Scalar::new());
        assert_eq!(wide.map(f32::to_bits), narrow.map(f32::to_bits));
    }
}

#[test]
fn normals_have_the_moments_and_tails_of_the_normal_distribution() {
    let values = drawn(7, RandomStreams::fill_normal);
    // Moments 1 to 4 and 6 and the variance of their estimates, (E x²ᵏ − (E xᵏ)²) / n; the bounds are 5 standard errors.
    for (power, exact, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0), (6, 15.0, 10_170.0)]
    {
        let found = mean_of(values.iter().map(|v| v.powi(power)));
        let bound = 5.0 * (variance / COUNT as f64).sqrt();
        assert!((found - exact).abs() < bound, "moment {power}: {found}");
    }
    let normal = Normal::standard();
    for beyond in [2.0, 3.0, 4.0, 4.5] {
        for sign in [-1.0, 1.0] {
            let expected = COUNT as f64 * normal.sf(beyond);
            let found = values.iter().filter(|v| sign * **v > beyond).count() as f64;
            // 5 standard errors of a count.
            assert!((found - expected).abs() < 5.0 * expected.sqrt(), "{found} beyond {sign} x {beyond}: {expected}");
        }
    }
}

#[test]
fn normals_and_exponentials_pass_the_test_of_kolmogorov_and_smirnov() {
    // 1.95 is exceeded once in a thousand seeds; the seeds are fixed.
    for seed in 0..4 {
        let normal = kolmogorov_distance(drawn(seed, RandomStreams::fill_normal), &Normal::standard());
        assert!(normal < 1.95, "seed {seed}: normal {normal}");
        let exponential = drawn(seed, RandomStreams::fill_exponential);
        let exponential = kolmogorov_distance(exponential, &Exp::new(1.0).expect("a rate"));
        assert!(exponential < 1.95, "seed {seed}: exponential {exponential}");
    }
}

#[test]
fn numbers_of_a_pair_of_neighbouring_lanes_rows_and_batches_are_independent() {
    let values = drawn(3, RandomStreams::fill_normal);
    // Neighbouring lanes, neighbouring rows, both numbers of a pair, and the same place in the next batch. Numbers that
    // depend on each other through their size alone are uncorrelated; their squares are not.
    for lag in [1, LANES, BATCH / 2, BATCH] {
        let pairs = || values.iter().zip(values.iter().cycle().skip(lag));
        let products = mean_of(pairs().map(|(a, b)| a * b));
        let squares = mean_of(pairs().map(|(a, b)| (a * a - 1.0) * (b * b - 1.0)));
        // Standard errors 1 / √n and 2 / √n.
        let bound = 5.0 / (COUNT as f64).sqrt();
        assert!(products.abs() < bound && squares.abs() < 2.0 * bound, "lag {lag}: {products}, {squares}");
    }
}

#[test]
fn each_lane_and_row_has_mean_0_and_variance_1() {
    let values = drawn(9, RandomStreams::fill_normal);
    let per_place = (COUNT / BATCH) as f64;
    for place in 0..BATCH {
        let here = || values.iter().skip(place).step_by(BATCH);
        let mean = here().sum::<f64>() / per_place;
        let variance = here().map(|v| v * v).sum::<f64>() / per_place;
        // 4.5 standard errors; 512 such numbers exceed 4.5 in 0.3 % of the seeds, and the seed is fixed.
        assert!(mean.abs() < 4.5 / per_place.sqrt(), "place {place}: mean {mean}");
        assert!((variance - 1.0).abs() < 4.5 * (2.0 / per_place).sqrt(), "place {place}: variance {variance}");
    }
}

#[test]
fn a_frame_has_the_same_numbers_whatever_was_drawn_before() {
    let mut a = RandomStreams::new(3);
    let mut b = RandomStreams::new(3);
    b.start_frame(4);
    b.fill_normal(&mut [0.0; 48]);
    b.normal();
    let (mut from_a, mut from_b) = ([0.0; 32], [0.0; 32]);
    a.start_frame(9);
    b.start_frame(9);
    a.fill_normal(&mut from_a);
    b.fill_normal(&mut from_b);
    assert_eq!(from_a, from_b);
    assert_eq!(a.normal(), b.normal());
    b.start_frame(10);
    b.fill_normal(&mut from_b);
    assert_ne!(from_a, from_b);
}

#[test]
fn no_number_is_drawn_twice_in_a_frame() {
    let mut streams = RandomStreams::new(1);
    let (mut first, mut second) = ([f32::NAN; BATCH + 3], [f32::NAN; BATCH]);
    streams.fill_normal(&mut first);
    streams.fill_normal(&mut second);
    let single: Vec<f32> = (0..BATCH).map(|_| streams.normal() as f32).collect();
    assert!(first.iter().chain(&second).chain(&single).all(|v| v.is_finite()));
    assert_ne!(first[..BATCH], second);
    assert_ne!(first[BATCH..], second[..3]);
    assert_ne!(second[..], single[..]);
}
