//! The clock of each unit: it was started at another instant than the camera's, and runs a little fast or slow.

use rand::{Rng, RngExt};

/// How far clocks may be apart; each unit's is drawn evenly from both signs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockErrors {
    /// Largest offset, seconds. Default 2.
    pub offset_s: f64,
    /// Largest drift, millionths. Default 100, the tolerance of cheap crystals.
    pub drift_ppm: f64,
}

impl Default for ClockErrors {
    fn default() -> Self {
        Self { offset_s: 2.0, drift_ppm: 100.0 }
    }
}

impl ClockErrors {
    /// Clocks that agree with the camera's.
    pub const NONE: ClockErrors = ClockErrors { offset_s: 0.0, drift_ppm: 0.0 };

    pub(super) fn draw(&self, rng: &mut impl Rng) -> UnitClock {
        let mut either_sign = |largest: f64| largest * (2.0 * rng.random::<f64>() - 1.0);
        UnitClock { offset_s: either_sign(self.offset_s), drift_ppm: either_sign(self.drift_ppm) }
    }
}

/// One unit's clock: `camera = offset + (1 + drift) unit`, so the offset is what is to be added at the unit's time 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitClock {
    /// The camera's time when the unit's clock shows 0, seconds.
    pub offset_s: f64,
    /// How much faster the camera's clock runs than the unit's, millionths.
    pub drift_ppm: f64,
}

impl UnitClock {
    /// The camera's time when the unit's clock shows `unit_s`, seconds.
    pub fn camera_time(&self, unit_s: f64) -> f64 {
        self.offset_s + unit_s * (1.0 + self.drift_ppm * 1e-6)
    }

    /// What the unit's clock shows at a time of the camera's, seconds.
    pub fn unit_time(&self, camera_s: f64) -> f64 {
        (camera_s - self.offset_s) / (1.0 + self.drift_ppm * 1e-6)
    }

    /// Time stamps (nanoseconds of the unit's clock) of samples at a rate from the camera's time 0 to `end_s`; the first
    /// comes a share of an interval late.
    pub(super) fn time_stamps(&self, rate_hz: f64, end_s: f64, share: f64) -> Vec<i64> {
        let first = self.unit_time(0.0) + share / rate_hz;
        let count = ((self.unit_time(end_s) - first) * rate_hz).max(0.0) as usize + 1;
        (0..count).map(|k| ((first + k as f64 / rate_hz) * 1e9).round() as i64).collect()
    }
}
