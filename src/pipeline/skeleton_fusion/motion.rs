//! How each unit turned over time, on the camera's clock.
//!
//! A unit that was lost for a moment has turned meanwhile, nobody knows how far about the vertical. Its samples therefore
//! fall into *stretches* without a gap; each stretch is filtered by itself and has a heading of its own.

use crate::body::Bone;
use crate::estimation::orientation_filter::madgwick::{self, DEFAULT_GAIN};
use crate::estimation::orientation_filter::smoother::{self, SmootherSettings};
use crate::estimation::orientation_filter::{
    InertialSamples, OrientationError, OrientationEstimate, OrientationMethod, estimate,
};
use crate::recording::InertialSensor;
use crate::recording::inertial::MOUNTING_SCHEME;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Longest time between two samples across which rates are still integrated, seconds. The fastest limb (10 rad/s,
/// changing direction within a quarter of a second) has turned by an unknown 10° or so after it.
const LONGEST_GAP_S: f64 = 0.1;

/// Shortest stretch that is of use, seconds: the filters need that long to tell gravity from movement.
const SHORTEST_STRETCH_S: f64 = 1.0;

/// Angular rate from which on a unit turns rather than sways, rad/s (30 °/s), and the samples in which it must.
const TURNING_RATE: f64 = 30.0 * std::f64::consts::PI / 180.0;
const TURNING_SAMPLES: u32 = 20;
/// Share of all turning (sum of squared rates) about one axis from which on it is the main one.
const MAIN_SHARE: f64 = 0.8;

/// Orientation of one unit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitMotion {
    /// The bone that the unit is worn on.
    pub bone: Bone,
    /// True when the recording says that the unit is mounted by the scheme.
    pub is_by_scheme: bool,
    /// Axis in the unit's frame about which it mostly turned; none when there is no such axis.
    pub main_axis: Option<Vector3<f64>>,
    /// Stretches by time.
    pub stretches: Vec<Stretch>,
}

/// Samples without a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Time of each sample on the camera's clock, nanoseconds, strictly increasing.
    pub time_ns: Vec<i64>,
    /// Rotation from the unit into `earth` (y up, a heading that belongs to the stretch).
    pub earth_from_imu: Vec<UnitQuaternion<f64>>,
    /// Angular rate in the unit's frame, rad/s, with its bias as the filter knows it taken out.
    pub angular_rate: Vec<Vector3<f64>>,
    /// Standard deviation of the inclination where the filter knows it, median over the stretch, radians.
    pub inclination_sd: Option<f64>,
}

impl Stretch {
    /// Orientation at a time, along the shortest arc between the samples around it; none outside them.
    pub fn at(&self, time_ns: i64) -> Option<UnitQuaternion<f64>> {
        let after = self.first_from(time_ns);
        let later = self.earth_from_imu.get(after)?;
        if self.time_ns[after] == time_ns {
            return Some(*later);
        }
        let before = after.checked_sub(1)?;
        let share = (time_ns - self.time_ns[before]) as f64 / (self.time_ns[after] - self.time_ns[before]) as f64;
        let from = self.earth_from_imu[before].into_inner();
        // Neighbouring samples are a few degrees apart: the chord is the arc to a part in ten thousand of that.
        let to = if from.dot(&later.into_inner()) < 0.0 { -later.into_inner() } else { later.into_inner() };
        Some(UnitQuaternion::new_normalize(from * (1.0 - share) + to * share))
    }

    /// The first sample that is not before a time. Samples are almost regular, so it is looked for where it should be.
    fn first_from(&self, time_ns: i64) -> usize {
        const NEAR: usize = 8;
        let n = self.time_ns.len();
        let Some([first, last]) = self.span_ns() else { return 0 };
        let share = (time_ns - first) as f64 / (last - first).max(1) as f64;
        let guess = (share * (n - 1) as f64).clamp(0.0, (n - 1) as f64) as usize;
        let (low, high) = (guess.saturating_sub(NEAR), (guess + NEAR).min(n));
        let is_inside = self.time_ns[low] < time_ns && self.time_ns[high - 1] >= time_ns;
        let (low, high) = if is_inside { (low, high) } else { (0, n) };
        low + self.time_ns[low..high].partition_point(|time| *time < time_ns)
    }

