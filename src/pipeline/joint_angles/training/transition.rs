//! How far joints turn from frame to frame: Σθ.
//!
//! Angles are interpolated on a grid of 1/30 s, and the mean square of their differences is the variance of the random
//! walk of \[angles\]. On the sensor's own frames the same movement would give another variance at another frame rate,
//! because movements are smooth and a random walk is not.

use super::skeleton_of;
use crate::assessment::noise_model::TransitionNoise;
use crate::assessment::series::FLAG_BRIDGED;
use crate::assessment::{AngleChannel, JointAngleSettings, Series};
use crate::body::Limb;
use crate::body::pose::{POSE_DIMENSION, attitude_offset, hinge_offset};
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::assess;
use crate::pipeline::joint_angles::noise_model::TRANSITION_RATE_HZ;
use crate::progress::Monitor;
use crate::recording::{Recording, ReferenceSeries};
use crate::signal::interpolation::interpolate;

/// Differences beyond this are no movement but the jump of an attitude vector to its other branch, degrees in 1/30 s
/// (a thousand degrees a second and more).
const MAX_TURN_DEG: f64 = 45.0;
/// Least standard deviation, degrees: a joint that rested in training may move later.
const MIN_SD_DEG: f64 = 0.1;

/// Sums of squared turns of each element of θ.
#[derive(Debug, Clone, Default)]
pub(super) struct Turns {
    sum_deg2: [f64; POSE_DIMENSION],
    count: [u64; POSE_DIMENSION],
    from_reference: bool,
    from_estimate: bool,
}

/// The channel of each element of θ, in the order of θ.
fn channels() -> [String; POSE_DIMENSION] {
    std::array::from_fn(|i| {
        let channel = match i {
            0..3 => AngleChannel::TrunkAttitude(i),
            3..15 => {
                let (limb, axis) = (Limb::ALL[(i - 3) / 3], (i - 3) % 3);
                let attitude = if limb.is_arm() { AngleChannel::ShoulderAttitude } else { AngleChannel::HipAttitude };
                attitude(limb.side(), axis)
            }
            _ => {
                let limb = Limb::ALL[i - 15];
                let flexion = if limb.is_arm() { AngleChannel::ElbowFlexion } else { AngleChannel::KneeFlexion };
                flexion(limb.side())
            }
        };
        channel.name()
    })
}

impl Turns {
    /// Adds a recording: its reference angles, and estimates of those that it has no reference of. The answer is the
    /// time over which most joints were seen, seconds.
    ///
    /// # Errors
    /// What an assessment refuses; [`PipelineError::Cancelled`].
    pub(super) fn add(&mut self, recording: &Recording, monitor: &Monitor) -> Result<f64, PipelineError> {
        let skeleton = skeleton_of(recording)?;
        let channels = channels();
        let reference = |channel: &String| recording.references.iter().find(|r| r.channel == *channel);
        let is_complete = channels.iter().all(|channel| reference(channel).is_some());
        let estimate =
            if is_complete { None } else { Some(assess(recording, &JointAngleSettings::default(), monitor)?) };
        let grid = grid(&skeleton.time_ns);
        let before: u64 = self.count.iter().sum();
        for (i, channel) in channels.iter().enumerate() {
            let values = if let Some(reference) = reference(channel) {
                self.from_reference = true;
                reference_on(reference, &grid)
            } else if let Some(found) = &estimate {
                self.from_estimate = true;
                let series = found.series.iter().find(|series| series.channel == *channel);
                series.map_or_else(Vec::new, |series| estimate_on(series, &found.time_ns, &grid))
            } else {
                Vec::new()
            };
            for pair in values.windows(2) {
                let turn = pair[1] - pair[0];
                if turn.abs() < MAX_TURN_DEG {
                    self.sum_deg2[i] += turn.powi(2);
                    self.count[i] += 1;
                }
            }
        }
        let turns = self.count.iter().sum::<u64>() - before;
        Ok(turns as f64 / POSE_DIMENSION as f64 / TRANSITION_RATE_HZ)
    }

    /// Where the turns come from; `None` when there are none.
    pub(super) fn source(&self) -> Option<&'static str> {
        match (self.from_reference, self.from_estimate) {
            (true, true) => Some("reference_and_estimate"),
            (true, false) => Some("reference"),
            (false, true) => Some("estimate"),
            (false, false) => None,
        }
    }

    /// Standard deviations, left and right averaged, degrees.
    pub(super) fn standard_deviations_deg(&self) -> TransitionNoise {
        let sd = |elements: &[usize]| {
            let sum: f64 = elements.iter().map(|i| self.sum_deg2[*i]).sum();
            let count: u64 = elements.iter().map(|i| self.count[*i]).sum();
            super::rounded((sum / count.max(1) as f64).sqrt().max(MIN_SD_DEG))
        };
        let of_limbs = |left: Limb, right: Limb, offset: fn(usize) -> usize, axis: usize| {
            sd(&[offset(left.index()) + axis, offset(right.index()) + axis])
        };
        let arms = |offset, axis| of_limbs(Limb::LeftArm, Limb::RightArm, offset, axis);
        let legs = |offset, axis| of_limbs(Limb::LeftLeg, Limb::RightLeg, offset, axis);
        TransitionNoise {
            trunk: std::array::from_fn(|axis| sd(&[axis])),
            shoulder: std::array::from_fn(|axis| arms(attitude_offset, axis)),
            elbow: arms(hinge_offset, 0),
            hip: std::array::from_fn(|axis| legs(attitude_offset, axis)),
            knee: legs(hinge_offset, 0),
        }
    }
}

