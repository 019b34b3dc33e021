//! Counts of positive numbers on a logarithmic scale: quantiles of a stream in constant memory.

/// Ratio of a bin's upper to its lower edge; a quantile is right within half of it, 1 %.
const RATIO: f64 = 1.02;

/// Counts from `low` to `high`; what lies outside counts at the nearer end.
#[derive(Debug, Clone)]
pub(super) struct LogHistogram {
    low: f64,
    counts: Vec<u64>,
    n: u64,
}

impl LogHistogram {
    pub(super) fn new(low: f64, high: f64) -> Self {
        let n_bins = ((high / low).ln() / RATIO.ln()).ceil() as usize;
        Self { low, counts: vec![0; n_bins.max(1)], n: 0 }
    }

    pub(super) fn push(&mut self, value: f64) {
        // A cast from a negative or infinite number ends at the nearest bin.
        let bin = ((value / self.low).ln() / RATIO.ln()) as usize;
        let last = self.counts.len() - 1;
        self.counts[bin.min(last)] += 1;
        self.n += 1;
    }

    pub(super) fn n(&self) -> u64 {
        self.n
    }

    /// Middle of the bin that holds quantile `q`; nothing without any value.
    pub(super) fn quantile(&self, q: f64) -> Option<f64> {
        let rank = (q * self.n as f64) as u64;
        self.bins()
            .scan(0, |below, (middle, count)| {
                *below += count;
                Some((middle, *below))
            })
            .find(|(_, up_to_here)| *up_to_here > rank.min(self.n.saturating_sub(1)))
            .map(|(middle, _)| middle)
    }

    /// Middle and count of every bin, lowest first.
    pub(super) fn bins(&self) -> impl Iterator<Item = (f64, u64)> + '_ {
        let middle = |bin: usize| self.low * RATIO.powf(bin as f64 + 0.5);
        self.counts.iter().enumerate().map(move |(bin, count)| (middle(bin), *count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_within_one_percent() {
        let mut histogram = LogHistogram::new(1e-3, 1e4);
        assert_eq!(histogram.quantile(0.5), None);
        (1..=1001).for_each(|i| histogram.push(f64::from(i)));
        for (q, expected) in [(0.0, 1.0), (0.5, 501.0), (0.9, 901.0), (1.0, 1001.0)] {
            let found = histogram.quantile(q).unwrap();
            assert!((found / expected - 1.0).abs() < 0.0101, "{q}: {found}");
        }
    }

    #[test]
    fn numbers_beyond_the_ends_count_at_the_ends() {
        let mut histogram = LogHistogram::new(1.0, 10.0);
        [0.0, -1.0, f64::INFINITY, 1e9].into_iter().for_each(|value| histogram.push(value));
        let ends: Vec<u64> = histogram.bins().map(|(_, count)| count).filter(|count| *count > 0).collect();
        assert_eq!((ends, histogram.n()), (vec![2, 2], 4));
    }
}
