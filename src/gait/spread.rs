//! Mean and spread of one quantity over steps of both feet.

use crate::assessment::PerformanceMeasure;
use crate::body::Side;

/// One value of one step or stride.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Observation {
    /// The foot that landed.
    pub side: Side,
    /// The value, in the unit of its measure.
    pub value: f64,
}

/// An error of a sensor that is the same in every step, as a standard deviation over sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum ConstantError {
    /// Nothing is known of one.
    #[default]
    None,
    /// It adds to one foot what it takes from the other: the mean of both is free of it.
    Opposed(f64),
    /// It adds to every value.
    Shared(f64),
}

/// Values of both feet, and what is known of their error.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spread {
    observations: Vec<Observation>,
    /// Standard deviation of the error of one value; none when not known.
    error_sd: Option<f64>,
    /// What no number of steps averages out.
    constant: ConstantError,
}

impl Spread {
    /// The spread of observations.
    pub(super) fn of(observations: Vec<Observation>, error_sd: Option<f64>) -> Self {
        Self { observations, error_sd, constant: ConstantError::None }
    }

    /// The same with an error that no number of steps averages out.
    pub(super) fn with_constant(self, constant: ConstantError) -> Self {
        Self { constant, ..self }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.observations.is_empty()
    }

    fn values(&self, side: Side) -> Vec<f64> {
        self.observations.iter().filter(|o| o.side == side).map(|o| o.value).collect()
    }

    /// Mean of one foot's values.
    fn side_mean(&self, side: Side) -> Option<f64> {
        mean(&self.values(side))
    }

    /// Mean of the means of both feet: a walk with one more step of one foot does not lean to that foot, and a sensor that
    /// sees one foot ahead of where it is adds nothing to the mean. The mean of one foot when the other has none.
    fn mean(&self) -> Option<f64> {
        match Side::BOTH.map(|side| self.side_mean(side)) {
            [Some(left), Some(right)] => Some(0.5 * (left + right)),
            [one, other] => one.or(other),
        }
    }

    /// Standard deviation (n − 1) of both feet's values about their own means; none with fewer than two values, or without
    /// two of the same foot.
    fn sd(&self) -> Option<f64> {
        let mut squares = 0.0;
        for side in Side::BOTH {
            let values = self.values(side);
            let mean = mean(&values).unwrap_or(0.0);
            squares += values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        }
        let n = self.observations.len();
        let repeats = Side::BOTH.iter().any(|side| self.values(*side).len() > 1);
        repeats.then(|| (squares / (n - 1) as f64).sqrt())
    }

    /// Standard error of the mean: SD / √n; the error of measurement is part of the SD.
    pub(super) fn standard_error(&self) -> Option<f64> {
        self.sd().map(|sd| sd / (self.observations.len() as f64).sqrt())
    }

    /// Standard error of the ratio right / left, to first order.
    fn ratio_error(&self) -> Option<f64> {
        let of_side = |side: Side| {
            let values = self.values(side);
            Some((mean(&values)?, deviation(&values)? / (values.len() as f64).sqrt()))
        };
        let ((left, left_error), (right, right_error)) = (of_side(Side::Left)?, of_side(Side::Right)?);
        if left <= 0.0 {
            return None;
        }
        let ratio = right / left;
        let random = right_error.hypot(ratio * left_error) / left;
        let constant = match self.constant {
            ConstantError::None => 0.0,
            // What one foot gains the other loses.
            ConstantError::Opposed(sd) => (1.0 + ratio) * sd / left,
            ConstantError::Shared(sd) => (1.0 - ratio).abs() * sd / left,
        };
        Some(random.hypot(constant))
    }

    fn measure(&self, name: String, side: Option<Side>, value: Option<f64>, id: &Option<String>) -> PerformanceMeasure {
        let n = side.map_or(self.observations.len(), |side| self.values(side).len());
        let reason = match value {
            Some(_) => "",
            None => "too few steps count",
        };
        PerformanceMeasure {
            name,
            side,
            value,
            standard_error: None,
            error_sd: None,
            n_observations: Some(n as u64),
            definition: id.clone(),
            reason: reason.to_owned(),
        }
    }

    /// The mean of both feet and of each.
    pub(super) fn means(&self, name: &str, id: &Option<String>) -> Vec<PerformanceMeasure> {
        let mut both = self.measure(name.to_owned(), None, self.mean(), id);
        let (of_both, of_one) = match self.constant {
            ConstantError::None => (0.0, 0.0),
            ConstantError::Opposed(sd) => (0.0, sd),
            ConstantError::Shared(sd) => (sd, sd),
        };
        both.standard_error = self.standard_error().map(|error| error.hypot(of_both));
        let mut found = vec![both];
        for side in Side::BOTH {
            let values = self.values(side);
            let mut one = self.measure(name.to_owned(), Some(side), mean(&values), id);
            one.standard_error = deviation(&values).map(|sd| (sd / (values.len() as f64).sqrt()).hypot(of_one));
            found.push(one);
        }
        found
    }

