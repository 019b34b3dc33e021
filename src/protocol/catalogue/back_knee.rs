//! Alternate knee flexion in standing: the heel comes towards the buttock, the thigh hangs.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of knee flexion, degrees.
const LEAST: Least = Least::of(30.0);

/// Knee flexion in standing.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "back_knee",
    aliases: &["knee_bend_standing"],
    version: 1,
    title: "Knee bends, standing",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand behind a chair and hold its back with your fingertips.",
        "Bend one knee and bring the heel up behind you, thigh straight down.",
        "Lower the foot, then do the same with the other leg.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one knee's flexion of at least 30 degrees while the thigh hangs (it turns by less than half as much), the other knee stays and the foot leaves the floor.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::Knee, LEAST, is_right)
}

fn is_right(look: &Look, side: Side) -> bool {
    let (own, other) = (side as usize, side.opposite() as usize);
    let knee = look.knee_change[own];
    let hangs = look.thigh_change[own].abs() < 0.35 * knee;
    let stands_on_the_other = look.knee_change[other].abs() < 0.3 * knee && look.thigh[other].abs() < 35.0;
    // A lifted shank brings its ankle up by a fifth of the leg at least.
    hangs && stands_on_the_other && look.places.is_none_or(|places| places.foot_rise[own] > 0.1 && places.travel < 0.35)
}
