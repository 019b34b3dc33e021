//! Resampling of particles: who descends from whom.

use super::random::RandomStreams;
use crate::geometry::lanes::{LANES, sum_of};

/// Scheme of resampling.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resampling {
    /// Independent draws (\[angles\]).
    Multinomial,
    /// One draw, evenly spaced: less variance for the same cost.
    Systematic,
}

/// Draws generations; keeps its scratch between them.
#[derive(Debug, Clone)]
pub struct Resampler {
    scheme: Resampling,
    spacings: Vec<f32>,
    ancestors: Vec<u32>,
}

impl Resampler {
    /// A resampler of `count` particles. Until the first draw each particle descends from itself.
    pub fn new(scheme: Resampling, count: usize) -> Self {
        let spacings = (count + 1).next_multiple_of(LANES);
        Self { scheme, spacings: vec![0.0; spacings], ancestors: (0..count as u32).collect() }
    }

    /// Ancestor of each particle, in ascending order.
    pub fn ancestors(&self) -> &[u32] {
        &self.ancestors
    }

    /// Lets each particle descend from itself.
    pub fn keep_all(&mut self) {
        for (i, ancestor) in self.ancestors.iter_mut().enumerate() {
            *ancestor = i as u32;
        }
    }

    /// Draws the ancestor of each particle with probability in proportion to the weights, which need not be normalised
    /// but hold at least one positive number.
    ///
    /// Ordered uniforms come without sorting: the partial sums of n + 1 exponential numbers, divided by their total,
    /// are distributed as n sorted uniforms.
    pub fn draw(&mut self, weights: &[f32], streams: &mut RandomStreams) {
        let n = self.ancestors.len();
        let total = sum_of(weights, |w| w);
        let Some(last) = weights.iter().rposition(|w| *w > 0.0) else { return self.keep_all() };
        let spread = match self.scheme {
            Resampling::Multinomial => {
                streams.fill_exponential(&mut self.spacings);
                total / sum_of(&self.spacings[..=n], |s| s)
            }
            Resampling::Systematic => {
                streams.fill_exponential(&mut self.spacings[..1]);
                let start = (-f64::from(self.spacings[0])).exp();
                self.spacings.fill(1.0);
                self.spacings[0] = start as f32;
                total / n as f64
            }
        };
        let mut parent = 0;
        let mut cumulative = f64::from(weights[0]);
        let mut place = 0.0;
        for (ancestor, spacing) in self.ancestors.iter_mut().zip(&self.spacings) {
            place += f64::from(*spacing);
            // Rounding may put the last place on the total: the last particle with a weight takes it.
            while cumulative <= place * spread && parent < last {
                parent += 1;
                cumulative += f64::from(weights[parent]);
            }
            *ancestor = parent as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WEIGHTS: [f32; 4] = [0.5, 0.0, 0.3, 0.2];
    const ROUNDS: u32 = 20_000;

    /// Number of offspring of each particle, round by round.
    fn offspring(scheme: Resampling) -> Vec<[f64; 4]> {
        let mut streams = RandomStreams::new(11);
        let mut resampler = Resampler::new(scheme, 4);
        let mut round = |frame: u32| {
            streams.start_frame(u64::from(frame));
            resampler.draw(&WEIGHTS, &mut streams);
            assert!(resampler.ancestors().is_sorted());
            let mut counts = [0.0; 4];
            for ancestor in resampler.ancestors() {
                counts[*ancestor as usize] += 1.0;
            }
            counts
        };
        (0..ROUNDS).map(&mut round).collect()
    }

    #[test]
    fn offspring_are_in_proportion_to_the_weights_in_both_schemes() {
        for scheme in [Resampling::Multinomial, Resampling::Systematic] {
            for (particle, weight) in WEIGHTS.into_iter().enumerate() {
                let share = offspring(scheme).iter().map(|n| n[particle]).sum::<f64>() / f64::from(ROUNDS) / 4.0;
                // The standard error of a share over 80 000 draws is at most 0.0018.
                assert!((share - f64::from(weight)).abs() < 0.009, "{scheme:?}: {particle} has {share}");
            }
        }
    }

    #[test]
    fn multinomial_offspring_vary_as_independent_draws_do() {
        let rounds = offspring(Resampling::Multinomial);
        let moment = |f: &dyn Fn(&[f64; 4]) -> f64| rounds.iter().map(f).sum::<f64>() / f64::from(ROUNDS);
        for (particle, weight) in WEIGHTS.map(f64::from).into_iter().enumerate() {
            let variance = moment(&|n| (n[particle] - 4.0 * weight).powi(2));
            // n w (1 − w), to 5 standard errors of a variance over 20 000 rounds.
            assert!((variance - 4.0 * weight * (1.0 - weight)).abs() < 0.05, "{particle}: {variance}");
        }
        let covariance = moment(&|n| (n[0] - 2.0) * (n[2] - 1.2));
        assert!((covariance + 4.0 * 0.5 * 0.3).abs() < 0.05, "{covariance}");
    }

    #[test]
    fn systematic_offspring_are_within_one_of_their_expectation() {
        for counts in offspring(Resampling::Systematic) {
            for (n, weight) in counts.iter().zip(WEIGHTS) {
                assert!((n - 4.0 * f64::from(weight)).abs() < 1.0, "{counts:?}");
            }
        }
    }

    #[test]
    fn a_single_heavy_particle_has_all_the_offspring() {
        let mut resampler = Resampler::new(Resampling::Multinomial, 3);
        resampler.draw(&[0.0, 1.0, 0.0], &mut RandomStreams::new(1));
        assert_eq!(resampler.ancestors(), [1; 3]);
    }

    #[test]
    fn without_any_weight_each_particle_descends_from_itself() {
        let mut resampler = Resampler::new(Resampling::Multinomial, 3);
        resampler.draw(&[0.0, 1.0, 0.0], &mut RandomStreams::new(1));
        resampler.draw(&[0.0; 3], &mut RandomStreams::new(1));
        assert_eq!(resampler.ancestors(), [0, 1, 2]);
    }
}