    /// First and last time, nanoseconds.
    pub fn span_ns(&self) -> Option<[i64; 2]> {
        Some([*self.time_ns.first()?, *self.time_ns.last()?])
    }
}

impl UnitMotion {
    /// The stretch that holds a time, and the orientation then.
    pub fn at(&self, time_ns: i64) -> Option<(usize, UnitQuaternion<f64>)> {
        let stretch = self.stretches.partition_point(|s| s.span_ns().is_some_and(|[_, last]| last < time_ns));
        Some((stretch, self.stretches.get(stretch)?.at(time_ns)?))
    }

    /// First and last time of all samples, nanoseconds.
    pub fn span_ns(&self) -> Option<[i64; 2]> {
        Some([self.stretches.first()?.span_ns()?[0], self.stretches.last()?.span_ns()?[1]])
    }
}

/// How a unit's orientation is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionSettings {
    /// The filter.
    pub method: OrientationMethod,
    /// Gain of `madgwick`, rad/s; its default without.
    pub gain: Option<f64>,
    /// Whether a gap ends a stretch. The paper's filter knows no gaps: it goes on after one as if nothing had turned.
    pub splits_at_gaps: bool,
    /// Bias of the gyroscope that is known from a rest, rad/s.
    pub bias: Vector3<f64>,
}

/// Turns one unit's samples into its motion. `camera_time` maps the unit's clock to the camera's, nanoseconds, strictly
/// increasing.
///
/// # Errors
/// [`OrientationError`] when the samples contradict themselves.
pub fn motion_of_unit(
    unit: &InertialSensor,
    bone: Bone,
    camera_time: impl Fn(i64) -> i64,
    settings: &MotionSettings,
) -> Result<UnitMotion, OrientationError> {
    let whole = std::iter::once(0..unit.len()).collect();
    let ranges: Vec<Range<usize>> = if settings.splits_at_gaps { ranges_without_gap(&unit.time_ns) } else { whole };
    let mut stretches = Vec::new();
    for range in ranges {
        let rates: Vec<Vector3<f64>> = unit.angular_rate[range.clone()].iter().map(|r| r - settings.bias).collect();
        let samples = InertialSamples {
            time_ns: &unit.time_ns[range.clone()],
            acceleration: &unit.acceleration[range],
            angular_rate: &rates,
        };
        let estimate = match settings.method {
            OrientationMethod::Madgwick => madgwick::estimate(&samples, settings.gain.unwrap_or(DEFAULT_GAIN), None)?,
            OrientationMethod::Smoother => smoother::estimate(&samples, &of_worn_unit())?,
            other => estimate(other, &samples)?,
        };
        stretches.push(Stretch {
            time_ns: samples.time_ns.iter().map(|time| camera_time(*time)).collect(),
            angular_rate: without_bias(&rates, &estimate),
            inclination_sd: median(&estimate.inclination_sd),
            earth_from_imu: estimate.earth_from_sensor,
        });
    }
    let is_by_scheme = unit.mounting.as_deref() == Some(MOUNTING_SCHEME);
    Ok(UnitMotion { bone, is_by_scheme, main_axis: main_axis(&stretches), stretches })
}

/// A person who seems to rest sways: half a degree within a rest of a second or two is no bias.
fn of_worn_unit() -> SmootherSettings {
    SmootherSettings { rate_bias_at_rest_sd: 0.5_f64.to_radians(), ..SmootherSettings::default() }
}

/// Ranges of samples that follow each other without a gap and are long enough to be of use.
fn ranges_without_gap(time_ns: &[i64]) -> Vec<Range<usize>> {
    let mut ranges = Vec::new();
    let mut start = 0;
    for end in 1..=time_ns.len() {
        let is_end = end == time_ns.len() || (time_ns[end] - time_ns[end - 1]) as f64 * 1e-9 > LONGEST_GAP_S;
        if is_end {
            if (time_ns[end - 1] - time_ns[start]) as f64 * 1e-9 >= SHORTEST_STRETCH_S {
                ranges.push(start..end);
            }
            start = end;
        }
    }
    ranges
}