/// Times 1/30 s apart over a recording, nanoseconds.
fn grid(time_ns: &[i64]) -> Vec<i64> {
    let (Some(first), Some(last)) = (time_ns.first(), time_ns.last()) else { return Vec::new() };
    let steps = ((last - first) as f64 * 1e-9 * TRANSITION_RATE_HZ) as i64;
    (0..=steps).map(|step| first + (step as f64 * 1e9 / TRANSITION_RATE_HZ) as i64).collect()
}

fn reference_on(reference: &ReferenceSeries, grid: &[i64]) -> Vec<f64> {
    let at = |time: &i64| interpolate(&reference.time_ns, &reference.values, time - reference.clock_offset_ns);
    grid.iter().map(at).collect()
}

/// Bridged values are the method's own movement and count as missing.
fn estimate_on(series: &Series, time_ns: &[i64], grid: &[i64]) -> Vec<f64> {
    let value = |(value, flags): (&f32, &u8)| if flags & FLAG_BRIDGED == 0 { f64::from(*value) } else { f64::NAN };
    let values: Vec<f64> = series.value.iter().zip(&series.flags).map(value).collect();
    grid.iter().map(|time| interpolate(time_ns, &values, *time)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::SkeletonRecording;

    #[test]
    fn channels_stand_in_the_order_of_the_state() {
        let names = channels();
        assert_eq!(names[attitude_offset(Limb::RightLeg.index()) + 2], "right_hip_attitude_z_deg");
        assert_eq!(names[attitude_offset(Limb::LeftArm.index())], "left_shoulder_attitude_x_deg");
        assert_eq!(names[hinge_offset(Limb::RightArm.index())], "right_elbow_flexion_deg");
        assert_eq!(names[hinge_offset(Limb::LeftLeg.index())], "left_knee_flexion_deg");
    }

    /// Frames at a rate, with a reference of its own rate that turns every joint by `deg_per_s`.
    fn turning(deg_per_s: f64, rate_hz: f64, reference_hz: f64) -> Recording {
        let times = |rate: f64| (0..(20.0 * rate) as i64).map(|t| (t as f64 * 1e9 / rate) as i64).collect::<Vec<_>>();
        let time_ns = times(reference_hz);
        let values: Vec<f64> = time_ns.iter().map(|t| deg_per_s * *t as f64 * 1e-9).collect();
        let references = channels().map(|channel| ReferenceSeries {
            channel,
            time_ns: time_ns.clone(),
            values: values.clone(),
            ..ReferenceSeries::default()
        });
        let skeleton = SkeletonRecording { time_ns: times(rate_hz), ..SkeletonRecording::default() };
        Recording { skeleton: Some(skeleton), references: references.into(), ..Recording::default() }
    }

    #[test]
    fn the_spread_of_turns_is_the_same_whatever_the_rates_of_sensor_and_reference_are() {
        for (rate, reference) in [(30.0, 30.0), (15.0, 100.0), (25.0, 60.0)] {
            let mut turns = Turns::default();
            let seconds = turns.add(&turning(60.0, rate, reference), &Monitor::default()).unwrap();
            assert!((seconds - 20.0).abs() < 0.2, "{seconds}");
            let found = turns.standard_deviations_deg();
            assert!((found.knee - 2.0).abs() < 0.01 && (found.hip[1] - 2.0).abs() < 0.01, "{found:?}");
            assert_eq!(turns.source(), Some("reference"));
        }
    }

    #[test]
    fn a_joint_that_rests_keeps_a_little_freedom_and_a_jump_to_the_other_branch_is_no_turn() {
        let mut recording = turning(0.0, 30.0, 30.0);
        recording.references[0].values[100] = 300.0;
        let mut turns = Turns::default();
        turns.add(&recording, &Monitor::default()).unwrap();
        assert_eq!(turns.standard_deviations_deg().trunk, [MIN_SD_DEG; 3]);
    }

    #[test]
    fn left_and_right_are_averaged_as_variances() {
        let mut turns = Turns::default();
        for (limb, sum) in [(Limb::LeftLeg, 100.0), (Limb::RightLeg, 700.0)] {
            turns.sum_deg2[hinge_offset(limb.index())] = sum;
            turns.count[hinge_offset(limb.index())] = 100;
        }
        assert_eq!(turns.standard_deviations_deg().knee, 2.0);
    }
}
