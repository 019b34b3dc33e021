//! How well a quantity that does not change is known from many frames, by batch means.
//!
//! Frames that follow each other are wrong in the same way, so their number says little. The recording is cut into
//! stretches of time, and the means of the stretches count as independent:
//!
//! ```text
//! σ² = s²(stretch means) / m + σ_offset²
//! ```
//!
//! What stays wrong through the whole recording, the sensor's slow offset, cannot be seen in the spread and is added.

/// Standard deviation of a segment's length by the sensor's slow offset, metres. Our provisional choice, after the lengths of
/// simulated Kinect v2 recordings (`cargo test --test pipelines body -- --nocapture`). It does not get less with time, nor
/// in a subject who stands still.
pub const SLOW_OFFSET_SD_M: f64 = 0.025;

/// Stretch of a moving subject, seconds: the time in which an exercise goes through its postures.
pub const MOVING_STRETCH_S: f64 = 1.0;

/// Stretch of a subject at rest, seconds: longer than sensors smooth over, and a window of a second still has four.
pub const RESTING_STRETCH_S: f64 = 0.25;

/// Fewest stretches whose means have a spread worth using.
const MIN_STRETCHES: usize = 4;

/// Standard deviation of the mean of `samples`, pairs of a time in seconds and a value, in the unit of the value; without the
/// slow offset.
///
/// With fewer than four stretches the standard deviation of single values, over the root of the number of stretches,
/// stands in. `samples` must be ordered by time. Without samples it is infinite.
pub fn standard_error(samples: &[(f64, f64)], stretch_s: f64) -> f64 {
    let means: Vec<f64> = samples
        .chunk_by(|a, b| (a.0 / stretch_s).floor() == (b.0 / stretch_s).floor())
        .map(|stretch| mean(stretch.iter().map(|(_, value)| *value)))
        .collect();
    let spread = match means.len() {
        0 => return f64::INFINITY,
        few if few < MIN_STRETCHES => {
            standard_deviation(&samples.iter().map(|(_, value)| *value).collect::<Vec<f64>>())
        }
        _ => standard_deviation(&means),
    };
    spread / (means.len() as f64).sqrt()
}

/// The error of chance and the slow offset together, metres.
pub fn with_slow_offset(standard_error_m: f64) -> f64 {
    standard_error_m.hypot(SLOW_OFFSET_SD_M)
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len().max(1) as f64;
    values.sum::<f64>() / n
}

fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values.iter().copied());
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (values.len().saturating_sub(1).max(1)) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_repeat_each_other_count_once_for_each_stretch() {
        // Four stretches of one second with the values 1, 3, 1, 3: s² = 4/3, over 4 stretches.
        let of = |frames: usize| -> Vec<(f64, f64)> {
            (0..4 * frames)
                .map(|i| (i as f64 / frames as f64, if (i / frames).is_multiple_of(2) { 1.0 } else { 3.0 }))
                .collect()
        };
        let expected = (4.0_f64 / 3.0 / 4.0).sqrt();
        for frames in [1, 10, 100] {
            assert!((standard_error(&of(frames), 1.0) - expected).abs() < 1e-12, "{frames} frames");
        }
    }

    #[test]
    fn few_stretches_take_the_spread_of_frames_and_no_sample_knows_nothing() {
        let samples = [(0.0, 1.0), (0.1, 3.0)];
        assert!((standard_error(&samples, 1.0) - 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(standard_error(&[], 1.0), f64::INFINITY);
        assert!((with_slow_offset(0.06) - 0.065).abs() < 1e-12);
    }
}
