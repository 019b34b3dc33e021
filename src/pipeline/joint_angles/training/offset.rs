//! The slow offset of the points: what no averaging over time takes away.
//!
//! Where a recording has reference angles of a hinge, the offset is read off the error of the three-point angle: an
//! offset of standard deviation s in each coordinate of three points turns the angle φ by
//!
//! ```text
//! Var φ = s² (2/a² + 2/b² + 2 cos φ / (a b)),   a, b: lengths of the two bones
//! ```
//!
//! The angle is that of the points' mean places in a third of a second, and what is left of white noise in them is
//! subtracted.
//!
//! Elsewhere it is taken from how much bones change in length between blocks of time, as for one recording. Of several
//! recordings the median counts: a Kinect v1 loses the hips of a person who sits (UTD-MHAD: thighs that change by 12 %),
//! and one such exercise must not speak for all.

use super::super::observation::Observations;
use super::super::sensor_noise::{length_variances, offset_of_length_variance, white_noise};
use crate::assessment::AngleChannel;
use crate::body::skeleton::point_index;
use crate::body::{Limb, POINT_COUNT};
use crate::geometry::three_point::flexion_of_three_points;
use crate::recording::{Recording, ReferenceSeries};
use crate::signal::interpolation::interpolate;
use nalgebra::Vector3;

/// Frames whose points are averaged, so that white noise hardly counts.
const BLOCK_FRAMES: usize = 10;
/// Blocks of a reference without which the bones are asked.
const MIN_BLOCKS: u64 = 30;
/// Shortest bone that an angle is taken of, metres.
const MIN_BONE_M: f64 = 0.05;

/// Sums over recordings; of arms and legs, both sides together.
#[derive(Debug, Clone, Default)]
pub(super) struct Offsets {
    /// Variance of the length of proximal and distal bones in each recording, m².
    length_variances: [[Vec<f64>; 2]; 2],
    /// Sum of squared errors of the hinge angle, rad², less what white noise makes of them.
    squared_error: [f64; 2],
    /// Sum of what an offset of one metre would make of them.
    leverage: [f64; 2],
    blocks: [u64; 2],
}

fn group(limb: Limb) -> usize {
    usize::from(!limb.is_arm())
}

impl Offsets {
    /// Adds a recording of a movement.
    pub(super) fn add(&mut self, recording: &Recording, observations: &Observations) {
        let white = white_noise(observations);
        let variances = length_variances(observations, &white);
        for (bone, variance) in variances.into_iter().enumerate() {
            self.length_variances[group(Limb::ALL[bone / 2])][bone % 2].extend(variance);
        }
        for limb in Limb::ALL {
            let channel = if limb.is_arm() { AngleChannel::ElbowFlexion } else { AngleChannel::KneeFlexion };
            let channel = channel(limb.side()).name();
            if let Some(reference) = recording.references.iter().find(|reference| reference.channel == channel) {
                self.add_hinge(limb, reference, observations, &white);
            }
        }
    }

    fn add_hinge(
        &mut self,
        limb: Limb,
        reference: &ReferenceSeries,
        observations: &Observations,
        white: &[Vector3<f64>; POINT_COUNT],
    ) {
        let columns: [usize; 3] = std::array::from_fn(|level| point_index(limb, level));
        let group = group(limb);
        for start in (0..observations.len()).step_by(BLOCK_FRAMES) {
            let (mut places, mut truth, mut count) = ([Vector3::zeros(); 3], 0.0, 0.0);
            for t in start..(start + BLOCK_FRAMES).min(observations.len()) {
                let time = observations.time_ns[t] - reference.clock_offset_ns;
                let angle = interpolate(&reference.time_ns, &reference.values, time).to_radians();
                let points = columns.map(|p| observations.points[t][p]);
                if angle.is_finite() && points.iter().all(|point| point.x.is_finite()) {
                    places.iter_mut().zip(points).for_each(|(sum, point)| *sum += point);
                    truth += angle;
                    count += 1.0;
                }
            }
            let [a, b, c] = places.map(|sum| sum / count);
            let (upper, lower) = ((b - a).norm(), (c - b).norm());
            let is_known = 2.0 * count > BLOCK_FRAMES as f64 && upper > MIN_BONE_M && lower > MIN_BONE_M;
            if !is_known {
                continue;
            }
            let angle = flexion_of_three_points(&a, &b, &c);
            let (proximal, distal) = (upper.powi(-2), lower.powi(-2));
            let leverage = [proximal, proximal + distal + 2.0 * angle.cos() / (upper * lower), distal];
            let by_white = columns.iter().zip(leverage).map(|(p, by)| by * white[*p].norm_squared() / 3.0 / count);
            self.squared_error[group] += (angle - truth / count).powi(2) - by_white.sum::<f64>();
            self.leverage[group] += leverage.iter().sum::<f64>();
            self.blocks[group] += 1;
        }
    }

