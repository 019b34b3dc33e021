//! Contacts of somebody who walks: a foot stops before the body while the body goes on.
//!
//! ```text
//! u(t)   direction of the way of the pelvis along the floor
//! d(t)   (left ankle − right ankle) · u: a left step's end is a maximum, a right step's a minimum
//! TC     the first time since the extremum before at which the toes are faster along u than a share of the fastest that
//!        they are in this swing
//! IC     the last time before the extremum, or else the first after it, at which the ankle has become slower than a share
//! H      mean place of the ankle in the middle of the time until the next contact, when the foot is flat
//! ```
//!
//! Extrema of d alternate, so contacts do. Positions enter only as differences of one joint in time, so an offset of a
//! sensor moves no event as long as it changes slowly against the foot, which brakes with about 30 m/s².

use super::legs::{Legs, Moving};
use crate::body::Side;
use crate::gait::plausibility::LONGEST_STEP_S;
use nalgebra::Vector3;

/// Speed of the pelvis below which nobody walks, m/s: the slowest plausible walk has 0.08.
const LEAST_SPEED_MPS: f64 = 0.06;
/// Way that the feet must go against each other, and share of the usual such way, for an extremum to be a step.
const LEAST_SWING_M: f64 = 0.10;
const LEAST_SWING_SHARE: f64 = 0.3;
/// Speed of an ankle at initial contact, as share of the fastest in its swing.
const CONTACT_SHARE: f64 = 0.16;
/// Speed of the toes at terminal contact, and of the ankle of a sensor without toes, as share of the fastest in the swing:
/// between what captured and what simulated walks have.
const RELEASE_SHARE: f64 = 0.37;
const RELEASE_ANKLE_SHARE: f64 = 0.5;
/// Least speed of an ankle that swings, as share of the pelvis' speed; on average a foot in the air has 2.5 times that speed.
const SWING_SPEED: f64 = 1.5;
/// Time after the extremum in which a foot may still become slow, seconds: the heel of the other foot rises already.
const LATE_CONTACT_S: f64 = 0.15;
/// Part of the time from a contact to the next one in which the foot is flat.
const FLAT: [f64; 2] = [0.25, 0.75];
/// Time after the last contact of a walk that stands for the next one when the track ends, as share of the step before.
const LEAST_LAST_PLACE: f64 = 0.45;

/// A contact of a walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WalkContact {
    pub side: Side,
    /// Initial contact, nodes of the grid.
    pub node: f64,
    /// Terminal contact of the same foot before it.
    pub toe_off: Option<f64>,
    /// Where the foot stood, in `world`.
    pub place: Option<Vector3<f64>>,
    /// Direction of walking.
    pub direction: Vector3<f64>,
}

/// Direction of the way and speed along it; none where nobody walks.
fn progress(way: &Option<Moving>) -> Option<(Vector3<f64>, f64)> {
    let mut velocity = way.as_ref()?.velocity;
    velocity.y = 0.0;
    let speed = velocity.norm();
    (speed >= LEAST_SPEED_MPS).then(|| (velocity / speed, speed))
}

/// Runs of contacts of somebody whose pelvis moves along the floor, each in order of time.
pub(super) fn walks(legs: &Legs) -> Vec<Vec<WalkContact>> {
    let between: Vec<Option<f64>> = (0..legs.grid.len)
        .map(|k| {
            let (u, _) = progress(&legs.way[k])?;
            let [left, right] = [legs.ankles[0][k]?, legs.ankles[1][k]?];
            Some((left.place - right.place).dot(&u))
        })
        .collect();
    let mut found = Vec::new();
    let mut k = 0;
    while k < between.len() {
        let begin = k;
        while k < between.len() && between[k].is_some() == between[begin].is_some() {
            k += 1;
        }
        if between[begin].is_some() {
            let values: Vec<f64> = between[begin..k].iter().flatten().copied().collect();
            let extrema = extrema(&values).into_iter().map(|(node, side)| (begin + node, side)).collect::<Vec<_>>();
            found.extend(contacts(legs, &extrema, begin..k));
        }
    }
    found
}

/// Extrema of the distance of the feet that are steps, alternating: the node and the foot that is ahead.
fn extrema(values: &[f64]) -> Vec<(usize, Side)> {
    let mut least = LEAST_SWING_M;
    let first = zigzag(values, least);
    let mut sizes: Vec<f64> = first.windows(2).map(|pair| (values[pair[1]] - values[pair[0]]).abs()).collect();
    if !sizes.is_empty() {
        sizes.sort_unstable_by(f64::total_cmp);
        least = least.max(LEAST_SWING_SHARE * sizes[sizes.len() / 2]);
    }
    let nodes = zigzag(values, least);
    let is_peak = |i: usize| match i {
        0 => nodes.len() > 1 && values[nodes[0]] > values[nodes[1]],
        _ => values[nodes[i]] > values[nodes[i - 1]],
    };
    let last = values.len().saturating_sub(1);
    // The ends of a run are extrema only by being ends.
    let inner = (0..nodes.len()).filter(|&i| nodes.len() > 1 && nodes[i] > 0 && nodes[i] < last);
    inner.map(|i| (nodes[i], if is_peak(i) { Side::Left } else { Side::Right })).collect()
}

