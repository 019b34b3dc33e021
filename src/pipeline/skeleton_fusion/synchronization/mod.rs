//! Clocks: each unit's is mapped onto the camera's (\[fusion\], "five vertical jumps").
//!
//! ```text
//! camera_time = unit_time + offset + drift · (unit_time − reference)
//! ```
//!
//! Camera and unit are compared in two magnitudes that need neither attitude nor mounting, the specific force and the
//! angular rate of the segment (`motion`). The jumps are the clearest part of both; the rest of the movement serves in
//! the same way, and alone when there are no jumps:
//!
//! 1. `search`: the lag at which the whole recording fits, near the declared offset first, then farther, then wherever
//!    a train of jumps (`jumps`) of the unit may meet one of the camera. Equally good lags make a refusal.
//! 2. `windows`: the lag of each window of ten seconds around that, refined between the nodes of the grid.
//! 3. `line`: offset and drift through the windows, robustly. Windows at one time do not tell the drift, which then
//!    stays at zero with the standard deviation of clocks in general.
//!
//! A unit that the camera cannot align (its segment is hidden or not tracked) is aligned with a unit that it could, by
//! the forces that both felt.
//!
//! The paper aligns the vertical acceleration of the torso alone, by hand, once. Comparing each unit with its own bone
//! also uses the arms' and legs' movement, needs no unit on the chest, and sees the drift.

mod assignment;
mod clock;
mod common_rest;
mod jumps;
mod line;
mod motion;
mod refusal;
mod search;
#[cfg(test)]
mod tests;
mod windows;

pub use assignment::{AssignmentDoubt, assignment_doubts};
pub use clock::ClockMap;
pub use common_rest::{CommonRest, Support, UnitAtRest, common_rest};
pub use refusal::Refusal;

use crate::recording::{InertialSensor, Segment, SkeletonRecording};
use jumps::{MIN_JUMPS, flights, trains, without_landings};
use line::{Fit, Line, PRIOR_DRIFT_SD, fit};
use motion::{CameraGrid, Motion, smoothing_s};
use search::{Coarse, Found, search, search_jumps};
use windows::observe;

/// Offsets that are tried around the declared one, seconds: clocks set by the same network, then by hand.
const NEAR_S: f64 = 2.5;
const FAR_S: f64 = 10.0;

/// Factor by which a far offset must beat a near one.
const CLEARLY_BETTER: f64 = 1.2;

/// What the first search leaves open, seconds: its step and a half.
const SEARCH_SLACK_S: f64 = 0.075;

/// Largest drift, s/s: twice what sensors' clocks are specified to.
const MAX_DRIFT: f64 = 200e-6;

/// Widest slack of a window, seconds; more than this is another swing of the limb.
const MAX_SLACK_S: f64 = 0.4;

/// Slack of a window around a line, seconds.
const LINE_SLACK_S: f64 = 0.06;

/// Part of the windows that must agree with the line.
const MIN_AGREEING: f64 = 0.5;

/// Windows that must agree with the line: one alone cannot be checked, and short real recordings showed it off by a
/// quarter of a second.
const MIN_WINDOWS: usize = 2;

/// Largest standard deviation of an offset that is of use, seconds: about one frame of the camera.
const MAX_SD_S: f64 = 0.03;

/// Ranges of force (m/s²) and rate (rad/s) below which nothing moved.
const STILL: [f64; 2] = [0.5, 0.15];

/// Distance up to which a flight of the unit is the flight that the camera saw, seconds.
const SAME_FLIGHT_S: f64 = 0.12;

/// Standard deviation that is added when a unit is aligned by another unit without jumps, seconds: impacts and swings
/// reach neighbouring segments one after the other.
const NEIGHBOUR_SD_S: f64 = 0.01;

/// What an alignment rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evidence {
    /// Vertical jumps that both saw, and whatever else moved.
    Jumps,
    /// Movement without jumps.
    Movement,
    /// Nothing: there is no alignment.
    None,
}

/// A unit's clock on the camera's, and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// The map.
    pub clock: ClockMap,
    /// Root mean square by which single windows differ from the map, weighted by what each tells, seconds.
    pub residual_s: f64,
    /// Windows that agree with the map, force and rate counted apart.
    pub n_windows: usize,
    /// True when vertical jumps were seen by both.
    pub has_jumps: bool,
    /// True when the recording tells the drift; otherwise it is near zero with the standard deviation of clocks in
    /// general, and the map is only good near its reference time.
    pub drift_is_measured: bool,
    /// The unit that this one was aligned by, when the camera could not.
    pub by: Option<Segment>,
}

/// What was found for one unit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitClock {
    /// The unit's declared segment.
    pub segment: Segment,
    /// The alignment, or why there is none.
    pub alignment: Result<Alignment, Refusal>,
    /// True when the accelerometer repeats one reading; only the gyroscope was used then.
    pub accelerometer_is_constant: bool,
}

