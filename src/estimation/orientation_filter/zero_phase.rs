//! Second-order Butterworth low-pass, forwards and backwards, so that nothing is delayed.

use nalgebra::Vector3;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// The filter `ÿ + √2 ω ẏ + ω² y = ω² u`, solved exactly over one step in which `u` is held.
///
/// As a state (value, rate) it may be stepped over any time, so irregular samples need nothing special.
#[derive(Debug, Clone, Copy)]
struct Step {
    seconds: f64,
    value_from_value: f64,
    value_from_rate: f64,
    rate_from_value: f64,
    rate_from_rate: f64,
}

impl Step {
    fn new(seconds: f64, time_constant: f64) -> Self {
        let frequency = SQRT_2 / time_constant;
        // The real and the imaginary part of the poles are equal in size.
        let s = frequency * FRAC_1_SQRT_2;
        let decay = (-s * seconds).exp();
        let (sine, cosine) = (s * seconds).sin_cos();
        Self {
            seconds,
            value_from_value: decay * (cosine + sine),
            value_from_rate: decay * sine / s,
            rate_from_value: -decay * frequency * frequency * sine / s,
            rate_from_rate: decay * (cosine - sine),
        }
    }
}

/// Low-passes `values` in place; `seconds[i]` is the time from value `i − 1` to value `i`, `time_constant` in seconds.
///
/// The cut-off frequency is `√2 / (2π time_constant)` for each direction. Starts from the mean over the first time
/// constant, and backwards from the last value.
pub(super) fn low_pass<const N: usize>(seconds: &[f64], values: &mut [[Vector3<f64>; N]], time_constant: f64) {
    let Some(last) = values.len().checked_sub(1) else { return };
    let mut start = [Vector3::zeros(); N];
    let (mut n, mut elapsed) = (0.0, 0.0);
    for (value, seconds) in values.iter().zip(seconds) {
        if n > 0.0 && elapsed >= time_constant {
            break;
        }
        elapsed += seconds;
        n += 1.0;
        for (start, value) in start.iter_mut().zip(value) {
            *start += (value - *start) / n;
        }
    }
    let mut step = Step::new(seconds[0], time_constant);
    sweep(&mut step, start, values.iter_mut().zip(seconds.iter().copied()), time_constant);
    let start = values[last];
    // Backwards, value i is reached from value i + 1.
    let intervals = std::iter::once(seconds[last]).chain(seconds.iter().rev().copied());
    sweep(&mut step, start, values.iter_mut().rev().zip(intervals), time_constant);
}

fn sweep<'a, const N: usize>(
    step: &mut Step,
    start: [Vector3<f64>; N],
    values: impl Iterator<Item = (&'a mut [Vector3<f64>; N], f64)>,
    time_constant: f64,
) {
    let mut value = start;
    let mut rate = [Vector3::zeros(); N];
    for (input, seconds) in values {
        if step.seconds != seconds {
            *step = Step::new(seconds, time_constant);
        }
        for k in 0..N {
            let away = value[k] - input[k];
            value[k] = input[k] + away * step.value_from_value + rate[k] * step.value_from_rate;
            rate[k] = away * step.rate_from_value + rate[k] * step.rate_from_rate;
        }
        *input = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_passes_unchanged_whatever_the_steps() {
        let seconds: Vec<f64> = (0..200).map(|i| 0.01 + 0.02 * f64::from(i % 3)).collect();
        let mut values = vec![[Vector3::new(1.0, -2.0, 3.0)]; 200];
        low_pass(&seconds, &mut values, 0.5);
        assert!(values.iter().all(|[v]| (v - Vector3::new(1.0, -2.0, 3.0)).norm() < 1e-12));
    }

    #[test]
    fn a_slow_wave_is_not_delayed_and_a_fast_one_is_gone() {
        let wave = |i: usize, period: f64| (std::f64::consts::TAU * i as f64 * 0.01 / period).sin();
        let seconds = vec![0.01; 8000];
        let mut values: Vec<[Vector3<f64>; 1]> =
            (0..8000).map(|i| [Vector3::new(wave(i, 20.0), wave(i, 0.2), 0.0)]).collect();
        low_pass(&seconds, &mut values, 0.5);
        for (i, [value]) in values.iter().enumerate().skip(1000).take(6000) {
            // Holding each input over its step costs half a step each way, which cancels; the amplitude falls by 1e-4.
            assert!((value.x - wave(i, 20.0)).abs() < 2e-3, "{} is not {}", value.x, wave(i, 20.0));
            assert!(value.y.abs() < 2e-3, "{} left of the fast wave", value.y);
        }
    }
}
