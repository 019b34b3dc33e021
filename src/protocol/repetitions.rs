//! Repetitions: excursions of an angle that look like a protocol's movement.

use super::look::Look;
use super::motion::{INTERVAL_S, Motion};
use super::transition::{Excursion, Least, derivative, excursions};
use crate::assessment::Repetition;
use crate::body::Side;

/// Share of a repetition in which its angle must have been observed for it to count.
const LEAST_COVERAGE: f64 = 0.5;

/// Which angle tells repetitions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Angle {
    /// Flexion of one knee.
    Knee,
    /// Extension of one knee: flexion downwards.
    KneeExtension,
    /// Flexion of one hip.
    Hip,
    /// Abduction of one hip.
    Abduction,
    /// Mean flexion of both knees.
    BothKnees,
}

/// What was found of a movement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Found {
    /// Repetitions by time.
    pub repetitions: Vec<Repetition>,
    /// Repetitions that were left out since their angle was hardly observed.
    pub n_unseen: usize,
    /// The walk, for protocols that ask for one.
    pub walk: Option<super::walking::Walk>,
    /// The still stand, for protocols that ask for one.
    pub hold: Option<super::stance::Hold>,
}

impl Found {
    /// Repetitions that were seen from start to end.
    pub fn complete(&self) -> impl Iterator<Item = &Repetition> {
        self.repetitions.iter().filter(|repetition| repetition.is_complete)
    }

    /// Time that complete repetitions fill, seconds; what two fill at once counts once.
    pub fn filled_s(&self) -> f64 {
        let mut until_s = f64::NEG_INFINITY;
        let mut filled_s = 0.0;
        for repetition in self.complete() {
            filled_s += (repetition.end_s - repetition.start_s.max(until_s)).max(0.0);
            until_s = until_s.max(repetition.end_s);
        }
        filled_s
    }
}

/// Excursions of an angle of at least that size, in degrees, that look right, as repetitions.
pub fn find(motion: &Motion, angle: Angle, least: Least, is_right: impl Fn(&Look, Side) -> bool) -> Found {
    let mut found = Found::default();
    let sides: &[Option<Side>] =
        if angle == Angle::BothKnees { &[None] } else { &[Some(Side::Left), Some(Side::Right)] };
    for &side in sides {
        let (values, sign) = column(motion, angle, side.unwrap_or(Side::Left));
        let outwards: Vec<f64> = values.iter().map(|value| sign * value).collect();
        for excursion in excursions(&outwards, INTERVAL_S, least) {
            if !is_right(&Look::at(motion, excursion), side.unwrap_or(Side::Left)) {
                continue;
            }
            let repetition = repetition(motion, angle, side, &values, excursion);
            if repetition.coverage < LEAST_COVERAGE {
                found.n_unseen += 1;
            } else {
                found.repetitions.push(repetition);
            }
        }
    }
    found.repetitions.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    found
}

/// Values of an angle, and the sign that makes its excursions go upwards.
fn column(motion: &Motion, angle: Angle, side: Side) -> (Vec<f64>, f64) {
    let side = side as usize;
    match angle {
        Angle::Knee => (motion.knee[side].clone(), 1.0),
        Angle::KneeExtension => (motion.knee[side].clone(), -1.0),
        Angle::Hip => (motion.hip[side].clone(), 1.0),
        Angle::Abduction => (motion.abduction[side].clone(), 1.0),
        Angle::BothKnees => (motion.mean_knee(), 1.0),
    }
}

/// The repetition that an excursion is.
pub fn repetition(
    motion: &Motion,
    angle: Angle,
    side: Option<Side>,
    values: &[f64],
    excursion: Excursion,
) -> Repetition {
    let Excursion { start, peak, end, is_complete } = excursion;
    let within = |values: &[f64]| -> Vec<f64> {
        values[start..=end].iter().copied().filter(|value| value.is_finite()).collect()
    };
    let inside = within(values);
    let speeds = within(&derivative(values, INTERVAL_S));
    let sides: Vec<Side> = side.map_or(Side::BOTH.to_vec(), |side| vec![side]);
    Repetition {
        side,
        start_s: motion.seconds(start),
        peak_s: motion.seconds(peak),
        end_s: motion.seconds(end),
        channel: channel(angle, side),
        extremes_deg: [
            inside.iter().copied().fold(f64::INFINITY, f64::min),
            inside.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ],
        peak_velocity_deg_s: speeds.iter().fold(0.0, |most: f64, speed| most.max(speed.abs())),
        trunk_lean_deg: trunk_lean(motion, start, end),
        coverage: motion.coverage(start, end, &sides),
        is_complete,
    }
}

/// Name of the angle at the API.
fn channel(angle: Angle, side: Option<Side>) -> String {
    let what = match angle {
        Angle::Knee | Angle::KneeExtension => "knee_flexion_deg",
        Angle::Hip => "hip_flexion_deg",
        Angle::Abduction => "hip_abduction_deg",
        Angle::BothKnees => return "mean_knee_flexion_deg".to_owned(),
    };
    side.map_or(what.to_owned(), |side| format!("{}_{what}", side.name()))
}

/// Farthest that the trunk leans, forwards and sideways together, from where it was at the start, degrees.
fn trunk_lean(motion: &Motion, start: usize, end: usize) -> Option<f64> {
    let lean = |i: usize| {
        let forwards = motion.trunk_flexion[i] - motion.trunk_flexion[start];
        let sideways = motion.trunk_lateral[i] - motion.trunk_lateral[start];
        forwards.hypot(sideways)
    };
    let farthest = (start..=end).map(lean).filter(|lean| lean.is_finite()).reduce(f64::max);
    farthest.filter(|_| motion.trunk_flexion[start].is_finite())
}
