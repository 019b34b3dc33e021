//! Random numbers that are a function of where they are asked for: noise that sticks to a surface, or to the image.

/// Uniform number in [0, 1) of a lattice point (SplitMix64's finaliser over the mixed coordinates).
pub(super) fn lattice(seed: u64, x: i64, y: i64, z: i64) -> f64 {
    let mut word = seed
        ^ (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(21)
        ^ (z as u64).wrapping_mul(0x1656_67b1_9e37_79f9).rotate_left(42);
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((word ^ (word >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Smooth noise in [0, 1] with cells of size 1: lattice numbers, interpolated.
pub(super) fn smooth(seed: u64, [x, y, z]: [f64; 3]) -> f64 {
    let cell = [x.floor(), y.floor(), z.floor()];
    let part = [x - cell[0], y - cell[1], z - cell[2]].map(smoothstep);
    let mut sum = 0.0;
    for corner in 0..8 {
        let step = [corner & 1, (corner >> 1) & 1, corner >> 2];
        let weight: f64 = (0..3).map(|k| if step[k] == 1 { part[k] } else { 1.0 - part[k] }).product();
        if weight > 0.0 {
            let at = |k: usize| cell[k] as i64 + step[k] as i64;
            sum += weight * lattice(seed, at(0), at(1), at(2));
        }
    }
    sum
}

/// Smooth step from 0 at `u = 0` to 1 at `u = 1`, level at both ends and beyond.
pub(super) fn smoothstep(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattice_numbers_are_uniform_and_differ_between_seeds() {
        let n = 20_000;
        let numbers: Vec<f64> = (0..n).map(|k| lattice(7, k % 31, k / 31, k % 7)).collect();
        let mean = numbers.iter().sum::<f64>() / n as f64;
        let variance = numbers.iter().map(|u| (u - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.01 && (variance - 1.0 / 12.0).abs() < 0.003, "{mean} {variance}");
        assert_ne!(lattice(1, 2, 3, 4), lattice(2, 2, 3, 4));
    }

    #[test]
    fn smooth_noise_is_the_lattice_at_its_points_and_continuous_between() {
        assert!((smooth(3, [2.0, -1.0, 5.0]) - lattice(3, 2, -1, 5)).abs() < 1e-12);
        for k in 0..200 {
            let at = |x: f64| smooth(3, [x, 0.3, 0.7]);
            let x = -2.0 + 0.02 * f64::from(k);
            assert!((at(x + 1e-6) - at(x)).abs() < 1e-5);
        }
    }
}
