//! The result's samples: when they are, and the series of angles and places.

use super::camera::CameraBody;
use super::motion::UnitMotion;
use super::place::Places;
use crate::assessment::series::FLAG_BRIDGED;
use crate::assessment::{Series, Warning};
use crate::body::kinematics::forward_kinematics;
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, Skeleton};
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::events::Repairs;
use crate::pipeline::joint_angles::observation::{ALL_SEEN, SeenMask};
use crate::pipeline::joint_angles::posterior::Summary;
use crate::pipeline::joint_angles::series_builder::SeriesBuilder;
use crate::progress::{Monitor, Step};
use nalgebra::Vector3;

/// Half the width of a 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_985;

/// Highest rate of a result, samples per second.
const HIGHEST_RATE_HZ: f64 = 1000.0;

/// Most samples of a result: an hour at 256 Hz, a gigabyte in 73 channels.
const MOST_SAMPLES: usize = 1_000_000;

/// Regular times of the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    first_ns: i64,
    step_ns: f64,
    /// Number of samples.
    pub len: usize,
}

impl Grid {
    /// From the time at which the units are worn over all that the camera saw, or without one over all that units
    /// recorded; at `rate_hz`, or the units' own median rate. `None` when nothing is left.
    pub fn of(
        camera: Option<&CameraBody>,
        motions: &[UnitMotion],
        worn_from_ns: i64,
        rate_hz: Option<f64>,
    ) -> Option<Self> {
        let spans = || motions.iter().filter_map(UnitMotion::span_ns);
        let units = [spans().map(|s| s[0]).min()?, spans().map(|s| s[1]).max()?];
        let [first, last] = match camera {
            Some(camera) => [*camera.observations.time_ns.first()?, *camera.observations.time_ns.last()?],
            None => units,
        };
        if units[1] <= first || units[0] >= last {
            return None;
        }
        let first_ns = first.max(worn_from_ns);
        let rate_hz = rate_hz.unwrap_or(median_rate(motions)?.min(HIGHEST_RATE_HZ));
        let step_ns = 1e9 / rate_hz;
        let len = ((last - first_ns) as f64 / step_ns).floor() + 1.0;
        (len >= 2.0).then_some(Self { first_ns, step_ns, len: len as usize })
    }

    /// The same time with at most [`MOST_SAMPLES`]: fewer per second unless somebody asked for their number.
    ///
    /// # Errors
    /// `too_many_samples` when somebody did.
    pub fn bounded(self, is_asked_for: bool, warnings: &mut Vec<Warning>) -> Result<Self, PipelineError> {
        if self.len <= MOST_SAMPLES {
            return Ok(self);
        }
        let (n, rate_hz) = (self.len, self.rate_hz());
        if is_asked_for {
            let sentence = format!(
                "{rate_hz:.0} samples per second make a result of {n} samples, and {MOST_SAMPLES} is the most; ask for a \
                 lower rate_hz, or cut the recording"
            );
            return Err(PipelineError::unsuitable("too_many_samples", sentence));
        }
        let step_ns = self.step_ns * (n - 1) as f64 / (MOST_SAMPLES - 1) as f64;
        let grid = Self { step_ns, len: MOST_SAMPLES, ..self };
        warnings.push(Warning::new(
            "rate_reduced",
            format!(
                "the result has {:.1} samples per second in place of the units' {rate_hz:.1}: the recording is long",
                grid.rate_hz()
            ),
        ));
        Ok(grid)
    }

    /// Time of sample `i`, nanoseconds.
    pub fn time_ns(&self, i: usize) -> i64 {
        self.first_ns + (i as f64 * self.step_ns).round() as i64
    }

    /// All times, nanoseconds.
    pub fn times_ns(&self) -> Vec<i64> {
        (0..self.len).map(|i| self.time_ns(i)).collect()
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> f64 {
        1e9 / self.step_ns
    }
}

/// Median over the units of the median rate, samples per second.
fn median_rate(motions: &[UnitMotion]) -> Option<f64> {
    let of_unit = |motion: &UnitMotion| {
        let steps = motion.stretches.iter().flat_map(|s| s.time_ns.windows(2).map(|w| w[1] - w[0]));
        let mut steps: Vec<i64> = steps.collect();
        let middle = steps.len().checked_sub(1)? / 2;
        Some(1e9 / *steps.select_nth_unstable(middle).1 as f64)
    };
    let mut rates: Vec<f64> = motions.iter().filter_map(of_unit).collect();
    let middle = rates.len().checked_sub(1)? / 2;
    Some(*rates.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Where the joints are, and in which frame the result names them.
#[derive(Debug)]
pub struct Placed<'a> {
    /// Places of torso and limbs.
    pub places: &'a Places,
    /// The camera's body.
    pub camera: &'a CameraBody,
}

/// The series of all angles, and with a camera of all joints' places; `sample` estimates one of them.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn build(
    grid: &Grid,
    skeleton: &Skeleton,
    placed: Option<&Placed<'_>>,
    monitor: &Monitor,
    mut sample: impl FnMut(usize, i64) -> Summary,
) -> Result<Vec<Series>, PipelineError> {
    let mut angles = SeriesBuilder::new(grid.len, Repairs::default());
    let mut joints = placed.map(|placed| JointSeries::new(placed, grid.len));
    monitor.begin(Step::Summarizing, grid.len as u64)?;
    for i in 0..grid.len {
        let time_ns = grid.time_ns(i);
        let summary = sample(i, time_ns);
        angles.push(&summary);
        if let Some(joints) = &mut joints {
            joints.push(time_ns, skeleton, &summary);
        }
        monitor.advance(1)?;
    }
    let mut series = angles.finish();
    if placed.is_none() {
        // Without a camera there is nothing that could bridge what no unit shows.
        series.iter_mut().for_each(forget_bridged);
    }
    series.extend(joints.map_or_else(Vec::new, |joints| joints.series));
    Ok(series)
}

/// Takes out values that no unit shows.
fn forget_bridged(series: &mut Series) {
    for i in 0..series.value.len() {
        if series.flags[i] & FLAG_BRIDGED != 0 {
            (series.value[i], series.low[i], series.high[i]) = (f32::NAN, f32::NAN, f32::NAN);
        }
    }
}

/// Places of the torso and the twelve points in the camera's `world`, metres.
struct JointSeries<'a> {
    placed: &'a Placed<'a>,
    series: Vec<Series>,
}

