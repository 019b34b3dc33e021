//! Noise of the sensor, estimated from the recording itself, so that an unknown sensor works out of the box.
//!
//! White noise of variance σ² has second differences of variance 6σ²; movement contributes next to nothing to them at
//! the rate of a camera. Their median absolute value is therefore a robust measure of σ in which jumps do not count.

use super::observation::Observations;
use crate::body::POINT_COUNT;
use nalgebra::Vector3;

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
}
