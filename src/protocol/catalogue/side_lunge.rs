//! Feet wide apart, bending one knee while the other stays straight.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of knee flexion, degrees.
const LEAST: Least = Least::of(35.0);

/// Side lunge.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "side_lunge",
    aliases: &[],
    version: 1,
    title: "Lunges to the side",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand with the feet wide apart.",
        "Shift over one leg and bend its knee, the other leg stays straight.",
        "Push back to the middle.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one knee's flexion of at least 35 degrees while the feet are more than 0.7 leg lengths apart sideways and the other knee bends by less than 0.7 as much.",
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
    let one_knee = look.knee_change[other] < 0.7 * look.knee_change[own];
    // Only places tell that the feet are apart.
    one_knee && look.places.is_some_and(|places| places.feet_apart[1].abs() > 0.7 && places.feet_apart[0].abs() < 0.5)
}
