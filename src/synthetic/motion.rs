//! Smooth functions of time that exercises are made of.

use rand::{Rng, RngExt};
use std::f64::consts::TAU;

/// Minimum-jerk course from 0 to 1 while `s` goes from 0 to 1 (Flash and Hogan 1985); constant outside.
pub fn minimum_jerk(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Course from 0 to 1 between two instants.
pub fn between(start: f64, end: f64, t: f64) -> f64 {
    minimum_jerk((t - start) / (end - start))
}

/// Course that rises from 0 to 1 in `rise`, stays, and falls back to 0 in `fall`; both are `[start, end]`.
pub fn pulse(rise: [f64; 2], fall: [f64; 2], t: f64) -> f64 {
    between(rise[0], rise[1], t) - between(fall[0], fall[1], t)
}

/// Course of fifth order between two instants whose place, velocity and acceleration are given at both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quintic {
    start_s: f64,
    coefficients: [f64; 6],
}

impl Quintic {
    /// From one state (place, velocity per second, acceleration per second squared) at `start_s` to another at `end_s`.
    pub fn between(start_s: f64, from: [f64; 3], end_s: f64, to: [f64; 3]) -> Self {
        let d = end_s - start_s;
        let [p, v, a] = from;
        let ahead = [p + v * d + a * d * d / 2.0, v + a * d, a];
        let place = to[0] - ahead[0];
        let velocity = (to[1] - ahead[1]) * d;
        let acceleration = (to[2] - ahead[2]) * d * d / 2.0;
        let coefficients = [
            p,
            v,
            a / 2.0,
            (10.0 * place - 4.0 * velocity + acceleration) / d.powi(3),
            (-15.0 * place + 7.0 * velocity - 2.0 * acceleration) / d.powi(4),
            (6.0 * place - 3.0 * velocity + acceleration) / d.powi(5),
        ];
        Self { start_s, coefficients }
    }

    /// Place at `t` seconds.
    pub fn at(&self, t: f64) -> f64 {
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * (t - self.start_s) + c)
    }
}

/// Repetitions one after the other, as many whole ones as fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Start of the first repetition, seconds.
    pub start_s: f64,
    /// Length of a repetition, seconds.
    pub period_s: f64,
    /// Number of repetitions.
    pub count: usize,
}

impl Schedule {
    /// Repetitions of `period_s` between two instants in seconds.
    pub fn filling(start_s: f64, end_s: f64, period_s: f64) -> Self {
        let count = ((end_s - start_s) / period_s).max(0.0) as usize;
        Self { start_s, period_s, count }
    }

    /// Number of the repetition that runs at `t` seconds and how much of it is over, 0 to 1.
    pub fn at(&self, t: f64) -> Option<(usize, f64)> {
        let turns = (t - self.start_s) / self.period_s;
        (turns >= 0.0 && turns < self.count as f64).then(|| (turns as usize, turns.fract()))
    }
}

/// Harmonics of one [`Wander`].
const HARMONICS: usize = 4;

/// Lowest and highest frequency of a [`Wander`], Hz: postural sway lies mostly below 1 Hz.
const WANDER_HZ: [f64; 2] = [0.08, 0.8];

/// Smooth, aperiodic wandering with a root mean square of 1: a few slow sine waves of unrelated frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wander {
    /// Frequency (Hz), phase (rad) and amplitude of each wave.
    waves: [[f64; 3]; HARMONICS],
}

impl Wander {
    /// Draws frequencies and phases; amplitudes fall with frequency, as those of sway do.
    pub fn draw(rng: &mut impl Rng) -> Self {
        let mut waves = [[0.0; 3]; HARMONICS];
        let ratio = WANDER_HZ[1] / WANDER_HZ[0];
        let mut power = 0.0;
        for (i, wave) in waves.iter_mut().enumerate() {
            let place = (i as f64 + rng.random::<f64>()) / HARMONICS as f64;
            let frequency = WANDER_HZ[0] * ratio.powf(place);
            let amplitude = (WANDER_HZ[0] / frequency).sqrt();
            *wave = [frequency, TAU * rng.random::<f64>(), amplitude];
            power += amplitude * amplitude / 2.0;
        }
        for wave in &mut waves {
            wave[2] /= power.sqrt();
        }
        Self { waves }
    }

    /// Value at `t` seconds.
    pub fn at(&self, t: f64) -> f64 {
        self.waves.iter().map(|[frequency, phase, amplitude]| amplitude * (TAU * frequency * t + phase).sin()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn minimum_jerk_starts_and_ends_at_rest_and_is_half_way_in_the_middle() {
        assert_eq!((minimum_jerk(-1.0), minimum_jerk(0.0), minimum_jerk(0.5), minimum_jerk(1.0)), (0.0, 0.0, 0.5, 1.0));
        assert!(minimum_jerk(0.01) < 1.1e-5, "third order at the start");
    }

    #[test]
    fn a_schedule_holds_only_whole_repetitions() {
        let schedule = Schedule::filling(3.0, 10.0, 2.0);
        assert_eq!(schedule.count, 3);
        assert_eq!(schedule.at(2.9), None);
        assert_eq!(schedule.at(5.5), Some((1, 0.25)));
        assert_eq!(schedule.at(9.1), None);
        assert_eq!(Schedule::filling(3.0, 1.0, 2.0).count, 0);
    }

    #[test]
    fn a_quintic_meets_both_states() {
        let (from, to) = ([-0.2, 0.3, 1.0], [0.1, 1.5, -9.81]);
        let course = Quintic::between(2.0, from, 2.4, to);
        let h = 1e-4;
        for (t, [place, velocity, acceleration]) in [(2.0, from), (2.4, to)] {
            assert!((course.at(t) - place).abs() < 1e-12);
            assert!(((course.at(t + h) - course.at(t - h)) / (2.0 * h) - velocity).abs() < 1e-4);
            let second = (course.at(t + h) - 2.0 * course.at(t) + course.at(t - h)) / (h * h);
            assert!((second - acceleration).abs() < 1e-3, "{second}");
        }
    }

    #[test]
    fn wandering_has_unit_power() {
        let wander = Wander::draw(&mut ChaCha8Rng::seed_from_u64(5));
        let n = 200_000;
        let power = (0..n).map(|i| wander.at(f64::from(i) * 0.01).powi(2)).sum::<f64>() / f64::from(n);
        // 2000 s hold more than 160 periods of the slowest wave: the mean of its square is known to about 1 %.
        assert!((power - 1.0).abs() < 0.02, "{power}");
    }
}
