//! A walk behind a walker with a depth camera on its legs.

use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::walking::OF_FOOTFALLS;
use crate::protocol::{Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Walk with a walker.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "walk_with_walker",
    aliases: &["walker"],
    version: 1,
    title: "Walk with a walker",
    kind: ProtocolKind::Test,
    instructions: &[
        "Fix the depth camera to the walker so that it sees both lower legs.",
        "Walk ten metres or more at your usual pace.",
    ],
    sensor: ProtocolSensor::DepthWalker,
    needs_chair: false,
    view: "on the walker, looking back and down at the legs",
    measures: &[OF_FOOTFALLS],
    method: "Steps are found in the depth images by the assessment of gait; there are no repetitions of angles.",
    source: "",
    movement: Movement::Walked,
    find,
    measure: |_, _| Vec::new(),
};

/// Its steps are found in depth images, by the assessment of gait; angles have none.
fn find(_: &Motion) -> Found {
    Found::default()
}
