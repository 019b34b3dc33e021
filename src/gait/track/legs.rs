//! Pelvis and feet of a track on a fine grid of time, with velocities.

use crate::assessment::JointTrack;
use crate::body::{Joint, Side};
use crate::signal::grid::Grid;
use crate::signal::local_parabola::weights;
use nalgebra::Vector3;

/// Distance of two nodes of the grid, nanoseconds: events are interpolated between them.
const STEP_NS: i64 = 10_000_000;
/// Standard deviation of the Gaussian that smooths joints, seconds: a foot brakes within 0.1 s, and one lost frame of
/// thirty a second can be bridged.
const JOINT_SD_S: f64 = 0.04;
/// The same for the way of the pelvis: longer than its sway from step to step.
const WAY_SD_S: f64 = 0.4;

/// Position and velocity of a point, metres and m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moving {
    pub place: Vector3<f64>,
    pub velocity: Vector3<f64>,
}

/// A point at each node of the grid; none where it was not seen.
pub(super) type Path = Vec<Option<Moving>>;

/// What a detector of contacts looks at.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Legs {
    /// Nodes; times are nanoseconds from the track's first frame.
    pub grid: Grid,
    /// Middle of the hips.
    pub pelvis: Path,
    /// The pelvis without its sway.
    pub way: Path,
    /// Both ankles, left first.
    pub ankles: [Path; 2],
    /// Both toes, left first; the ankles of a sensor without toes.
    pub toes: [Path; 2],
    /// False for a sensor whose legs end at the ankle.
    pub has_toes: bool,
    /// From the left hip to the right; none where they were not seen.
    pub right: Vec<Option<Vector3<f64>>>,
    /// Whether pelvis and both ankles were seen, by frame of the track, with its time in seconds.
    pub seen: Vec<(f64, bool)>,
}

impl Legs {
    /// The legs of a track; none without the joints or with fewer than a few frames.
    pub(super) fn of(track: &JointTrack) -> Option<Self> {
        let (&first, &last) = (track.time_ns.first()?, track.time_ns.last()?);
        let grid = Grid::between(0, last.saturating_sub(first), STEP_NS);
        let samples = |joint: Joint| Some(samples(track, track.column(joint)?));
        let both = |left, right| Some([samples(left)?, samples(right)?]);
        let hips = both(Joint::LeftHip, Joint::RightHip);
        let pelvis = match &hips {
            Some([left, right]) => {
                left.iter().zip(right).map(|(l, r)| Some((l.as_ref()? + r.as_ref()?) * 0.5)).collect()
            }
            None => samples(Joint::Pelvis)?,
        };
        let toes = both(Joint::LeftFoot, Joint::RightFoot);
        // NITE calls the end of the leg a foot and has no ankle.
        let ankles = both(Joint::LeftAnkle, Joint::RightAnkle).or_else(|| toes.clone())?;
        let has_toes = track.column(Joint::LeftAnkle).is_some() && toes.is_some();
        let toes = toes.filter(|_| has_toes).unwrap_or_else(|| ankles.clone());
        let seconds = |time: i64| (time - first) as f64 * 1e-9;
        let seen = (0..track.len())
            .map(|t| (seconds(track.time_ns[t]), [&pelvis, &ankles[0], &ankles[1]].iter().all(|p| p[t].is_some())))
            .collect();
        let path = |points: &Samples, sd_s| path(track, &grid, points, sd_s);
        let right = match &hips {
            Some([left, right]) => {
                let between: Samples = left.iter().zip(right).map(|(l, r)| Some(r.as_ref()? - l.as_ref()?)).collect();
                path(&between, WAY_SD_S).into_iter().map(|moving| moving.map(|moving| moving.place)).collect()
            }
            None => vec![None; grid.len],
        };
        Some(Self {
            pelvis: path(&pelvis, JOINT_SD_S),
            way: path(&pelvis, WAY_SD_S),
            ankles: ankles.each_ref().map(|points| path(points, JOINT_SD_S)),
            toes: toes.each_ref().map(|points| path(points, JOINT_SD_S)),
            has_toes,
            right,
            seen,
            grid,
        })
    }

    /// Seconds from the track's first frame of a place on the grid, in nodes.
    pub(super) fn time_s(&self, node: f64) -> f64 {
        self.grid.start_ns as f64 * 1e-9 + node * self.grid.step_s()
    }

    /// Share of the frames between two times in which pelvis and both ankles were seen.
    pub(super) fn coverage(&self, from_s: f64, to_s: f64) -> f64 {
        let between: Vec<bool> =
            self.seen.iter().filter(|(time, _)| (from_s..=to_s).contains(time)).map(|(_, seen)| *seen).collect();
        match between.len() {
            0 => 0.0,
            n => between.iter().filter(|seen| **seen).count() as f64 / n as f64,
        }
    }

    /// Number of the side in pairs of this module.
    pub(super) fn index(side: Side) -> usize {
        side as usize
    }
}

/// A joint by frame; none where it was lost.
type Samples = Vec<Option<Vector3<f64>>>;

fn samples(track: &JointTrack, column: usize) -> Samples {
    (0..track.len())
        .map(|t| {
            let point = Vector3::from(track.frame(t)[column]).map(f64::from);
            point.iter().all(|value| value.is_finite()).then_some(point)
        })
        .collect()
}

/// A joint on the grid, smoothed by a Gaussian.
fn path(track: &JointTrack, grid: &Grid, points: &Samples, sd_s: f64) -> Path {
    let first = track.time_ns.first().copied().unwrap_or(0);
    let seen: Vec<(i64, Vector3<f64>)> =
        track.time_ns.iter().zip(points).filter_map(|(time, point)| Some((time - first, (*point)?))).collect();
    let times: Vec<i64> = seen.iter().map(|(time, _)| *time).collect();
    let moving = |weights: crate::signal::local_parabola::Weights| {
        let mut moving = Moving { place: Vector3::zeros(), velocity: Vector3::zeros() };
        for (k, [value, derivative, _]) in weights.samples.zip(&weights.weights) {
            moving.place += seen[k].1 * *value;
            moving.velocity += seen[k].1 * *derivative;
        }
        moving
    };
    weights(grid, &times, sd_s).into_iter().map(|weights| weights.map(moving)).collect()
}
