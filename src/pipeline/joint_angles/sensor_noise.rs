//! Noise of the sensor as the Gaussian methods take it: from a noise model, or estimated from the recording itself, so
//! that an unknown sensor works out of the box.
//!
//! White noise of variance σ² has second differences of variance 6σ²; movement contributes next to nothing to them at
//! the rate of a camera. Their median absolute value is therefore a robust measure of σ in which jumps do not count.

use super::noise_model::NoiseModel;
use super::observation::Observations;
use crate::body::skeleton::point_index;
use crate::body::{Limb, POINT_COUNT};
use nalgebra::Vector3;

/// White noise and slow offset of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorNoise {
    /// Standard deviation of each point's white noise in the axes of the observations, metres.
    pub white: [Vector3<f64>; POINT_COUNT],
    /// Standard deviation of the offset of a point's coordinates that outlasts averaging, metres.
    pub slow_offset: f64,
}

impl SensorNoise {
    /// Estimated from the recording itself.
    pub fn adaptive(observations: &Observations) -> Self {
        let white = white_noise(observations);
        let slow_offset = slow_offset(observations, &white);
        Self { white, slow_offset }
    }

    /// That of a noise model, turned into the axes of the observations. The offset is the root mean square of the
    /// points': the Gaussian methods take one for all.
    pub fn of_model(model: &NoiseModel, observations: &Observations) -> Self {
        let covariance = model.observation_in(&observations.subject_from_world);
        let sd = |row: usize| covariance[(row, row)].max(0.0).sqrt();
        let mean_square = model.slow_offset.iter().map(|sd| sd.powi(2)).sum::<f64>() / POINT_COUNT as f64;
        Self {
            white: std::array::from_fn(|p| Vector3::from_fn(|axis, _| sd(3 * p + axis))),
            slow_offset: mean_square.sqrt(),
        }
    }
}

/// Standard deviation of each point's white noise in the axes of the observations, metres.
pub fn white_noise(observations: &Observations) -> [Vector3<f64>; POINT_COUNT] {
    let mut noise = [Vector3::zeros(); POINT_COUNT];
    let mut differences = Vec::with_capacity(observations.len());
    for (p, sd) in noise.iter_mut().enumerate() {
        for axis in 0..3 {
            differences.clear();
            for frames in observations.points.windows(3) {
                let difference = frames[0][p][axis] - 2.0 * frames[1][p][axis] + frames[2][p][axis];
                if difference.is_finite() {
                    differences.push(difference.abs());
                }
            }
            if differences.is_empty() {
                continue;
            }
            let middle = differences.len() / 2;
            let median = *differences.select_nth_unstable_by(middle, f64::total_cmp).1;
            // 1.4826 turns the median absolute value of a normal variable into its standard deviation.
            sd[axis] = 1.4826 * median / 6f64.sqrt();
        }
    }
    noise
}

/// Time over which white noise is averaged away before bones are measured, seconds.
const BLOCK_S: f64 = 0.3;
/// Offset of a point's coordinates for each metre that its bones seem to change in length. Bones show only what an offset
/// changes along them during a recording, not what stays or lies across. The factor was set on simulated and real
/// recordings with a reference, so that 95 % intervals hold nine tenths of the truth and more; `docs/measurements.md`
/// has the table.
const OFFSET_PER_LENGTH_CHANGE: f64 = 5.0;

/// Standard deviation of the offset of a point's coordinates that outlasts averaging, metres, from how much the bones
/// seem to change in length between blocks of time.
pub fn slow_offset(observations: &Observations, white: &[Vector3<f64>; POINT_COUNT]) -> f64 {
    let mut variances: Vec<f64> = length_variances(observations, white).into_iter().flatten().collect();
    // The median: a hand that a sensor hardly sees must not speak for the body.
    variances.sort_by(f64::total_cmp);
    offset_of_length_variance(variances.get(variances.len() / 2).copied().unwrap_or(0.0))
}

/// Standard deviation of a point's slow offset from the variance of a bone's length, metres.
pub(super) fn offset_of_length_variance(variance: f64) -> f64 {
    // Two points make a bone.
    OFFSET_PER_LENGTH_CHANGE * (variance / 2.0).sqrt()
}

