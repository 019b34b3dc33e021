//! Footfalls from where joints were: whether there is walking, and each contact of a foot.
//!
//! `legs` puts pelvis and feet on a fine grid, `walking` finds the contacts of somebody whose body goes on, `marching` of
//! somebody who steps on the spot. What is neither has no footfalls.

mod legs;
mod marching;
#[cfg(test)]
mod tests;
mod walking;

use super::contact::GaitContact;
use super::plausibility::SHORTEST_STRIDE_M;
use crate::assessment::JointTrack;
use legs::Legs;
use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};
use walking::WalkContact;

/// Fewest contacts that are a walk: one stride, both of whose steps were seen.
const FEWEST_CONTACTS: usize = 3;
/// A stride that points this far aside from the one before belongs to a turn, radians; strides of a straight walk stay
/// within a few degrees.
const TURN: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// A floor that rises less than this is level: it makes a stride 0.02 % too short.
const LEVEL_SLOPE: f64 = 0.02;
/// A camera is tilted less than this, as the tangent of the angle; stairs are steeper.
const STEEPEST_SLOPE: f64 = 0.45;
/// Weight of a level floor across the ways, m².
const ACROSS_PRIOR: f64 = 0.01;

/// What was found in a track.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Footfalls {
    /// Contacts by time; none when there is no stepping.
    pub contacts: Vec<GaitContact>,
    /// What was done.
    pub kind: Stepping,
    /// Whether a walk was left out because somebody went backwards.
    pub has_backward: bool,
}

/// How somebody steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stepping {
    /// From place to place.
    Walking,
    /// On the spot.
    OnTheSpot,
    /// Not at all.
    None,
    /// The joints of the legs are not in the track.
    NoLegs,
}

/// The footfalls of a track.
pub(super) fn footfalls(track: &JointTrack) -> Footfalls {
    let mut found = Footfalls { contacts: Vec::new(), kind: Stepping::NoLegs, has_backward: false };
    let Some(mut legs) = Legs::of(track) else { return found };
    found.kind = Stepping::None;
    let walks_of =
        |legs: &Legs| walking::walks(legs).into_iter().filter(|walk| is_walk(legs, walk)).collect::<Vec<_>>();
    let mut walks = walks_of(&legs);
    if let Some(level) = slope(&walks).and_then(|slope| Legs::of(&levelled(track, slope))) {
        walks = walks_of(&level);
        legs = level;
    }
    let (backward, forward): (Vec<_>, Vec<_>) = walks.into_iter().partition(|walk| is_backward(&legs, walk));
    found.has_backward = !backward.is_empty();
    if !forward.is_empty() {
        found.kind = Stepping::Walking;
        for (number, walk) in forward.iter().enumerate() {
            found.contacts.extend(contacts_of_walk(&legs, walk, number as u64));
        }
        return found;
    }
    if found.has_backward {
        return found;
    }
    for (number, run) in marching::runs(&legs).iter().enumerate() {
        found.kind = Stepping::OnTheSpot;
        for (i, contact) in run.iter().enumerate() {
            let contact_s = legs.time_s(contact.node);
            let before_s = i.checked_sub(1).map_or(contact_s, |i| legs.time_s(run[i].node));
            found.contacts.push(GaitContact {
                place_m: None,
                walk: number as u64,
                toe_off_s: contact.toe_off.map(|node| legs.time_s(node)),
                coverage: if i > 0 { legs.coverage(before_s, contact_s) } else { 1.0 },
                ..GaitContact::new(contact.side, contact_s, [0.0; 2])
            });
        }
    }
    found
}

