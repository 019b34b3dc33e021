//! The time at which all units rest together on a plank, in one attitude (\[fusion\]'s set-up).
//!
//! On a rigid plank every unit reads the same direction of gravity, and its gyroscope reads nothing but its bias and
//! white noise. People who stand quietly also rest; mounted after \[fusion\]'s scheme their units even agree on gravity.
//! What gives them away is sway: slow rates that do not average out as white noise does.

use super::Synchronization;
use crate::recording::{InertialSensor, Segment};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::ops::Range;

/// Length of the cells of time that are judged as a whole, nanoseconds.
const CELL_NS: i64 = 500_000_000;

/// Shortest rest, cells: 1.5 s, as VQF asks (Laidig and Seel, Information Fusion 91, 2023, table 2).
const MIN_CELLS: usize = 3;

/// Fewest samples of a unit in a cell.
const MIN_SAMPLES: f64 = 10.0;

/// Largest root mean square deviation from the mean of a cell, m/s² and rad/s (2 °/s): VQF's bounds on each sample.
const STILL: [f64; 2] = [0.5, 2.0 * std::f64::consts::PI / 180.0];

/// Largest bias of a gyroscope that still counts as one, rad/s: 2 °/s, VQF's bound.
const MAX_BIAS: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// Largest change of a cell's mean rate within a rest, rad/s: 0.5 °/s, beyond the sway of quiet standing.
const MAX_CHANGE: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Angle between two units' gravity up to which they may lie on one plane, rad: 3° for the plank and the housings, and
/// 2° for accelerometers that are off by 20 mg each.
const ONE_PLANE: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Scatter of the cells' mean rates beyond that of white noise up to which a unit is silent, rad/s: 0.03 °/s, the
/// instability of a consumer gyroscope's bias. The least sway of a standing person's segments is several times that.
const SILENT: f64 = 0.03 * std::f64::consts::PI / 180.0;

/// Scatter beyond which a body sways, rad/s.
const SWAYS: f64 = 0.08 * std::f64::consts::PI / 180.0;

/// What the units rested on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Support {
    /// A plank: one attitude, and silent.
    Plank,
    /// A person, or places of different attitude.
    Apart,
    /// They agree on gravity, but whether they are silent cannot be told: a plank, or a person who stands very quietly.
    Undecidable,
}

/// Means of one unit over a rest, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitAtRest {
    /// The unit's declared segment.
    pub segment: Segment,
    /// Mean specific force, m/s².
    pub acceleration: Vector3<f64>,
    /// Mean angular rate, which is the gyroscope's bias, rad/s.
    pub angular_rate: Vector3<f64>,
    /// Scatter of the mean rates of half seconds beyond what white noise explains, root mean square over time and axes,
    /// rad/s.
    pub sway: f64,
}

/// A time at which all aligned units rest.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonRest {
    /// When, nanoseconds on the camera's clock.
    pub camera_ns: Range<i64>,
    /// The aligned units, in their order.
    pub units: Vec<UnitAtRest>,
    /// Largest angle between the gravity of two units, each in its own frame, rad.
    pub gravity_spread: f64,
    /// What they rested on.
    pub support: Support,
}

/// The common rest that is most surely on a plank, of those the earliest; `None` when the aligned units never rest at
/// the same time, or none is aligned. One unit alone rests on a plank when it is silent.
pub fn common_rest(units: &[InertialSensor], synchronization: &Synchronization) -> Option<CommonRest> {
    let cells: Vec<(Segment, BTreeMap<i64, Cell>)> = units
        .iter()
        .zip(&synchronization.units)
        .filter_map(|(unit, found)| {
            Some((unit.segment, still_cells(unit, |ns| found.clock().map(|c| c.camera_ns(ns)))?))
        })
        .collect();
    let (_, first) = cells.first()?;
    let common: Vec<i64> =
        first.keys().copied().filter(|key| cells.iter().all(|(_, still)| still.contains_key(key))).collect();
    let is_next = |a: &i64, b: &i64| {
        *b == a + 1 && cells.iter().all(|(_, still)| (still[a].rate() - still[b].rate()).norm() < MAX_CHANGE)
    };
    let rests = common.chunk_by(is_next).filter(|run| run.len() >= MIN_CELLS).map(|run| rest(&cells, run));
    let rank = |rest: &CommonRest| match rest.support {
        Support::Plank => 0,
        Support::Undecidable => 1,
        Support::Apart => 2,
    };
    rests.min_by_key(rank)
}

