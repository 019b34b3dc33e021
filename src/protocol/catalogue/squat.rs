//! Bending both knees with the weight over the feet, and straightening them.

use crate::body::Side;
use crate::protocol::chair::{SQUAT_BALANCE, bends_both};
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_BOTH_SIDES, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of mean knee flexion, degrees.
const LEAST: Least = Least::of(35.0);

/// Squat.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "squat",
    aliases: &["deep_squat"],
    version: 1,
    title: "Squats",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand with the feet apart as the hips are, something to hold before you.",
        "Bend hips and knees as far as is comfortable, heels on the floor.",
        "Straighten up again.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_BOTH_SIDES],
    method: "Excursions of the mean knee flexion of at least 35 degrees in which both knees and thighs bend together, feet side by side, and the body's weight stays above the feet.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::BothKnees, LEAST, is_right)
}

fn is_right(look: &Look, _: Side) -> bool {
    bends_both(look) && look.places.is_none_or(|places| places.balance >= SQUAT_BALANCE)
}
