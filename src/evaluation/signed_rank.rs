//! Wilcoxon's signed-rank test: are paired differences centred at zero?
//!
//! Differences of zero are left out, equal sizes share their mean rank. With `n` differences left and groups of `t`
//! equal sizes, the sum of the ranks of the positive ones is nearly normal under the null hypothesis:
//!
//! ```text
//! mean = n (n + 1) / 4        variance = n (n + 1)(2 n + 1) / 24 − Σ (t³ − t) / 48
//! ```
//!
//! Up to [`EXACT_UP_TO`] differences the probability is exact: all 2ⁿ signs of the given ranks are counted. The smallest
//! that `n` differences can reach is 2 / 2ⁿ, so fewer than six can never be significant at 0.05.

use statrs::distribution::{ContinuousCDF, Normal};

/// Most differences whose probability is counted instead of approximated.
pub const EXACT_UP_TO: usize = 25;

/// Result of the test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedRank {
    /// Differences that are not zero.
    pub n: usize,
    /// Sum of the ranks of the positive differences.
    pub positive_rank_sum: f64,
    /// Standardised rank sum (\[angles\] calls it W): positive when the differences tend to be positive.
    pub z: f64,
    /// Two-sided probability of a rank sum at least as far from its mean: exact up to [`EXACT_UP_TO`] differences, by
    /// the normal approximation above.
    pub p: f64,
}

/// Tests finite differences; none when all are zero.
pub fn signed_rank(differences: &[f64]) -> Option<SignedRank> {
    let mut sorted: Vec<f64> = differences.iter().copied().filter(|d| d.is_finite() && *d != 0.0).collect();
    sorted.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = sorted.len();
    let mut positive_rank_sum = 0.0;
    let mut ties = 0.0;
    let mut doubled_ranks = Vec::new();
    let mut start = 0;
    for group in sorted.chunk_by(|a, b| a.abs() == b.abs()) {
        let size = group.len() as f64;
        // Mean of the ranks start + 1 … start + size.
        let rank = start as f64 + (size + 1.0) / 2.0;
        positive_rank_sum += rank * group.iter().filter(|d| **d > 0.0).count() as f64;
        ties += size.powi(3) - size;
        if n <= EXACT_UP_TO {
            // Means of whole numbers: twice a rank is whole.
            doubled_ranks.extend(std::iter::repeat_n(2 * start + group.len() + 1, group.len()));
        }
        start += group.len();
    }
    let count = n as f64;
    let variance = count * (count + 1.0) * (2.0 * count + 1.0) / 24.0 - ties / 48.0;
    if variance <= 0.0 {
        return None;
    }
    let z = (positive_rank_sum - count * (count + 1.0) / 4.0) / variance.sqrt();
    let p = if n <= EXACT_UP_TO {
        exact_probability(&doubled_ranks, (2.0 * positive_rank_sum) as usize)
    } else {
        (2.0 * Normal::standard().sf(z.abs())).min(1.0)
    };
    Some(SignedRank { n, positive_rank_sum, z, p })
}

/// Two-sided probability of a sum of positive ranks when every sign is as likely as the other; all sums are doubled.
fn exact_probability(doubled_ranks: &[usize], doubled_sum: usize) -> f64 {
    let most: usize = doubled_ranks.iter().sum();
    // ways[s]: assignments of signs whose positive ranks sum to s. At most 2^25: exact in f64.
    let mut ways = vec![0.0; most + 1];
    ways[0] = 1.0;
    let mut reached = 0;
    for rank in doubled_ranks {
        reached += rank;
        for sum in (*rank..=reached).rev() {
            ways[sum] += ways[sum - rank];
        }
    }
    let low: f64 = ways[..=doubled_sum].iter().sum();
    let high: f64 = ways[doubled_sum..].iter().sum();
    (2.0 * low.min(high) / ways.iter().sum::<f64>()).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_paired_differences_give_the_ranks_computed_by_hand() {
        // Without the zero, sizes 5 5 7 9 10 12 15 17 20 have ranks 1.5 1.5 3 4 5 6 7 8 9; 5, 5, 15, 17 and 20 are
        // positive: 27. The mean is 9 · 10 / 4 = 22.5, the variance 9 · 10 · 19 / 24 − 6 / 48 = 71.125.
        let found = signed_rank(&[15.0, -7.0, 5.0, 20.0, 0.0, -9.0, 17.0, -12.0, 5.0, -10.0]).unwrap();
        assert_eq!(found.n, 9);
        assert_eq!(found.positive_rank_sum, 27.0);
        assert!((found.z - 4.5 / 71.125f64.sqrt()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn few_differences_have_the_probability_that_counting_the_signs_gives() {
        // Of the 2⁶ signs only one gives a rank sum of 21, and one of 0: 2 / 64.
        let all_positive = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert!((signed_rank(&all_positive).unwrap().p - 2.0 / 64.0).abs() < 1e-15);
        // Sums of at most 3 from ranks 1 to 5: {}, 1, 2, 3, 1 + 2: 2 · 5 / 32.
        let found = signed_rank(&[-1.0, -2.0, 3.0, -4.0, -5.0]).unwrap();
        assert!((found.p - 10.0 / 32.0).abs() < 1e-15, "{found:?}");
        // Equal sizes have rank 2 each; positive sum 2: at most one positive, 4 of 8 signs, so twice that is all.
        assert!((signed_rank(&[1.0, -1.0, -1.0]).unwrap().p - 1.0).abs() < 1e-15);
    }

    #[test]
    fn counting_and_the_normal_approximation_agree_for_many_differences() {
        let differences: Vec<f64> = (1..=25).map(|i| if i % 3 == 0 { -f64::from(i) } else { f64::from(i) }).collect();
        let exact = signed_rank(&differences).unwrap();
        let normal = 2.0 * Normal::standard().sf(exact.z.abs());
        // Without a correction for continuity the approximation is half a rank off: 0.5 × density ≈ 0.004 to each side.
        assert!((exact.p - normal).abs() < 1e-2, "{exact:?} against {normal}");
    }

    #[test]
    fn mirrored_differences_mirror_the_statistic() {
        let differences = [3.0, -1.0, 4.0, 1.0, -5.0, 9.0, 2.0, 6.0];
        let mirrored = differences.map(|d: f64| -d);
        let (a, b) = (signed_rank(&differences).unwrap(), signed_rank(&mirrored).unwrap());
        assert!((a.z + b.z).abs() < 1e-12 && (a.p - b.p).abs() < 1e-12 && a.z > 0.0);
    }

    #[test]
    fn differences_of_zero_have_no_test() {
        assert_eq!(signed_rank(&[0.0, 0.0]), None);
        assert_eq!(signed_rank(&[]), None);
    }
}