/// Variance of each bone's length between blocks of time beyond what white noise explains, m²: proximal and distal bone
/// of each limb; `None` for a bone that is hardly seen.
pub(super) fn length_variances(
    observations: &Observations,
    white: &[Vector3<f64>; POINT_COUNT],
) -> [Option<f64>; 2 * Limb::ALL.len()] {
    let interval = observations.duration_s() / (observations.len().max(2) - 1) as f64;
    let frames = ((BLOCK_S / interval.max(1e-3)).round() as usize).clamp(1, 1000);
    std::array::from_fn(|bone| {
        let limb = Limb::ALL[bone / 2];
        let (a, b) = (point_index(limb, bone % 2), point_index(limb, bone % 2 + 1));
        let lengths = block_lengths(observations, frames, a, b);
        if lengths.len() < 3 {
            return None;
        }
        let n = lengths.len() as f64;
        let mean = lengths.iter().sum::<f64>() / n;
        let observed = lengths.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // A median of n normal numbers has π/2 of the variance of their mean.
        let per_frame = (white[a].norm_squared() + white[b].norm_squared()) / 3.0;
        let expected = std::f64::consts::FRAC_PI_2 * per_frame / frames as f64;
        // Two standard errors of a variance: what white noise alone may look like.
        let chance = 2.0 * (2.0 / (n - 1.0)).sqrt();
        Some((observed - expected * (1.0 + chance)).max(0.0))
    })
}

/// Median distance of two points in each block of frames in which both were mostly seen, metres. The distance is taken
/// frame by frame: the mean positions of a turning bone are closer together than its ends.
fn block_lengths(observations: &Observations, frames: usize, a: usize, b: usize) -> Vec<f64> {
    let mut lengths = Vec::with_capacity(frames);
    let mut length = |block: &[[Vector3<f64>; POINT_COUNT]]| {
        lengths.clear();
        lengths.extend(block.iter().map(|points| (points[b] - points[a]).norm()).filter(|length| length.is_finite()));
        if 2 * lengths.len() <= block.len() {
            return None;
        }
        let middle = lengths.len() / 2;
        Some(*lengths.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    observations.points.chunks_exact(frames).filter_map(&mut length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::random::RandomStreams;
    use nalgebra::Rotation3;

    #[test]
    fn white_noise_is_found_under_a_movement_and_in_spite_of_jumps() {
        let mut streams = RandomStreams::new(2);
        let frame = |t: usize, streams: &mut RandomStreams| {
            let sway = 0.3 * (t as f64 / 30.0 * 2.0).sin();
            let jump = if t.is_multiple_of(50) { 1.0 } else { 0.0 };
            [Vector3::from_fn(|axis, _| sway + jump + 0.01 * (axis + 1) as f64 * streams.normal()); POINT_COUNT]
        };
        let points = (0..1200).map(|t| frame(t, &mut streams)).collect();
        let time_ns = (0..1200).map(|t| t * 33_333_333).collect();
        let noise = white_noise(&Observations { time_ns, points, subject_from_world: Rotation3::identity() });
        let relative = noise[4].component_div(&Vector3::new(0.01, 0.02, 0.03));
        assert!((relative - Vector3::repeat(1.0)).amax() < 0.15, "{relative}");
    }

    /// A rigid skeleton whose left knee slides along the leg by an amplitude, with white noise on every point.
    fn sliding_knees(amplitude: f64, white: f64) -> Observations {
        let mut streams = RandomStreams::new(5);
        let mut frame = |t: usize| {
            let slide = amplitude * (t as f64 / 30.0).sin();
            std::array::from_fn(|p| {
                let slides = if p % 3 == 1 { slide } else { 0.0 };
                let place = Vector3::new((p / 3) as f64, -0.4 * (p % 3) as f64 - slides, 2.0);
                place + Vector3::from_fn(|_, _| white * streams.normal())
            })
        };
        let points = (0..900).map(&mut frame).collect();
        let time_ns = (0..900).map(|t| t * 33_333_333).collect();
        Observations { time_ns, points, subject_from_world: Rotation3::identity() }
    }

    #[test]
    fn a_bone_that_turns_quickly_shows_no_offset() {
        let frame = |t: usize| {
            let direction = Rotation3::from_axis_angle(&Vector3::z_axis(), (t as f64 / 5.0).sin());
            std::array::from_fn(|p| direction * Vector3::new((p / 3) as f64, -0.4 * (p % 3) as f64, 2.0))
        };
        let points = (0..900).map(frame).collect();
        let time_ns = (0..900).map(|t| t * 33_333_333).collect();
        let observations = Observations { time_ns, points, subject_from_world: Rotation3::identity() };
        let white = [Vector3::zeros(); POINT_COUNT];
        assert!(slow_offset(&observations, &white) < 1e-9);
    }

    #[test]
    fn bones_that_change_slowly_in_length_show_an_offset_and_white_noise_does_not() {
        let slow = |amplitude, white| {
            let observations = sliding_knees(amplitude, white);
            slow_offset(&observations, &white_noise(&observations))
        };
        // A sine of 20 mm has an SD of 14 mm; both bones of a limb change by it, and two points share it.
        let expected = OFFSET_PER_LENGTH_CHANGE * 0.0141 / 2f64.sqrt();
        assert!((slow(0.02, 0.002) / expected - 1.0).abs() < 0.15, "{}", slow(0.02, 0.002));
        assert!(slow(0.0, 0.01) < 0.2 * expected, "{}", slow(0.0, 0.01));
    }
}
