//! Raising the straight leg forwards in standing.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of hip flexion, degrees.
const LEAST: Least = Least::of(30.0);

/// Straight leg raise.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "leg_raise",
    aliases: &["straight_leg_raise"],
    version: 1,
    title: "Straight leg raises, standing",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand upright beside something to hold.",
        "Raise one straight leg forwards as far as is comfortable.",
        "Lower it slowly.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one hip's flexion of at least 30 degrees while its knee bends by less than half as much and the other leg stands.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::Hip, LEAST, is_right)
}

fn is_right(look: &Look, side: Side) -> bool {
    let (own, other) = (side as usize, side.opposite() as usize);
    let thigh = look.thigh_change[own];
    let straight = look.knee_change[own].abs() < 0.5 * thigh;
    let stands_on_the_other = look.thigh_change[other].abs() < 0.3 * thigh && look.knee[other] < 40.0;
    thigh > 25.0
        && straight
        && stands_on_the_other
        && look.places.is_none_or(|places| places.foot_rise[own] > 0.08 && places.travel < 0.35)
}