/// The axis that turns are about when most of them are about one.
fn main_axis(stretches: &[Stretch]) -> Option<Vector3<f64>> {
    let rates = stretches.iter().flat_map(|stretch| &stretch.angular_rate).filter(|rate| rate.norm() > TURNING_RATE);
    let (mut sum, mut n) = (Matrix3::zeros(), 0_u32);
    for rate in rates {
        sum += rate * rate.transpose();
        n += 1;
    }
    let eigen = sum.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let is_main = n >= TURNING_SAMPLES && eigen.eigenvalues[largest] > MAIN_SHARE * sum.trace();
    is_main.then(|| eigen.eigenvectors.column(largest).into_owned())
}

fn without_bias(rates: &[Vector3<f64>], estimate: &OrientationEstimate) -> Vec<Vector3<f64>> {
    if estimate.bias.is_empty() {
        return rates.to_vec();
    }
    rates.iter().zip(&estimate.bias).map(|(rate, bias)| rate - bias).collect()
}

fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    let middle = sorted.len().checked_sub(1)? / 2;
    Some(*sorted.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Segment;

    const SETTINGS: MotionSettings = MotionSettings {
        method: OrientationMethod::Smoother,
        gain: None,
        splits_at_gaps: true,
        bias: Vector3::new(0.0, 0.0, 0.0),
    };

    /// A unit at 100 Hz that swings about an axis of its own like a pendulum, gravity along z at first.
    fn swinging(axis: Vector3<f64>, lost: Range<usize>) -> InertialSensor {
        let mut unit = InertialSensor::new(Segment::LeftShank);
        for i in (0..1000).filter(|i| !lost.contains(i)) {
            let t = i as f64 * 0.01;
            unit.time_ns.push(i as i64 * 10_000_000);
            let turn = nalgebra::Rotation3::new(axis * (2.0 * t).sin());
            unit.acceleration.push(turn.inverse() * Vector3::z() * 9.81);
            unit.angular_rate.push(axis * (2.0 * (2.0 * t).cos()));
        }
        unit
    }

    #[test]
    fn a_gap_ends_a_stretch_and_the_paper_s_filter_goes_on() {
        let unit = swinging(Vector3::x(), 400..430);
        let bone = Bone::ALL[6];
        let motion = motion_of_unit(&unit, bone, |t| t + 5, &SETTINGS).unwrap();
        let spans: Vec<_> = motion.stretches.iter().filter_map(Stretch::span_ns).collect();
        assert_eq!(spans, [[5, 3_990_000_005], [4_300_000_005, 9_990_000_005]]);
        assert_eq!(motion.at(4_100_000_000), None);
        let paper = MotionSettings { splits_at_gaps: false, ..SETTINGS };
        assert_eq!(motion_of_unit(&unit, bone, |t| t, &paper).unwrap().stretches.len(), 1);
    }

    #[test]
    fn the_orientation_between_samples_lies_on_the_arc() {
        let motion = motion_of_unit(&swinging(Vector3::x(), 0..0), Bone::ALL[6], |t| t, &SETTINGS).unwrap();
        let at = |t| motion.at(t).unwrap().1;
        let (a, middle, b) = (at(1_000_000_000), at(1_005_000_000), at(1_010_000_000));
        assert!((a.angle_to(&middle) - middle.angle_to(&b)).abs() < 1e-6);
        assert!((a.angle_to(&middle) + middle.angle_to(&b) - a.angle_to(&b)).abs() < 1e-9);
    }

    #[test]
    fn a_unit_that_swings_about_one_axis_has_it_as_its_main_axis() {
        let axis = Vector3::new(0.6, 0.0, 0.8);
        let motion = motion_of_unit(&swinging(axis, 0..0), Bone::ALL[6], |t| t, &SETTINGS).unwrap();
        assert!(motion.main_axis.unwrap().dot(&axis).abs() > 0.999);
        let resting = motion_of_unit(&swinging(axis * 1e-3, 0..0), Bone::ALL[6], |t| t, &SETTINGS).unwrap();
        assert_eq!(resting.main_axis, None);
    }
}
