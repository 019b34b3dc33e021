//! What camera and units both see of a segment, on a regular grid of each one's own clock.
//!
//! Two quantities need no knowledge of attitude or of how a unit is mounted:
//!
//! ```text
//!            unit                 camera
//! force      |smooth(a)|          |smooth(p̈) + g|      p a point of the segment, g upwards
//! rate       |smooth(ω)|          |d × smooth(ḋ)|      d the direction of its bone
//! ```
//!
//! The force carries jumps: both fall to zero in flight. The rate carries every swing of a limb; the unit also sees the
//! turn about the bone, which the camera does not. Both are smoothed by the same Gaussian, so that neither is late.

use super::Refusal;
use crate::body::{Bone, Joint};
use crate::recording::{InertialSensor, Segment, SkeletonRecording};
use crate::signal::grid::{Grid, cell_means, smooth};
use crate::signal::local_parabola::{Weights, weights};
use nalgebra::Vector3;

/// Step of the grids, nanoseconds: an eighth of the fastest period that is left after smoothing.
pub(super) const STEP_NS: i64 = 10_000_000;

/// Standard deviation of the smoothing, seconds: leaves 1 mm of jitter at 30 Hz 0.15 m/s², and of a flight of 0.2 s
/// still nine tenths.
const SMOOTHING_S: f64 = 0.05;

/// Least smoothing in intervals between frames, for slow cameras: fewer frames do not support a parabola.
const SMOOTHING_FRAMES: f64 = 1.2;

/// Gaps in samples up to this are bridged by a straight line, nanoseconds: as long as the smoothing.
const BRIDGED_NS: i64 = 100_000_000;

/// Longest recording, nanoseconds: two hours, which bounds the memory to 720 000 nodes a series.
const LONGEST_NS: i64 = 7_200_000_000_000;

/// Fewest samples or frames that are looked at.
const MIN_SAMPLES: usize = 20;

/// Standard gravity, m/s² (3rd CGPM, 1901).
pub(super) const GRAVITY: f64 = 9.80665;

/// Magnitudes of specific force and angular rate of one segment; NaN where unknown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    pub grid: Grid,
    /// m/s².
    pub force: Vec<f64>,
    /// rad/s.
    pub rate: Vec<f64>,
}

/// Standard deviation of the smoothing for a camera with these times, seconds.
pub(super) fn smoothing_s(frame_time_ns: &[i64]) -> f64 {
    let mut intervals: Vec<i64> = frame_time_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_unstable();
    let median = intervals.get(intervals.len() / 2).copied().unwrap_or(0);
    SMOOTHING_S.max(SMOOTHING_FRAMES * median as f64 * 1e-9)
}

impl Motion {
    /// What a unit saw, on its own clock.
    pub(super) fn of_unit(unit: &InertialSensor, smoothing_s: f64) -> Result<Self, Refusal> {
        check_times(&unit.time_ns)?;
        if unit.acceleration.len() != unit.len() || unit.angular_rate.len() != unit.len() {
            return Err(Refusal::TooShort);
        }
        let grid = Grid::between(unit.time_ns[0], unit.time_ns[unit.len() - 1], STEP_NS);
        let magnitudes = |values: &[Vector3<f64>]| {
            let mut means = cell_means(&grid, &unit.time_ns, values, BRIDGED_NS);
            smooth(&mut means, smoothing_s * 1e9 / STEP_NS as f64);
            means.into_iter().map(|v| v.norm()).collect()
        };
        Ok(Self { grid, force: magnitudes(&unit.acceleration), rate: magnitudes(&unit.angular_rate) })
    }
}

/// The grid of the camera's clock and the weights of the frames at its nodes.
pub(super) struct CameraGrid {
    pub grid: Grid,
    weights: Vec<Option<Weights>>,
}

impl CameraGrid {
    pub(super) fn new(skeleton: &SkeletonRecording, smoothing_s: f64) -> Result<Self, Refusal> {
        check_times(&skeleton.time_ns)?;
        let grid = Grid::between(skeleton.time_ns[0], skeleton.time_ns[skeleton.len() - 1], STEP_NS);
        Ok(Self { grid, weights: weights(&grid, &skeleton.time_ns, smoothing_s) })
    }

    /// What the camera saw of a segment; `None` when it does not track one.
    pub(super) fn motion(&self, skeleton: &SkeletonRecording, segment: Segment) -> Option<Motion> {
        let points = Points::of(skeleton, segment)?;
        let point = mean_of_columns(skeleton, &points.at);
        let bone = points.ends.map(|[from, to]| {
            let (from, to) = (mean_of_columns(skeleton, &from), mean_of_columns(skeleton, &to));
            to.iter().zip(&from).map(|(to, from)| to - from).collect::<Vec<_>>()
        });
        let missing = vec![f64::NAN; self.grid.len];
        let mut motion = Motion { grid: self.grid, force: missing.clone(), rate: missing };
        for (i, weights) in self.weights.iter().enumerate() {
            let Some(weights) = weights else { continue };
            let frames = || weights.samples.clone().zip(&weights.weights);
            let acceleration: Vector3<f64> = frames().map(|(t, w)| point[t] * w[2]).sum();
            motion.force[i] = (acceleration + Vector3::y() * GRAVITY).norm();
            if let Some(bone) = &bone {
                let (mut along, mut velocity) = (Vector3::zeros(), Vector3::zeros());
                for (t, w) in frames() {
                    along += bone[t] * w[0];
                    velocity += bone[t] * w[1];
                }
                motion.rate[i] = along.cross(&velocity).norm() / along.norm_squared();
            }
        }
        Some(motion)
    }
}