/// Turning points of a curve that differ from their neighbours by at least `least`, alternating, the last one also when
/// nothing follows it.
pub(super) fn zigzag(values: &[f64], least: f64) -> Vec<usize> {
    let mut nodes = Vec::new();
    let (mut low, mut high) = (0, 0);
    // 1: the last turning point was a minimum, so a maximum is looked for; −1 the reverse; 0: neither yet.
    let mut rising = 0i8;
    for (k, &value) in values.iter().enumerate() {
        if value > values[high] {
            high = k;
        }
        if value < values[low] {
            low = k;
        }
        if rising >= 0 && values[high] - value >= least {
            nodes.push(high);
            (rising, low) = (-1, k);
        } else if rising <= 0 && value - values[low] >= least {
            nodes.push(low);
            (rising, high) = (1, k);
        }
    }
    match rising {
        1 => nodes.push(high),
        -1 => nodes.push(low),
        _ => {}
    }
    nodes
}

/// Speed of a point along the direction of walking, m/s.
fn speed(legs: &Legs, point: &[Option<Moving>], k: usize) -> Option<f64> {
    let (u, _) = progress(&legs.way[k])?;
    Some(point[k]?.velocity.dot(&u))
}

fn contacts(legs: &Legs, extrema: &[(usize, Side)], run: std::ops::Range<usize>) -> Vec<Vec<WalkContact>> {
    let mut found: Vec<WalkContact> = Vec::new();
    let late_nodes = (LATE_CONTACT_S / legs.grid.step_s()).round() as usize;
    for (i, &(at, side)) in extrema.iter().enumerate() {
        let before = i.checked_sub(1).map_or(run.start, |i| extrema[i].0);
        let ankle = &legs.ankles[Legs::index(side)];
        let fastest = |point: &[Option<Moving>]| (before..at).filter_map(|k| speed(legs, point, k)).fold(0.0, f64::max);
        // A track that begins within a stance shows no swing that could end.
        let body = progress(&legs.way[at]).map_or(0.0, |(_, speed)| speed);
        if fastest(ankle) < SWING_SPEED * body {
            continue;
        }
        let limit = CONTACT_SHARE * fastest(ankle);
        let excess = |k: usize| Some(speed(legs, ankle, k)? - limit);
        let late = at..(at + late_nodes).min(run.end - 1);
        let Some(node) = last_fall(before..at, excess).or_else(|| first_fall(late, excess)) else { continue };
        let Some((direction, _)) = progress(&legs.way[(node.round() as usize).min(run.end - 1)]) else { continue };
        let (toes, share) = match legs.has_toes {
            true => (&legs.toes[Legs::index(side)], RELEASE_SHARE),
            false => (ankle, RELEASE_ANKLE_SHARE),
        };
        let limit = share * fastest(toes);
        let toe_off = first_rise(before..at, |k| Some(speed(legs, toes, k)? - limit)).filter(|toe_off| *toe_off < node);
        found.push(WalkContact { side, node, toe_off, place: None, direction });
    }
    let longest = LONGEST_STEP_S / legs.grid.step_s();
    let mut walks: Vec<Vec<WalkContact>> =
        found.chunk_by(|a, b| b.node - a.node <= longest).map(<[WalkContact]>::to_vec).collect();
    for walk in &mut walks {
        set_places(legs, walk, run.end);
    }
    walks
}

/// The last place in a range where a value falls through zero, between nodes.
fn last_fall(range: std::ops::Range<usize>, value: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    for k in range.rev() {
        let (here, next) = (value(k)?, value(k + 1)?);
        if here > 0.0 && next <= 0.0 {
            return Some(k as f64 + here / (here - next));
        }
    }
    None
}

/// The first place in a range where a value falls through zero, between nodes.
fn first_fall(range: std::ops::Range<usize>, value: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    first_rise(range, |k| Some(-value(k)?))
}

/// The first place in a range where a value rises through zero, between nodes.
fn first_rise(range: std::ops::Range<usize>, value: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    for k in range {
        let (here, next) = (value(k)?, value(k + 1)?);
        if here <= 0.0 && next > 0.0 {
            return Some(k as f64 + here / (here - next));
        }
    }
    None
}

/// Where each foot of a walk stood flat.
fn set_places(legs: &Legs, walk: &mut [WalkContact], end: usize) {
    for i in 0..walk.len() {
        let node = walk[i].node;
        let time = match (walk.get(i + 1), i.checked_sub(1)) {
            (Some(next), _) => next.node - node,
            (None, Some(before)) => node - walk[before].node,
            (None, None) => continue,
        };
        let from = (node + FLAT[0] * time).round() as usize;
        let to = ((node + FLAT[1] * time).round() as usize).min(end.saturating_sub(1));
        if (to as f64) < node + LEAST_LAST_PLACE * time || to <= from {
            continue;
        }
        let places: Option<Vec<Vector3<f64>>> =
            (from..=to).map(|k| legs.ankles[Legs::index(walk[i].side)][k].map(|moving| moving.place)).collect();
        walk[i].place = places.map(|places| places.iter().sum::<Vector3<f64>>() / places.len() as f64);
    }
}
