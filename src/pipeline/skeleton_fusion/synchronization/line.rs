//! The straight line through the offsets of many windows.

use super::windows::Observation;

/// Standard deviation of the drift before anything was measured, s/s: clocks of sensors are specified to ±50 to
/// ±100 ppm, of which a flat distribution has 58 ppm.
pub(super) const PRIOR_DRIFT_SD: f64 = 58e-6;

/// Standard deviation of what one window's lag is wrong by although noise does not say so, seconds: soft tissue and the
/// camera's bias move with the posture.
const SYSTEMATIC_SD_S: f64 = 2e-3;

/// Residuals beyond this many standard deviations pull no harder (Huber's constant for 95 % efficiency).
const HUBER: f64 = 1.345;

/// Residual in standard deviations up to which a window agrees with the line.
const AGREES: f64 = 4.0;

/// Rounds of reweighting; the weights settle in a few.
const ROUNDS: usize = 30;

/// Camera's time against a unit's, both in seconds from their first node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    pub reference_s: f64,
    pub offset_s: f64,
    /// s/s.
    pub drift: f64,
}

impl Line {
    pub(super) fn camera_s(&self, unit_s: f64) -> f64 {
        unit_s + self.offset_s + self.drift * (unit_s - self.reference_s)
    }

    pub(super) fn unit_s(&self, camera_s: f64) -> f64 {
        self.reference_s + (camera_s - self.reference_s - self.offset_s) / (1.0 + self.drift)
    }
}

/// A line with what is known of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fit {
    pub line: Line,
    pub offset_sd_s: f64,
    pub drift_sd: f64,
    /// Root mean square of the residuals of the windows that agree, weighted by what each tells, seconds.
    pub residual_s: f64,
    /// Of each observation, whether it agrees with the line.
    pub agrees: Vec<bool>,
}

/// Fits by iterated least squares, observations far off weighing less; `None` without any.
///
/// ```text
/// minimise Σ w (difference − offset − drift (unit − reference))² + (drift / prior)²
/// ```
pub(super) fn fit(observations: &[Observation]) -> Option<Fit> {
    let variance = |o: &Observation| o.variance + SYSTEMATIC_SD_S * SYSTEMATIC_SD_S;
    let mut line = Line { reference_s: 0.0, offset_s: weighted_median(observations, variance)?, drift: 0.0 };
    let residual = |line: &Line, o: &Observation| o.difference_s - (line.camera_s(o.unit_s) - o.unit_s);
    let mut sds = (0.0, 0.0);
    for _ in 0..ROUNDS {
        let weights: Vec<f64> = observations
            .iter()
            .map(|o| {
                let deviations = residual(&line, o).abs() / variance(o).sqrt();
                (HUBER / deviations).min(1.0) / variance(o)
            })
            .collect();
        let weighted = || observations.iter().zip(&weights);
        let sum: f64 = weights.iter().sum();
        let reference_s = weighted().map(|(o, w)| w * o.unit_s).sum::<f64>() / sum;
        let offset_s = weighted().map(|(o, w)| w * o.difference_s).sum::<f64>() / sum;
        let prior = 1.0 / (PRIOR_DRIFT_SD * PRIOR_DRIFT_SD);
        let spread = weighted().map(|(o, w)| w * (o.unit_s - reference_s).powi(2)).sum::<f64>() + prior;
        let slope: f64 = weighted().map(|(o, w)| w * (o.unit_s - reference_s) * (o.difference_s - offset_s)).sum();
        line = Line { reference_s, offset_s, drift: slope / spread };
        sds = ((1.0 / sum).sqrt(), (1.0 / spread).sqrt());
    }
    let agrees: Vec<bool> =
        observations.iter().map(|o| residual(&line, o).abs() < AGREES * variance(o).sqrt()).collect();
    let agreeing = || observations.iter().zip(&agrees).filter(|(_, agrees)| **agrees).map(|(o, _)| o);
    let n = agreeing().count() as f64;
    let mean = |f: &dyn Fn(&Observation) -> f64| agreeing().map(f).sum::<f64>() / n.max(1.0);
    // A window that tells the lag to 25 ms may be off by 25 ms and says nothing of the map.
    let precision = mean(&|o| 1.0 / variance(o));
    let residual_s = (mean(&|o| residual(&line, o).powi(2) / variance(o)) / precision.max(f64::MIN_POSITIVE)).sqrt();
    // Windows that scatter more than their variances say make the line less certain, never more. A single
    // one shows no scatter; two parameters are taken from the rest.
    let freedom = n / (n - 2.0).max(1.0);
    let inflation = (mean(&|o| residual(&line, o).powi(2) / variance(o)) * freedom).max(1.0).sqrt();
    let drift_sd = (sds.1 * inflation).min(PRIOR_DRIFT_SD);
    Some(Fit { line, offset_sd_s: sds.0 * inflation, drift_sd, residual_s, agrees })
}

/// Median of the differences, each weighing one over its variance.
fn weighted_median(observations: &[Observation], variance: impl Fn(&Observation) -> f64) -> Option<f64> {
    let mut sorted: Vec<(f64, f64)> = observations.iter().map(|o| (o.difference_s, 1.0 / variance(o))).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * sorted.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    sorted.into_iter().find_map(|(difference, weight)| {
        sum += weight;
        (sum >= half).then_some(difference)
    })
}
