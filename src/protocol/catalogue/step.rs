//! Alternate stepping forward onto a low step, weight over it, and back.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of knee flexion, degrees.
const LEAST: Least = Least::of(30.0);

/// Steps onto a low step.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "step",
    aliases: &["step_up"],
    version: 1,
    title: "Steps onto a low step",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Place a firm step of 12 to 20 cm in front of you, with something to hold beside it.",
        "Put one foot on the step, bring your weight over it, and step back.",
        "Do the same with the other leg.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one knee's flexion of at least 30 degrees with the thigh coming forwards, in which the foot is raised by 0.12 to 0.42 leg lengths, put forwards and brought back, while the other foot stays.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

/// Steps onto the step.
pub(super) fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::Knee, LEAST, is_right)
}

fn is_right(look: &Look, side: Side) -> bool {
    let (own, other) = (side as usize, side.opposite() as usize);
    let raised = look.thigh_change[own] > 20.0
        && look.knee_change[own] > 30.0
        && look.thigh_change[own] > 0.35 * look.knee_change[own];
    let stands_on_the_other =
        look.knee_change[other].abs() < 0.6 * look.knee_change[own] && look.thigh[other].abs() < 30.0;
    raised
        && stands_on_the_other
        && look.places.is_none_or(|places| {
            let onto = (0.12..0.42).contains(&places.foot_rise[own]) && places.foot_forward[own] > 0.1;
            onto && places.foot_left[own] < 0.2 && places.foot_rise[other] < 0.08
        })
}