/// How the height of the floor changes with `x` and `z` along the ways that were walked: a camera that looks down and does
/// not know it sees the floor rise or fall, and strides too short. None when the floor is level, or steeper than a camera is
/// ever tilted.
fn slope(walks: &[Vec<WalkContact>]) -> Option<Vector2<f64>> {
    let strides = walks.iter().flat_map(|walk| (2..walk.len()).filter_map(|i| stride(walk, i)));
    // The plane of least squares; across the ways it is held level, by a prior of a centimetre to the metre.
    let (mut normal, mut sum) = (Matrix2::identity() * ACROSS_PRIOR, Vector2::zeros());
    for stride in strides {
        let along = Vector2::new(stride.x, stride.z);
        normal += along * along.transpose();
        sum += along * stride.y;
    }
    let slope = normal.try_inverse()? * sum;
    (LEVEL_SLOPE..STEEPEST_SLOPE).contains(&slope.norm()).then_some(slope)
}

/// The track turned so that a floor of a slope is level.
fn levelled(track: &JointTrack, slope: Vector2<f64>) -> JointTrack {
    let up = Vector3::new(-slope.x, 1.0, -slope.y);
    let turn = UnitQuaternion::rotation_between(&up, &Vector3::y()).unwrap_or_default();
    let mut level = track.clone();
    for position in &mut level.positions_m {
        *position = (turn * Vector3::from(*position).map(f64::from)).map(|value| value as f32).into();
    }
    level
}

/// True of contacts between which both feet go somewhere. In a lunge one foot stays where it is.
fn is_walk(legs: &Legs, walk: &[WalkContact]) -> bool {
    if walk.len() < FEWEST_CONTACTS {
        return false;
    }
    let own = |i: usize| Some(stride(walk, i)?.dot(&walk[i].direction));
    // The other foot at the contacts around its own one: where it was, and where it has gone.
    let other = |i: usize| {
        let ankle = &legs.ankles[Legs::index(walk[i].side.opposite())];
        let at = |i: usize| ankle.get(walk[i].node.round() as usize).copied().flatten().map(|moving| moving.place);
        Some((at(i)? - at(i - 2)?).dot(&walk[i].direction))
    };
    let goes = |way: &dyn Fn(usize) -> Option<f64>| {
        let mut ways: Vec<f64> = (2..walk.len()).filter_map(way).collect();
        ways.sort_unstable_by(f64::total_cmp);
        ways.get(ways.len() / 2).is_some_and(|way| *way >= SHORTEST_STRIDE_M)
    };
    goes(&own) && goes(&other)
}

/// The stride that ends with contact `i`.
fn stride(walk: &[WalkContact], i: usize) -> Option<Vector3<f64>> {
    let before = walk.get(i.checked_sub(2)?)?;
    if before.side != walk[i].side {
        return None;
    }
    Some(walk[i].place? - before.place?)
}

/// True of a walk in which the hips face away from where they go.
fn is_backward(legs: &Legs, walk: &[WalkContact]) -> bool {
    let facing = walk.iter().filter_map(|contact| {
        let right = legs.right[(contact.node.round() as usize).min(legs.grid.len - 1)]?;
        Some(Vector3::y().cross(&right).normalize().dot(&contact.direction))
    });
    facing.sum::<f64>() < 0.0
}

fn contacts_of_walk(legs: &Legs, walk: &[WalkContact], number: u64) -> Vec<GaitContact> {
    let heading = |i: usize| {
        let way = stride(walk, i).unwrap_or(walk[i].direction);
        Vector2::new(way.x, way.z)
    };
    let turns = |i: usize, k: usize| heading(i).angle(&heading(k)) > TURN;
    (0..walk.len())
        .map(|i| {
            let contact_s = legs.time_s(walk[i].node);
            let before_s = i.checked_sub(1).map(|i| legs.time_s(walk[i].node));
            // A stride's heading says something of both of its steps.
            let is_turning = (i >= 3 && turns(i, i - 1)) || (i >= 2 && i + 1 < walk.len() && turns(i + 1, i));
            GaitContact {
                toe_off_s: walk[i].toe_off.map(|node| legs.time_s(node)),
                place_m: walk[i].place.map(|place| [place.x, place.z]),
                walk: number,
                coverage: before_s.map_or(1.0, |before_s| legs.coverage(before_s, contact_s)),
                is_turning,
                ..GaitContact::new(walk[i].side, contact_s, [0.0; 2])
            }
        })
        .collect()
}
