//! Alternate elevation of the straight leg to the side, in standing.

use crate::body::Side;
use crate::protocol::look::Look;
use crate::protocol::measures::{OF_EACH_SIDE, of_repetitions};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::{Angle, Found, find as find_repetitions};
use crate::protocol::transition::Least;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Least change of hip abduction, degrees: twice what a standing body shows.
const LEAST: Least = Least::of(12.0);

/// Leg raise to the side.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "side_hip",
    aliases: &["hip_abduction_standing"],
    version: 1,
    title: "Leg raises to the side, standing",
    kind: ProtocolKind::Exercise,
    instructions: &[
        "Stand behind a chair and hold its back.",
        "Raise one straight leg to the side, toes forwards, trunk upright.",
        "Lower it, then do the same with the other leg.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[OF_EACH_SIDE],
    method: "Excursions of one hip's abduction of at least 12 degrees while both knees stay straight and the thigh does not come forwards.",
    source: "",
    movement: Movement::Repeated(1),
    find,
    measure: |_, found| of_repetitions(found),
};

fn find(motion: &Motion) -> Found {
    find_repetitions(motion, Angle::Abduction, LEAST, is_right)
}

fn is_right(look: &Look, side: Side) -> bool {
    let own = side as usize;
    let abduction = look.abduction_change[own];
    let straight = look.knee_change.iter().all(|change| change.abs() < 0.8 * abduction.max(20.0));
    let sideways = look.thigh_change.iter().all(|change| change.abs() < 0.7 * abduction);
    straight && sideways && look.places.is_none_or(|places| places.foot_rise[own] > 0.02 && places.travel < 0.35)
}
