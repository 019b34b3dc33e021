//! A rectangular pulse on top of a smooth curve, by least squares.

use nalgebra::Vector3;

/// Degree of the curve: a limb that swings out and back within half a second is still a cubic.
const DEGREE: usize = 3;

/// A pulse found in a stretch of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pulse {
    /// Height of the pulse, in the unit of the samples.
    pub height: Vector3<f64>,
    /// Sum of squares that one unit of height explains: the height's variance is that of a sample divided by it.
    pub power: f64,
}

/// Fits a cubic and a pulse over `inside` to samples at `times`; `None` when the samples cannot tell them apart.
pub(super) fn fit_pulse(times: &[f64], samples: &[Vector3<f64>], inside: std::ops::Range<usize>) -> Option<Pulse> {
    /// Share of a unit column that must be left after projection for it to count as independent.
    const INDEPENDENT: f64 = 1e-6;
    let n = times.len();
    let (middle, half) = match (times.first(), times.last()) {
        (Some(first), Some(last)) if last > first => (0.5 * (first + last), 0.5 * (last - first)),
        _ => return None,
    };
    let mut pulse: Vec<f64> = (0..n).map(|i| if inside.contains(&i) { 1.0 } else { 0.0 }).collect();
    let mut curve: Vec<Vec<f64>> = Vec::with_capacity(DEGREE + 1);
    for power in 0..=DEGREE {
        let mut column: Vec<f64> = times.iter().map(|t| ((t - middle) / half).powi(power as i32)).collect();
        for known in &curve {
            take_out(&mut column, known);
        }
        let norm = dot(&column, &column).sqrt();
        if norm * norm < INDEPENDENT * n as f64 {
            return None;
        }
        column.iter_mut().for_each(|value| *value /= norm);
        curve.push(column);
    }
    for known in &curve {
        take_out(&mut pulse, known);
    }
    let power = dot(&pulse, &pulse);
    if power < INDEPENDENT * n as f64 {
        return None;
    }
    let height = pulse.iter().zip(samples).map(|(weight, sample)| sample * *weight).sum::<Vector3<f64>>() / power;
    Some(Pulse { height, power })
}

/// Takes the part along a unit column out of another column.
fn take_out(column: &mut [f64], unit: &[f64]) {
    let along = dot(column, unit);
    column.iter_mut().zip(unit).for_each(|(value, u)| *value -= along * u);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_on_a_cubic_is_found_whatever_the_cubic_is() {
        let times: Vec<f64> = (0..15).map(|i| 7.0 + 0.033 * f64::from(i)).collect();
        let height = Vector3::new(0.4, -0.1, 0.02);
        let sample = |(i, t): (usize, &f64)| {
            let curve = Vector3::new(1.0, t * t, 3.0 * t - t * t * t);
            if (6..9).contains(&i) { curve + height } else { curve }
        };
        let samples: Vec<_> = times.iter().enumerate().map(sample).collect();
        let found = fit_pulse(&times, &samples, 6..9).unwrap();
        assert!((found.height - height).norm() < 1e-9);
        assert!(found.power > 1.0 && found.power < 3.0, "three samples, less what the curve takes: {}", found.power);
    }

    #[test]
    fn too_few_samples_to_tell_a_pulse_from_a_curve_give_none() {
        let samples = vec![Vector3::zeros(); 4];
        assert_eq!(fit_pulse(&[0.0, 1.0, 2.0, 3.0], &samples, 1..2), None);
        assert_eq!(fit_pulse(&[], &[], 0..0), None);
        assert_eq!(fit_pulse(&[1.0], &samples[..1], 0..1), None);
    }
}
