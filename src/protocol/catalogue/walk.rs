//! A walk across the view of the camera.

use crate::assessment::PerformanceMeasure;
use crate::protocol::measures::measured;
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::walking::{OF_FOOTFALLS, walk};
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// How far somebody walked.
const DISTANCE: MeasureSpec = ("walked_distance_m", "m", "way of the pelvis while it moved faster than 0.15 m/s");

/// Walk.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "walk",
    aliases: &[],
    version: 1,
    title: "Walk",
    kind: ProtocolKind::Test,
    instructions: &[
        "Clear a straight way of four metres or more towards the camera.",
        "Walk it at your usual pace, and turn outside of the picture.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "at the end of the way, at hip height; the whole body must be in view over the way that counts",
    measures: &[&[DISTANCE], OF_FOOTFALLS],
    method: "A walk is a recording in which the pelvis comes more than 1.2 m from where it began; steps are found by the courses of pelvis and feet.",
    source: "",
    movement: Movement::Walked,
    find,
    measure,
};

fn find(motion: &Motion) -> Found {
    Found { walk: walk(motion), ..Found::default() }
}

fn measure(_: &Motion, found: &Found) -> Vec<PerformanceMeasure> {
    let Some(walk) = found.walk else { return Vec::new() };
    vec![measured(DISTANCE, walk.distance_m)]
}