    /// `reference`, `bone_lengths` or `none`, of arms or legs.
    pub(super) fn source(&self, arms: bool) -> &'static str {
        let group = usize::from(!arms);
        if self.blocks[group] >= MIN_BLOCKS {
            "reference"
        } else if self.length_variances[group].iter().any(|variances| !variances.is_empty()) {
            "bone_lengths"
        } else {
            "none"
        }
    }

    /// Standard deviation of the offset of each point's coordinates, metres; 0 when nothing is known of it.
    pub(super) fn standard_deviations(&self) -> [f64; POINT_COUNT] {
        let mut offsets = [0.0; POINT_COUNT];
        for limb in Limb::ALL {
            let group = group(limb);
            let variance = |part: usize| median(&self.length_variances[group][part]);
            for level in 0..3 {
                offsets[point_index(limb, level)] = if self.source(limb.is_arm()) == "reference" {
                    (self.squared_error[group].max(0.0) / self.leverage[group]).sqrt()
                } else {
                    offset_of_length_variance(match level {
                        0 => variance(0),
                        1 => 0.5 * (variance(0) + variance(1)),
                        _ => variance(1),
                    })
                };
            }
        }
        offsets
    }
}

/// Median of numbers; 0 of none.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::random::RandomStreams;
    use nalgebra::Rotation3;

    /// Legs bent by an angle, whose points are displaced anew every second by an offset of an SD in metres.
    fn bent_legs(flexion: f64, sd: f64, seconds: usize) -> (Recording, Observations) {
        let mut streams = RandomStreams::new(3);
        let mut points = Vec::new();
        for _ in 0..seconds {
            let place = |p: usize| match p % 3 {
                0 => Vector3::y() * 0.9,
                1 => Vector3::y() * 0.45,
                _ => Vector3::new(0.4 * flexion.sin(), 0.45 - 0.4 * flexion.cos(), 0.0),
            };
            let displaced: [Vector3<f64>; POINT_COUNT] =
                std::array::from_fn(|p| place(p) + Vector3::from_fn(|_, _| sd * streams.normal()));
            points.extend([displaced; 30]);
        }
        let time_ns: Vec<i64> = (0..points.len() as i64).map(|t| t * 33_333_333).collect();
        let reference = |channel: &str| ReferenceSeries {
            channel: channel.into(),
            time_ns: time_ns.clone(),
            values: vec![flexion.to_degrees(); points.len()],
            ..ReferenceSeries::default()
        };
        let references = vec![reference("left_knee_flexion_deg"), reference("right_knee_flexion_deg")];
        let observations = Observations { time_ns, points, subject_from_world: Rotation3::identity() };
        (Recording { references, ..Recording::default() }, observations)
    }

    #[test]
    fn the_error_of_an_angle_shows_the_offset_of_its_points() {
        for flexion in [0.5f64, 1.2, 2.0] {
            let (recording, observations) = bent_legs(flexion, 0.02, 400);
            let mut offsets = Offsets::default();
            offsets.add(&recording, &observations);
            assert_eq!((offsets.source(true), offsets.source(false)), ("bone_lengths", "reference"));
            let found = offsets.standard_deviations()[point_index(Limb::LeftLeg, 1)];
            // 800 independent offsets: a standard error of 2.5 %, and the curvature of the angle.
            assert!((found / 0.02 - 1.0).abs() < 0.1, "{flexion}: {found}");
        }
    }

    #[test]
    fn white_noise_is_no_slow_offset() {
        let (recording, mut observations) = bent_legs(1.0, 0.0, 60);
        let mut streams = RandomStreams::new(4);
        for frame in &mut observations.points {
            frame.iter_mut().for_each(|point| *point += Vector3::from_fn(|_, _| 0.03 * streams.normal()));
        }
        let mut offsets = Offsets::default();
        offsets.add(&recording, &observations);
        let found = offsets.standard_deviations()[point_index(Limb::LeftLeg, 1)];
        assert!(found < 0.004, "{found}");
    }

    #[test]
    fn without_a_reference_the_bones_are_asked_and_without_bones_nothing_is_claimed() {
        let (mut recording, observations) = bent_legs(1.0, 0.02, 60);
        recording.references.clear();
        let mut offsets = Offsets::default();
        assert_eq!((offsets.source(false), offsets.standard_deviations()), ("none", [0.0; POINT_COUNT]));
        offsets.add(&recording, &observations);
        assert_eq!(offsets.source(false), "bone_lengths");
        assert!(offsets.standard_deviations().iter().all(|sd| *sd > 0.02), "{:?}", offsets.standard_deviations());
    }
}
