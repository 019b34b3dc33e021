//! A sensor at the end of its range: it stays there, and comes there abruptly.

/// Numbers this close to the extreme are at the rail: calibration spreads a rail by about as much.
const AT_RAIL: f64 = 1e-3;

/// A run is abrupt when the number before it was lower by more; the top of a smooth peak is not.
const ABRUPT: f64 = 0.01;

/// Samples of an abrupt run that make a clipped peak.
const CLIPPED_RUN: u32 = 4;

/// Samples at the rail below which one clipped peak is no evidence.
const MIN_SAMPLES: u64 = 8;

/// The largest magnitude on one axis so far, and how the axis stayed there.
#[derive(Debug, Clone, Default)]
pub(super) struct Rail {
    extreme: f64,
    n: u64,
    run: u32,
    is_abrupt: bool,
    n_clipped: u64,
    last: f64,
}

impl Rail {
    pub(super) fn push(&mut self, value: f64) {
        let magnitude = value.abs();
        if magnitude > self.extreme * (1.0 + AT_RAIL) {
            *self = Self { extreme: magnitude, last: self.last, ..Self::default() };
        }
        if magnitude >= self.extreme * (1.0 - AT_RAIL) {
            self.extreme = self.extreme.max(magnitude);
            if self.run == 0 {
                self.is_abrupt = self.last < self.extreme * (1.0 - ABRUPT);
            }
            self.n += 1;
            self.run += 1;
            self.n_clipped += u64::from(self.run == CLIPPED_RUN && self.is_abrupt);
        } else {
            self.run = 0;
        }
        self.last = magnitude;
    }

    /// The rail and the number of samples at it, when the axis was clipped there.
    pub(super) fn clipped(&self) -> Option<(f64, u64)> {
        (self.n_clipped > 0 && self.n >= MIN_SAMPLES).then_some((self.extreme, self.n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swing(hz: f64, amplitude: f64, limit: f64) -> Option<(f64, u64)> {
        let mut rail = Rail::default();
        let sample = |i: i32| amplitude * (2.0 * std::f64::consts::PI * hz * f64::from(i) / 100.0).sin();
        (0..1000).for_each(|i| rail.push(sample(i).clamp(-limit, limit)));
        rail.clipped()
    }

    #[test]
    fn a_clipped_swing_is_found_and_a_whole_one_of_any_speed_is_not() {
        assert!(swing(1.0, 10.0, 8.0).is_some_and(|(rail, n)| rail == 8.0 && n > 300));
        for hz in [0.05, 0.2, 0.5, 1.0, 3.0, 10.0] {
            assert_eq!(swing(hz, 8.0, 10.0), None, "{hz} Hz");
        }
    }

    #[test]
    fn a_rail_that_calibration_spread_by_a_little_is_found() {
        let mut rail = Rail::default();
        for i in 0..300 {
            let value = 10.0 * (f64::from(i) * 0.1).sin();
            rail.push(if value.abs() > 7.37 { 7.37 * value.signum() + 0.002 * (f64::from(i)).sin() } else { value });
        }
        assert!(rail.clipped().is_some_and(|(rail, _)| (rail - 7.37).abs() < 0.01));
    }
}