/// Refuses what has no usable time.
fn check_times(time_ns: &[i64]) -> Result<(), Refusal> {
    let (Some(&first), Some(&last)) = (time_ns.first(), time_ns.last()) else { return Err(Refusal::TooShort) };
    if time_ns.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(Refusal::ClockRunsBackwards);
    }
    if last.saturating_sub(first) > LONGEST_NS {
        return Err(Refusal::TooLong);
    }
    if time_ns.len() < MIN_SAMPLES { Err(Refusal::TooShort) } else { Ok(()) }
}

/// Columns of the skeleton that stand for a segment; each point is the mean of its columns.
struct Points {
    /// The point whose acceleration counts.
    at: Vec<usize>,
    /// The ends of the bone whose direction counts.
    ends: Option<[Vec<usize>; 2]>,
}

impl Points {
    fn of(skeleton: &SkeletonRecording, segment: Segment) -> Option<Self> {
        let seen = |joints: &[Joint]| joints.iter().filter_map(|&j| skeleton.column(j)).collect::<Vec<usize>>();
        let all = |joints: &[Joint]| Some(seen(joints)).filter(|columns| columns.len() == joints.len());
        let first = |choices: &[&[Joint]]| choices.iter().find_map(|joints| all(joints));
        let hips: &[Joint] = &[Joint::LeftHip, Joint::RightHip];
        let shoulders: &[Joint] = &[Joint::LeftShoulder, Joint::RightShoulder];
        let (from, to) = match segment {
            Segment::Chest => {
                let at =
                    seen(&[Joint::Neck, Joint::SpineShoulder, Joint::Torso, Joint::LeftShoulder, Joint::RightShoulder]);
                let upper = first(&[&[Joint::SpineShoulder], &[Joint::Neck], shoulders]);
                let lower = first(&[&[Joint::Pelvis], hips]);
                return (!at.is_empty()).then(|| Self { at, ends: upper.zip(lower).map(|(a, b)| [a, b]) });
            }
            Segment::Pelvis => {
                let at = seen(&[Joint::Pelvis, Joint::LeftHip, Joint::RightHip]);
                return (!at.is_empty()).then_some(Self { at, ends: None });
            }
            Segment::LeftFoot => (all(&[Joint::LeftAnkle])?, all(&[Joint::LeftFoot])?),
            Segment::RightFoot => (all(&[Joint::RightAnkle])?, all(&[Joint::RightFoot])?),
            _ => {
                let bone = segment.bone()?;
                let [proximal, middle, distal] = bone.limb()?.joints().map(|(joint, stand_in)| [joint, stand_in]);
                let column = |[joint, stand_in]: [Joint; 2]| first(&[&[joint], &[stand_in]]);
                match bone {
                    Bone::Distal(_) => (column(middle)?, column(distal)?),
                    _ => (column(proximal)?, column(middle)?),
                }
            }
        };
        let at = from.iter().chain(&to).copied().collect();
        Some(Self { at, ends: Some([from, to]) })
    }
}

/// Mean of some columns in every frame; NaN where one of them was lost for longer than [`BRIDGED_NS`].
fn mean_of_columns(skeleton: &SkeletonRecording, columns: &[usize]) -> Vec<Vector3<f64>> {
    let n = columns.len() as f64;
    let mut means: Vec<Vector3<f64>> = (0..skeleton.len())
        .map(|t| columns.iter().map(|&column| skeleton.frame(t)[column]).sum::<Vector3<f64>>() / n)
        .collect();
    bridge(&skeleton.time_ns, &mut means);
    means
}

/// Fills short stretches of missing points by a straight line.
fn bridge(time_ns: &[i64], points: &mut [Vector3<f64>]) {
    let mut last_seen = None;
    for t in 0..points.len() {
        if points[t].x.is_nan() {
            continue;
        }
        if let Some(last) = last_seen
            && last + 1 < t
            && time_ns[t] - time_ns[last] <= BRIDGED_NS
        {
            let (from, to): (Vector3<f64>, Vector3<f64>) = (points[last], points[t]);
            let whole = (time_ns[t] - time_ns[last]) as f64;
            for between in last + 1..t {
                points[between] = from.lerp(&to, (time_ns[between] - time_ns[last]) as f64 / whole);
            }
        }
        last_seen = Some(t);
    }
}
