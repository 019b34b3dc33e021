//! Contacts of somebody who steps on the spot: feet are lifted in turn and put down where they were.
//!
//! ```text
//! h(t)   height of the left ankle − height of the right: a maximum is a lift of the left foot, a minimum of the right
//! IC     when the ankle has come down to DOWN_SHARE of its lift above where it stands afterwards
//! TC     when it had risen as far above where it stood before
//! ```

use super::legs::Legs;
use super::walking::zigzag;
use crate::body::Side;
use crate::gait::plausibility::LONGEST_STEP_S;

/// Lowest lift that is a step, metres; shifting of weight and the error of a sensor stay below it.
const LEAST_LIFT_M: f64 = 0.05;
/// Share of a lift at which a foot counts as on the floor.
const DOWN_SHARE: f64 = 0.15;
/// Fewest contacts in a row that are stepping.
const FEWEST: usize = 4;

/// A contact on the spot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpotContact {
    pub side: Side,
    /// Initial contact, nodes of the grid.
    pub node: f64,
    /// Terminal contact of the same foot before it.
    pub toe_off: Option<f64>,
}

/// Runs of contacts of somebody who steps on the spot.
pub(super) fn runs(legs: &Legs) -> Vec<Vec<SpotContact>> {
    let heights: Vec<Option<[f64; 2]>> =
        (0..legs.grid.len).map(|k| Some([legs.ankles[0][k]?.place.y, legs.ankles[1][k]?.place.y])).collect();
    let mut found = Vec::new();
    let mut k = 0;
    while k < heights.len() {
        let begin = k;
        while k < heights.len() && heights[k].is_some() == heights[begin].is_some() {
            k += 1;
        }
        if heights[begin].is_some() {
            let seen: Vec<[f64; 2]> = heights[begin..k].iter().flatten().copied().collect();
            found.extend(contacts(&seen).into_iter().map(|contact| shifted(contact, begin as f64)));
        }
    }
    let longest = LONGEST_STEP_S / legs.grid.step_s();
    let runs = found.chunk_by(|a, b| b.node - a.node <= longest && a.side != b.side);
    runs.filter(|run| run.len() >= FEWEST).map(<[SpotContact]>::to_vec).collect()
}

fn shifted(contact: SpotContact, by: f64) -> SpotContact {
    SpotContact { node: contact.node + by, toe_off: contact.toe_off.map(|node| node + by), ..contact }
}

fn contacts(heights: &[[f64; 2]]) -> Vec<SpotContact> {
    let between: Vec<f64> = heights.iter().map(|[left, right]| left - right).collect();
    let nodes = zigzag(&between, LEAST_LIFT_M);
    let mut found = Vec::new();
    for i in 0..nodes.len() {
        let from = i.checked_sub(1).map_or(0, |i| nodes[i]);
        let to = nodes.get(i + 1).copied().unwrap_or(heights.len() - 1);
        let reference = if i > 0 { between[nodes[i - 1]] } else { nodes.get(1).map_or(0.0, |&k| between[k]) };
        let side = if between[nodes[i]] > reference { Side::Left } else { Side::Right };
        let height = |k: usize| heights[k][Legs::index(side)];
        let lowest = |range: std::ops::RangeInclusive<usize>| range.map(height).fold(f64::INFINITY, f64::min);
        let top = height(nodes[i]);
        let (before, after) = (lowest(from..=nodes[i]), lowest(nodes[i]..=to));
        if top - after < LEAST_LIFT_M || top - before < LEAST_LIFT_M {
            continue;
        }
        let level = after + DOWN_SHARE * (top - after);
        let down = (nodes[i]..to).find(|&k| height(k) > level && height(k + 1) <= level);
        let Some(down) = down else { continue };
        let node = down as f64 + (height(down) - level) / (height(down) - height(down + 1));
        let level = before + DOWN_SHARE * (top - before);
        let up = (from..nodes[i]).rev().find(|&k| height(k) <= level && height(k + 1) > level);
        let toe_off = up.map(|k| k as f64 + (level - height(k)) / (height(k + 1) - height(k)));
        found.push(SpotContact { side, node, toe_off });
    }
    found
}
