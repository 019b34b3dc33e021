//! A long step forwards, both knees bending, and back.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_BOTH_SIDES, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of mean knee flexion, degrees.
const LEAST: Least = Least::of(25.0);

/// Forward lunge.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "lunge",
    aliases: &["inline_lunge", "forward_lunge"],
    version: 1,
    title: "Lunges forwards",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand upright with two metres of free space ahead.",
        "Step far forwards with one leg and bend both knees.",
        "Push back up.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "at an angle from the front, two to three metres away: from straight ahead one leg hides the other",
    measures: &[OF_BOTH_SIDES],
    method: "Excursions of the mean knee flexion of at least 25 degrees in which a knee bends by more than 40 degrees while the feet are more than 0.3 leg lengths apart along the facing direction, or the body or a foot goes as far forwards.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::BothKnees, LEAST, is_right)
}

fn is_right(look: &Look, _: Side) -> bool {
    let bends =
        look.knee_change.iter().any(|change| *change > 40.0) && look.knee_change.iter().all(|change| *change > -10.0);
    let thighs_apart = (look.thigh[0] - look.thigh[1]).abs() > 28.0;
    let Some(places) = look.places else { return bends && thighs_apart };
    // Behind the front leg a camera loses the other one: that the feet are apart, or that body or foot went far, each tell.
    let far = places.feet_apart[0].abs() > 0.3
        || places.pelvis_forward > 0.3
        || places.foot_forward.iter().any(|way| *way > 0.5);
    let sinks = places.pelvis_drop > 0.1 && places.travel < 0.4;
    bends && far && sinks && places.feet_apart[1].abs() < 0.6 && places.foot_rise.iter().all(|rise| *rise < 0.3)
}
