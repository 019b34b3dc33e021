//! The map from one unit's clock to the camera's.

use crate::signal::interpolation::NS_PER_S;

/// A unit's clock as the camera's clock sees it: one offset, which grows or shrinks steadily.
///
/// ```text
/// camera_time = unit_time + offset + drift · (unit_time − reference)
/// ```
///
/// A positive offset means that the camera's clock shows more than the unit's at the same instant; a positive drift,
/// that the unit's clock runs slow. The reference is the centre of the evidence, where offset and drift are
/// uncorrelated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockMap {
    /// Reference time, nanoseconds on the unit's clock.
    pub reference_ns: i64,
    /// What is added to the unit's time at the reference time to reach the camera's, seconds.
    pub offset_s: f64,
    /// Seconds by which the offset grows in a second of the unit, times a million.
    pub drift_ppm: f64,
    /// Standard deviation of the offset at the reference time, seconds.
    pub offset_sd_s: f64,
    /// Standard deviation of the drift, ppm.
    pub drift_sd_ppm: f64,
}

impl ClockMap {
    /// The camera's time at a time of the unit, nanoseconds.
    pub fn camera_ns(&self, unit_ns: i64) -> i64 {
        let elapsed = unit_ns.saturating_sub(self.reference_ns) as f64;
        let shift = self.offset_s * NS_PER_S + self.drift_ppm * 1e-6 * elapsed;
        unit_ns.saturating_add(shift.round() as i64)
    }

    /// The unit's time at a time of the camera, nanoseconds.
    pub fn unit_ns(&self, camera_ns: i64) -> i64 {
        let at_reference = self.reference_ns.saturating_add((self.offset_s * NS_PER_S).round() as i64);
        let elapsed = camera_ns.saturating_sub(at_reference) as f64 / (1.0 + self.drift_ppm * 1e-6);
        self.reference_ns.saturating_add(elapsed.round() as i64)
    }

    /// Standard deviation of [`ClockMap::camera_ns`] at a time of the unit, seconds.
    pub fn sd_s(&self, unit_ns: i64) -> f64 {
        let elapsed = unit_ns.saturating_sub(self.reference_ns) as f64 / NS_PER_S;
        self.offset_sd_s.hypot(self.drift_sd_ppm * 1e-6 * elapsed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_and_its_inverse_agree_to_a_nanosecond_an_hour_away() {
        let map = ClockMap {
            reference_ns: 500_000_000_000,
            offset_s: -1.75,
            drift_ppm: 80.0,
            offset_sd_s: 0.001,
            drift_sd_ppm: 2.0,
        };
        assert_eq!(map.camera_ns(500_000_000_000), 498_250_000_000);
        // 1000 s later a slow clock is 80 ms behind.
        assert_eq!(map.camera_ns(1_500_000_000_000), 1_498_330_000_000);
        for unit in [0, 1_234_567_890_123, 3_600_000_000_000] {
            assert!((map.unit_ns(map.camera_ns(unit)) - unit).abs() <= 1);
        }
        assert!((map.sd_s(1_500_000_000_000) - 0.001f64.hypot(0.002)).abs() < 1e-12);
    }
}
