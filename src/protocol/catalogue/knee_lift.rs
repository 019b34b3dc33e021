//! Lifting one knee in standing, as over a hurdle.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of knee flexion, degrees.
const LEAST: Least = Least::of(40.0);

/// Knee lift in standing.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "knee_lift",
    aliases: &["hurdle_step"],
    version: 1,
    title: "Knee lifts, standing (hurdle step)",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand upright beside something to hold.",
        "Lift one knee until the thigh is level, or step over a low hurdle and back.",
        "Put the foot down where it was.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one knee's flexion of at least 40 degrees with the thigh coming forwards by at least 30 degrees and the foot rising by more than 0.3 leg lengths, while the other leg stands.",
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
    let raised = look.thigh_change[own] > 30.0 && look.thigh_change[own] > 0.35 * look.knee_change[own];
    let stands_on_the_other =
        look.knee_change[other].abs() < 0.35 * look.knee_change[own] && look.thigh[other].abs() < 30.0;
    raised
        && stands_on_the_other
        && look.places.is_none_or(|places| places.foot_rise[own] > 0.3 && places.travel < 0.35)
}