impl<'a> JointSeries<'a> {
    fn new(placed: &'a Placed<'a>, len: usize) -> Self {
        let points = Limb::ALL.into_iter().flat_map(|limb| limb.joints().map(|(joint, _)| joint));
        let joints = std::iter::once(Joint::Torso).chain(points);
        let channels = joints.flat_map(|joint| ["x", "y", "z"].map(|axis| format!("{}_{axis}_m", joint.name())));
        let series = channels.map(|channel| {
            let mut series = Series::empty(channel, 0);
            for column in [&mut series.value, &mut series.low, &mut series.high] {
                column.reserve_exact(len);
            }
            series.flags.reserve_exact(len);
            series
        });
        Self { placed, series: series.collect() }
    }

    fn push(&mut self, time_ns: i64, skeleton: &Skeleton, summary: &Summary) {
        let own = forward_kinematics(skeleton, &summary.pose);
        let (torso, points, sd) = self.placed.places.at(time_ns, &own);
        let world_from_subject = self.placed.camera.observations.subject_from_world.inverse();
        let half = if summary.spread.is_some() { Z95 * sd } else { f64::NAN };
        let mut columns = self.series.iter_mut();
        let mut push = |place: &Vector3<f64>, flags: u8| {
            for value in (world_from_subject * place).iter() {
                let Some(series) = columns.next() else { return };
                series.value.push(*value as f32);
                series.low.push((value - half) as f32);
                series.high.push((value + half) as f32);
                series.flags.push(flags);
            }
        };
        push(&torso, 0);
        for limb in Limb::ALL {
            for level in 0..3 {
                let p = point_index(limb, level);
                push(&points[p], flags_of(summary.seen, limb, level));
            }
        }
    }
}

/// A place is bridged when some point of the chain to it was not seen.
fn flags_of(seen: SeenMask, limb: Limb, level: usize) -> u8 {
    let needed = ((1 << (level + 1)) - 1) << point_index(limb, 0) & ALL_SEEN;
    if seen & needed == needed { 0 } else { FLAG_BRIDGED }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Bone;
    use crate::pipeline::skeleton_fusion::motion::Stretch;
    use nalgebra::UnitQuaternion;

    fn unit(first_ns: i64, step_ns: i64, n: i64) -> UnitMotion {
        let time_ns: Vec<i64> = (0..n).map(|i| first_ns + i * step_ns).collect();
        let n = time_ns.len();
        let stretch = Stretch {
            time_ns,
            earth_from_imu: vec![UnitQuaternion::identity(); n],
            angular_rate: vec![Vector3::zeros(); n],
            inclination_sd: None,
        };
        UnitMotion { bone: Bone::Trunk, is_by_scheme: true, main_axis: None, stretches: vec![stretch] }
    }

    #[test]
    fn without_a_camera_samples_run_over_all_units_at_their_median_rate_or_the_one_asked_for() {
        let units = [unit(0, 4_000_000, 1000), unit(1_000_000_000, 4_000_000, 1000), unit(0, 10_000_000, 300)];
        let grid = Grid::of(None, &units, i64::MIN, None).unwrap();
        assert_eq!((grid.rate_hz(), grid.time_ns(0), grid.time_ns(1)), (250.0, 0, 4_000_000));
        assert_eq!(grid.time_ns(grid.len - 1), 4_996_000_000);
        let slow = Grid::of(None, &units, 2_000_000_000, Some(10.0)).unwrap();
        assert_eq!((slow.time_ns(0), slow.len), (2_000_000_000, 30));
        assert_eq!(Grid::of(None, &units, 9_000_000_000, None), None);
        assert_eq!(Grid::of(None, &[], 0, None), None);
    }

    #[test]
    fn a_joint_is_bridged_when_the_chain_to_it_is_not_seen() {
        let seen = ALL_SEEN & !(1 << point_index(Limb::LeftLeg, 1));
        assert_eq!([0, 1, 2].map(|level| flags_of(seen, Limb::LeftLeg, level)), [0, FLAG_BRIDGED, FLAG_BRIDGED]);
        assert_eq!(flags_of(seen, Limb::RightLeg, 2), 0);
    }
}
