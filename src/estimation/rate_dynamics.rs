//! A rate that decays and is driven by white acceleration, over one interval.
//!
//! ```text
//! x' = x ⊞ a v + w_x      a = τ (1 − e^{−Δt/τ})
//! v' = b v + w_v          b = e^{−Δt/τ}
//! cov(w_x, w_v) = q ∫₀^Δt [τ (1 − e^{−u/τ}), e^{−u/τ}]ᵀ [τ (1 − e^{−u/τ}), e^{−u/τ}] du
//! ```
//!
//! An Ornstein–Uhlenbeck rate and its integral: exact for any interval, and two intervals make one.

/// Coefficients of one interval. The variances are those of an acceleration of spectral density 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateStep {
    /// How far a rate of 1 leads (`a`), seconds.
    pub reach: f64,
    /// What is left of a rate (`b`).
    pub decay: f64,
    /// Variance added to the posture.
    pub to_posture: f64,
    /// Covariance added between posture and rate.
    pub to_both: f64,
    /// Variance added to the rate.
    pub to_rate: f64,
}

/// Share of the time constant under which the series `s³/3 − s⁴/4` replaces a difference of numbers near 3: there both are
/// exact to seven digits.
const SMALL_SHARE: f64 = 1e-3;

impl RateStep {
    /// The step over an interval; none and negative ones change nothing.
    pub fn over(interval_s: f64, rate_decay_s: f64) -> Self {
        let s = interval_s.max(0.0) / rate_decay_s;
        let gone = -(-s).exp_m1();
        let integral = if s < SMALL_SHARE {
            s.powi(3) * (1.0 / 3.0 - 0.25 * s)
        } else {
            0.5 * (2.0 * s - 3.0 + 4.0 * (-s).exp() - (-2.0 * s).exp())
        };
        Self {
            reach: rate_decay_s * gone,
            decay: (-s).exp(),
            to_posture: rate_decay_s.powi(3) * integral,
            to_both: 0.5 * rate_decay_s.powi(2) * gone.powi(2),
            to_rate: -0.5 * rate_decay_s * (-2.0 * s).exp_m1(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn two_intervals_make_one(first in 0.0..2.0f64, second in 0.0..2.0f64, decay in 0.1..3.0f64) {
            let (f, s) = (RateStep::over(first, decay), RateStep::over(second, decay));
            let both = RateStep::over(first + second, decay);
            let posture = f.to_posture + 2.0 * s.reach * f.to_both + s.reach.powi(2) * f.to_rate + s.to_posture;
            let mixed = s.decay * (f.to_both + s.reach * f.to_rate) + s.to_both;
            prop_assert!((f.decay * s.decay - both.decay).abs() < 1e-12);
            prop_assert!((f.reach + f.decay * s.reach - both.reach).abs() < 1e-12);
            prop_assert!((posture - both.to_posture).abs() < 1e-12 * decay.powi(3).max(1.0));
            prop_assert!((mixed - both.to_both).abs() < 1e-12 * decay.powi(2).max(1.0));
            prop_assert!((s.decay.powi(2) * f.to_rate + s.to_rate - both.to_rate).abs() < 1e-12);
        }
    }

    #[test]
    fn the_series_meets_the_formula_and_stays_positive() {
        let (below, above) = (RateStep::over(0.999_999e-3, 1.0), RateStep::over(1.000_001e-3, 1.0));
        assert!((below.to_posture / above.to_posture - 1.0).abs() < 1e-5);
        assert!(RateStep::over(1e-9, 1.0).to_posture > 0.0);
        assert_eq!(RateStep::over(-1.0, 1.0), RateStep::over(0.0, 1.0));
    }
}