    /// Means, and standard deviation and coefficient of variation with the error that measurement adds to them.
    pub(super) fn variability(&self, name: &str, id: &Option<String>) -> Vec<PerformanceMeasure> {
        let mut found = self.means(name, id);
        let (stem, unit) = name.rsplit_once('_').unwrap_or((name, ""));
        let sd = self.sd();
        // Of normal values, the standard error of an SD is SD / √(2 (n − 1)).
        let relative = 1.0 / (2.0 * (self.observations.len().max(2) - 1) as f64).sqrt();
        let mut observed = self.measure(format!("{stem}_sd_{unit}"), None, sd, id);
        observed.standard_error = sd.map(|sd| sd * relative);
        observed.error_sd = self.error_sd;
        found.push(observed);
        // Percent of nothing is no number: steps on the spot have a length of about zero.
        let mean = self.mean().filter(|mean| mean.abs() > 1e-6);
        let cv = sd.zip(mean).map(|(sd, mean)| 100.0 * sd / mean.abs());
        let mut share = self.measure(format!("{stem}_cv_pct"), None, cv, id);
        share.standard_error = cv.map(|cv| cv * relative);
        share.error_sd = self.error_sd.zip(mean).map(|(sd, mean)| 100.0 * sd / mean.abs());
        found.push(share);
        if let Some((value, error)) = sd.zip(self.error_sd) {
            let mut corrected =
                self.measure(format!("{stem}_sd_corrected_{unit}"), None, Some(corrected_sd(value, error)), id);
            corrected.error_sd = Some(error);
            found.push(corrected);
        }
        found
    }

    /// [`Spread::variability`] and the ratio right / left.
    pub(super) fn all(&self, name: &str, id: &Option<String>) -> Vec<PerformanceMeasure> {
        let mut found = self.variability(name, id);
        let stem = name.rsplit_once('_').map_or(name, |(stem, _)| stem);
        let ratio = match Side::BOTH.map(|side| self.side_mean(side)) {
            [Some(left), Some(right)] if left > 0.0 => Some(right / left),
            _ => None,
        };
        let mut symmetry = self.measure(format!("{stem}_symmetry_ratio"), None, ratio, id);
        symmetry.standard_error = self.ratio_error();
        found.push(symmetry);
        found
    }
}

/// Standard deviation without the part that the error of measurement adds: √(SD_observed² − SD_error²), 0 at least
/// (clinical evidence, section 1, 6).
pub fn corrected_sd(observed: f64, error: f64) -> f64 {
    (observed * observed - error * error).max(0.0).sqrt()
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn deviation(values: &[f64]) -> Option<f64> {
    let mean = mean(values)?;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(left: &[f64], right: &[f64]) -> Spread {
        let of =
            |side: Side, values: &[f64]| values.iter().map(|&value| Observation { side, value }).collect::<Vec<_>>();
        Spread::of([of(Side::Left, left), of(Side::Right, right)].concat(), Some(0.005))
    }

    fn value(measures: &[PerformanceMeasure], name: &str) -> f64 {
        measures.iter().find(|m| m.name == name && m.side.is_none()).and_then(|m| m.value).expect(name)
    }

    #[test]
    fn a_foot_that_always_steps_longer_adds_nothing_to_the_deviation() {
        let found = spread(&[0.50, 0.52, 0.54], &[0.60, 0.62, 0.64]).all("step_length_m", &None);
        // 4 × 0.02² over n − 1 = 5.
        assert!((value(&found, "step_length_sd_m") - (0.0016f64 / 5.0).sqrt()).abs() < 1e-12);
        assert!((value(&found, "step_length_m") - 0.57).abs() < 1e-12);
        assert!((value(&found, "step_length_cv_pct") - 100.0 * (0.0016f64 / 5.0).sqrt() / 0.57).abs() < 1e-9);
        assert!((value(&found, "step_length_symmetry_ratio") - 0.62 / 0.52).abs() < 1e-12);
    }

    #[test]
    fn one_step_more_of_a_foot_does_not_move_the_mean() {
        let found = spread(&[0.5], &[0.6, 0.6]).means("step_length_m", &None);
        assert!((value(&found, "step_length_m") - 0.55).abs() < 1e-12);
        assert_eq!(found[2].n_observations, Some(2));
    }

    #[test]
    fn two_steps_of_different_feet_have_no_deviation() {
        let found = spread(&[0.5], &[0.6]).all("step_length_m", &None);
        let sd = found.iter().find(|m| m.name == "step_length_sd_m").unwrap();
        assert_eq!((sd.value, sd.reason.as_str(), sd.error_sd), (None, "too few steps count", Some(0.005)));
        assert!(found.iter().all(|m| m.name != "step_length_sd_corrected_m"));
    }

    #[test]
    fn a_constant_error_between_the_feet_widens_sides_and_symmetry_but_not_the_mean_of_both() {
        let plain = spread(&[0.50, 0.52, 0.54], &[0.60, 0.62, 0.64]);
        let error = |measures: &[PerformanceMeasure], k: usize| measures[k].standard_error.unwrap();
        let (before, after) =
            (plain.all("a_m", &None), plain.clone().with_constant(ConstantError::Opposed(0.04)).all("a_m", &None));
        assert_eq!(error(&before, 0), error(&after, 0));
        assert!((error(&after, 1) - error(&before, 1).hypot(0.04)).abs() < 1e-12);
        let ratio = |measures: &[PerformanceMeasure]| error(measures, measures.len() - 1);
        assert!(ratio(&before) < 0.05 && ratio(&after) > 0.15, "{} {}", ratio(&before), ratio(&after));
        let shared = plain.with_constant(ConstantError::Shared(0.04)).means("a_m", &None);
        assert!((error(&shared, 0) - error(&before, 0).hypot(0.04)).abs() < 1e-12);
    }

    #[test]
    fn the_error_of_measurement_is_taken_out_of_a_deviation() {
        // Section 1: 2.0 and 2.5 cm make 3.20 cm.
        assert!((corrected_sd(0.032_015_6, 0.025) - 0.02).abs() < 1e-6);
        assert_eq!(corrected_sd(0.01, 0.02), 0.0);
    }
}
