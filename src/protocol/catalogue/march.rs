//! Walking or jogging on the spot.

use crate::assessment::Repetition;
use crate::body::Side;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::{INTERVAL_S, Motion};
use crate::protocol::repetitions::{Angle, Found, repetition};
use crate::protocol::transition::{Excursion, Least, transitions};
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of the difference of the knees from one step to the next, degrees.
const LEAST: Least = Least { floor: 10.0, share: 0.3 };

/// Least change of the difference of the thighs, degrees, and in terms of the knees'.
const THIGH_DEG: f64 = 8.0;
const THIGH_RATIO: f64 = 0.35;

/// Fewest steps after each other.
const FEWEST: usize = 3;

/// Longest time from one step to the next, seconds.
const LONGEST_S: f64 = 1.2;

/// Highest that a foot rises, and farthest that the pelvis goes between two steps, leg lengths.
const HIGHEST: f64 = 0.42;
const FARTHEST: f64 = 0.2;

/// Walking on the spot.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "march",
    aliases: &["walk_in_place", "jog_in_place"],
    version: 1,
    title: "Walking on the spot",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand in the middle of the picture with some free space around you.",
        "Walk on the spot, lifting the feet in turn, for as long as the plan says.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Turns of the difference of both knees of at least 10 degrees, with the difference of the thighs turning along, at \
             most 1.2 s apart, a foot rising by less than 0.42 leg lengths and the body staying; three after each other at least.",
    source: "",
    movement: Movement::Repeated(FEWEST),
    find,
    measure: |_, found| of_repetitions(found),
};

/// Steps on the spot: turns of the difference of the knees.
///
/// Somebody who jogs never straightens a knee, and a camera smooths what is left of it; the difference still alternates.
fn find(motion: &Motion) -> Found {
    let difference = |values: &[Vec<f64>; 2]| -> Vec<f64> {
        values[0].iter().zip(&values[1]).map(|(left, right)| left - right).collect()
    };
    let (knees, thighs) = (difference(&motion.knee), difference(&motion.thigh));
    let ways = transitions(&knees, INTERVAL_S, LEAST);
    let mut found = Found::default();
    let mut run: Vec<Repetition> = Vec::new();
    for pair in ways.windows(2) {
        let (out, back) = (pair[0], pair[1]);
        let side = if out.change > 0.0 { Side::Left } else { Side::Right };
        let change = thighs[out.to] - 0.5 * (thighs[out.from] + thighs[back.to]);
        let sign = out.change.signum();
        let lifts = sign * change >= THIGH_DEG.max(THIGH_RATIO * out.change.abs().min(back.change.abs()));
        let is_quick = (back.to - out.from) as f64 * INTERVAL_S <= 2.0 * LONGEST_S;
        if !(lifts && is_quick && stays(motion, side, out.start, back.end)) {
            keep_run(&mut found, &mut run);
            continue;
        }
        let excursion = Excursion { start: out.start, peak: out.to, end: back.end, is_complete: true };
        run.push(repetition(motion, Angle::Knee, Some(side), &motion.knee[side as usize], excursion));
    }
    keep_run(&mut found, &mut run);
    found
}

/// Keeps steps that follow each other if they are enough: a body that only shifts its weight makes one or two.
fn keep_run(found: &mut Found, run: &mut Vec<Repetition>) {
    if run.len() >= FEWEST {
        found.repetitions.append(run);
    }
    run.clear();
}

/// Whether the body stays on the spot during a step.
fn stays(motion: &Motion, side: Side, start: usize, end: usize) -> bool {
    let Some(places) = &motion.places else { return true };
    let rise = (start..=end).map(|i| places.foot_way(side, start, i)[1]).filter(|rise| rise.is_finite());
    let way = places.pelvis[end] - places.pelvis[start];
    rise.fold(0.0, f64::max) < HIGHEST && way.x.hypot(way.z) < FARTHEST * places.leg_length_m
}