impl UnitClock {
    /// What the alignment rests on.
    pub fn evidence(&self) -> Evidence {
        match self.alignment {
            Ok(Alignment { has_jumps: true, .. }) => Evidence::Jumps,
            Ok(_) => Evidence::Movement,
            Err(_) => Evidence::None,
        }
    }

    /// The map, when there is one.
    pub fn clock(&self) -> Option<&ClockMap> {
        self.alignment.as_ref().ok().map(|alignment| &alignment.clock)
    }
}

/// The clocks of all units, in their order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Synchronization {
    /// One entry for each unit.
    pub units: Vec<UnitClock>,
}

/// One side of a comparison: its motion and what the search needs of it.
struct Side {
    motion: Motion,
    coarse: Coarse,
}

impl Side {
    fn new(motion: Motion) -> Self {
        Self { coarse: Coarse::new(&motion), motion }
    }

    /// True when neither force nor rate ever changed.
    fn is_still(&self) -> bool {
        let range = |series: &[f64]| {
            let (low, high) = series.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
            high - low
        };
        range(&self.motion.force) < STILL[0] && range(&self.motion.rate) < STILL[1]
    }
}

/// Maps the clock of every unit onto the camera's.
///
/// `clock_offset_ns` of a unit is where the search begins; ten seconds around it are searched, and every lag at which
/// jumps may coincide, so that clocks that count from their own start are found too.
pub fn synchronize(skeleton: &SkeletonRecording, units: &[InertialSensor]) -> Synchronization {
    let smoothing_s = smoothing_s(&skeleton.time_ns);
    let camera = CameraGrid::new(skeleton, smoothing_s);
    let sides: Vec<Result<Side, Refusal>> =
        units.iter().map(|unit| Motion::of_unit(unit, smoothing_s).map(Side::new)).collect();
    // Whether the body flew is asked of its trunk: a swinging arm alone may seem to fall.
    let jumps: Vec<Vec<f64>> = camera
        .iter()
        .filter_map(|camera| [Segment::Chest, Segment::Pelvis].iter().find_map(|&s| camera.motion(skeleton, s)))
        .flat_map(|trunk| trains(&trunk))
        .collect();
    let mut alignments: Vec<Result<Alignment, Refusal>> = Vec::new();
    for (unit, side) in units.iter().zip(&sides) {
        alignments.push(match (&camera, side) {
            (Err(refusal), _) | (_, Err(refusal)) => Err(*refusal),
            (Ok(camera), Ok(side)) => match camera.motion(skeleton, unit.segment).map(Side::new) {
                Some(seen) => align(&seen, &jumps, side, &without_landings(&side.motion), unit.clock_offset_ns),
                None => Err(Refusal::NotTracked),
            },
        });
    }
    if let Ok(camera) = &camera {
        align_by_neighbours(camera, &jumps, units, &sides, &mut alignments);
    }
    let of_unit = |(unit, alignment): (&InertialSensor, _)| UnitClock {
        segment: unit.segment,
        alignment,
        accelerometer_is_constant: !unit.is_empty() && unit.acceleration.iter().all(|a| *a == unit.acceleration[0]),
    };
    Synchronization { units: units.iter().zip(alignments).map(of_unit).collect() }
}

/// Aligns a unit with what the camera (or another unit, on the camera's clock) saw of its movement.
///
/// `jumps` are the trains that the camera saw, `felt` is what is compared of the unit's motion.
fn align(
    camera: &Side,
    jumps: &[Vec<f64>],
    unit: &Side,
    felt: &Motion,
    declared_ns: i64,
) -> Result<Alignment, Refusal> {
    if unit.is_still() {
        return Err(Refusal::UnitStill);
    }
    if camera.is_still() {
        return Err(Refusal::CameraStill);
    }
    let found = locate(camera, jumps, unit, declared_ns)?;
    let (camera_grid, unit_grid) = (&camera.motion.grid, &unit.motion.grid);
    let unit_s = unit_grid.len as f64 * unit_grid.step_s();
    let start = Line { reference_s: 0.5 * unit_s, offset_s: found.lag_s, drift: 0.0 };
    let slack_s = (SEARCH_SLACK_S + MAX_DRIFT * 0.5 * unit_s).min(MAX_SLACK_S);
    let rough = fit(&observe(&camera.motion, felt, &start, slack_s)).ok_or(Refusal::NoSharedMovement)?;
    let observations = observe(&camera.motion, felt, &rough.line, LINE_SLACK_S);
    let Fit { line, offset_sd_s, drift_sd, residual_s, agrees } =
        fit(&observations).ok_or(Refusal::NoSharedMovement)?;
    let n_windows = agrees.iter().filter(|agrees| **agrees).count();
    if n_windows < MIN_WINDOWS {
        return Err(Refusal::NoSharedMovement);
    }
    if (n_windows as f64) < MIN_AGREEING * agrees.len() as f64 {
        return Err(Refusal::Inconsistent);
    }
    if line.drift.abs() > MAX_DRIFT + drift_sd {
        return Err(Refusal::ImplausibleDrift { drift_ppm: line.drift * 1e6 });
    }
    if offset_sd_s > MAX_SD_S {
        return Err(Refusal::Imprecise { sd_s: offset_sd_s });
    }
    let base_s = (camera_grid.start_ns - unit_grid.start_ns) as f64 * 1e-9;
    let clock = ClockMap {
        reference_ns: unit_grid.start_ns + (line.reference_s * 1e9).round() as i64,
        offset_s: base_s + line.offset_s,
        drift_ppm: line.drift * 1e6,
        offset_sd_s,
        drift_sd_ppm: drift_sd * 1e6,
    };
    Ok(Alignment {
        clock,
        residual_s,
        n_windows,
        has_jumps: share_jumps(jumps, &unit.motion, &line),
        drift_is_measured: drift_sd < 0.5 * PRIOR_DRIFT_SD,
        by: None,
    })
}

