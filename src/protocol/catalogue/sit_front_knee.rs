//! Alternate elevation of the shank while sitting, until the knee is nearly straight.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of knee flexion, degrees.
const LEAST: Least = Least::of(25.0);

/// Knee extension in sitting.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "sit_front_knee",
    aliases: &["knee_extension_sitting"],
    version: 1,
    title: "Knee stretches, sitting",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Sit upright on a firm chair, both feet on the floor.",
        "Raise one foot until the knee is nearly straight.",
        "Lower it, then do the same with the other leg.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: true,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one knee's flexion downwards by at least 25 degrees while both thighs stay raised as in sitting and the other knee stays bent.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::KneeExtension, LEAST, is_right)
}

fn is_right(look: &Look, side: Side) -> bool {
    let (own, other) = (side as usize, side.opposite() as usize);
    let knee = -look.knee_change[own];
    // Kinect v1 shows a sitting thigh at 43 degrees.
    let sits = look.thigh.iter().all(|thigh| *thigh > 35.0) && look.knee[other] > 40.0;
    let other_rests = look.knee_change[other].abs() < 0.4 * knee && look.thigh_change[other].abs() < 25.0;
    sits && other_rests && look.thigh_change[own].abs() < 40.0
}