/// Sums over the samples of one unit in one cell.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    n: f64,
    /// Sums of acceleration and rate.
    sums: [Vector3<f64>; 2],
    /// Sums of their squares.
    squares: [f64; 2],
}

impl Cell {
    fn acceleration(&self) -> Vector3<f64> {
        self.sums[0] / self.n
    }

    fn rate(&self) -> Vector3<f64> {
        self.sums[1] / self.n
    }

    /// Mean square deviation from the mean, all axes together.
    fn variance(&self, what: usize) -> f64 {
        (self.squares[what] / self.n - (self.sums[what] / self.n).norm_squared()).max(0.0)
    }

    fn is_still(&self) -> bool {
        self.n >= MIN_SAMPLES
            && (0..2).all(|what| self.variance(what) < STILL[what] * STILL[what])
            && self.rate().amax() < MAX_BIAS
    }
}

/// The cells of the camera's clock in which a unit is still, by their number; `None` without a clock.
fn still_cells(unit: &InertialSensor, camera_ns: impl Fn(i64) -> Option<i64>) -> Option<BTreeMap<i64, Cell>> {
    let mut cells: BTreeMap<i64, Cell> = BTreeMap::new();
    for ((time, acceleration), rate) in unit.time_ns.iter().zip(&unit.acceleration).zip(&unit.angular_rate) {
        let cell = cells.entry(camera_ns(*time)?.div_euclid(CELL_NS)).or_default();
        cell.n += 1.0;
        for (what, value) in [acceleration, rate].into_iter().enumerate() {
            cell.sums[what] += value;
            cell.squares[what] += value.norm_squared();
        }
    }
    cells.retain(|_, cell| cell.is_still());
    Some(cells)
}

/// What the units read in a run of cells, and what that says of what they lie on.
fn rest(cells: &[(Segment, BTreeMap<i64, Cell>)], run: &[i64]) -> CommonRest {
    let units: Vec<UnitAtRest> = cells
        .iter()
        .map(|(segment, still)| {
            let own: Vec<&Cell> = run.iter().map(|key| &still[key]).collect();
            let n = own.len() as f64;
            let acceleration = own.iter().map(|cell| cell.acceleration()).sum::<Vector3<f64>>() / n;
            let angular_rate = own.iter().map(|cell| cell.rate()).sum::<Vector3<f64>>() / n;
            let scatter = own.iter().map(|cell| (cell.rate() - angular_rate).norm_squared()).sum::<f64>() / (n - 1.0);
            let white = own.iter().map(|cell| cell.variance(1) / cell.n).sum::<f64>() / n;
            let sway = ((scatter - white).max(0.0) / 3.0).sqrt();
            UnitAtRest { segment: *segment, acceleration, angular_rate, sway }
        })
        .collect();
    let pairs = || units.iter().enumerate().flat_map(|(i, a)| units[i + 1..].iter().map(move |b| (a, b)));
    let gravity_spread = pairs().map(|(a, b)| a.acceleration.angle(&b.acceleration)).fold(0.0, f64::max);
    // The quietest hides nothing that the others show: all of them lie on the same thing.
    let sway = (units.iter().map(|unit| unit.sway * unit.sway).sum::<f64>() / units.len() as f64).sqrt();
    let support = if gravity_spread > ONE_PLANE || sway > SWAYS {
        Support::Apart
    } else if sway < SILENT {
        Support::Plank
    } else {
        Support::Undecidable
    };
    let first = run.first().copied().unwrap_or(0);
    let camera_ns = first * CELL_NS..(first + run.len() as i64) * CELL_NS;
    CommonRest { camera_ns, units, gravity_spread, support }
}