/// The lag at which the whole recording fits: near the declared one, farther, or where jumps meet.
fn locate(camera: &Side, jumps: &[Vec<f64>], unit: &Side, declared_ns: i64) -> Result<Found, Refusal> {
    let declared_s = declared_lag_s(&camera.motion, &unit.motion, declared_ns);
    let within = |reach: f64| search(&camera.coarse, &unit.coarse, declared_s - reach..declared_s + reach);
    let (near, far) = (within(NEAR_S), within(FAR_S));
    match (near, far) {
        (Ok(near), Ok(far)) if far.score > CLEARLY_BETTER * near.score => Ok(far),
        (Ok(near), _) => Ok(near),
        (Err(_), Ok(far)) => Ok(far),
        (Err(refusal), Err(_)) => {
            let of_unit = trains(&unit.motion);
            search_jumps(&camera.coarse, jumps, &unit.coarse, &of_unit).map_err(|_| refusal)
        }
    }
}

/// Camera's minus unit's time of their first nodes by the declared offset, seconds.
fn declared_lag_s(camera: &Motion, unit: &Motion, declared_ns: i64) -> f64 {
    unit.grid.start_ns.saturating_add(declared_ns).saturating_sub(camera.grid.start_ns) as f64 * 1e-9
}

/// True when enough flights of the unit coincide with flights of the camera.
fn share_jumps(jumps: &[Vec<f64>], unit: &Motion, line: &Line) -> bool {
    let step_s = unit.grid.step_s();
    let of_unit = flights(unit);
    let is_shared = |flight: &&f64| {
        let at_s = *flight * step_s;
        of_unit.iter().any(|other| (line.camera_s(other * step_s) - at_s).abs() < SAME_FLIGHT_S)
    };
    jumps.iter().any(|train| train.iter().filter(is_shared).count() >= MIN_JUMPS)
}

/// Aligns units that the camera could not by those that it could.
fn align_by_neighbours(
    camera: &CameraGrid,
    jumps: &[Vec<f64>],
    units: &[InertialSensor],
    sides: &[Result<Side, Refusal>],
    alignments: &mut [Result<Alignment, Refusal>],
) {
    let mut references: Vec<(Segment, Alignment, Side)> = Vec::new();
    for i in 0..units.len() {
        let (Err(refusal), Ok(side)) = (&alignments[i], &sides[i]) else { continue };
        if *refusal == Refusal::UnitStill {
            continue;
        }
        if references.is_empty() {
            for ((unit, side), alignment) in units.iter().zip(sides).zip(alignments.iter()) {
                if let (Ok(side), Ok(alignment)) = (side, alignment) {
                    let motion = on_camera_clock(camera, &side.motion, &alignment.clock);
                    references.push((unit.segment, *alignment, Side::new(motion)));
                }
            }
        }
        let by_reference = references.iter().filter_map(|(segment, reference, seen)| {
            let found = align(seen, jumps, side, &side.motion, units[i].clock_offset_ns).ok()?;
            let neighbour_sd_s = if found.has_jumps { 0.0 } else { NEIGHBOUR_SD_S };
            let mut clock = found.clock;
            clock.offset_sd_s = clock.offset_sd_s.hypot(reference.clock.offset_sd_s).hypot(neighbour_sd_s);
            clock.drift_sd_ppm = clock.drift_sd_ppm.hypot(reference.clock.drift_sd_ppm);
            Some(Alignment { clock, by: Some(*segment), ..found })
        });
        if let Some(best) = by_reference.min_by(|a, b| a.clock.offset_sd_s.total_cmp(&b.clock.offset_sd_s)) {
            alignments[i] = Ok(best);
        }
    }
}

/// The forces that a unit felt, at the nodes of the camera. Rates are left out: neighbours turn differently.
fn on_camera_clock(camera: &CameraGrid, unit: &Motion, clock: &ClockMap) -> Motion {
    let position =
        |i: usize| (clock.unit_ns(camera.grid.time_ns(i)) - unit.grid.start_ns) as f64 / unit.grid.step_ns as f64;
    let force = (0..camera.grid.len).map(|i| crate::signal::grid::read(&unit.force, position(i))).collect();
    Motion { grid: camera.grid, force, rate: vec![f64::NAN; camera.grid.len] }
}
