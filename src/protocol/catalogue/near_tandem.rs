//! Standing with one foot in front of the other and a little to the side.

use super::held::{SWAY, of_hold};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::stance::longest;
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// How long the stand was held.
const HOLD: MeasureSpec = ("near_tandem_hold_s", "s", "near tandem stand, held for");

/// Standing with one foot in front of the other and a little to the side.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "near_tandem",
    aliases: &["near_tandem_stand"],
    version: 1,
    title: "Near tandem stand",
    kind: ProtocolKind::Test,
    instructions: &[
        "Stand beside something to hold, barefoot.",
        "Put one foot ahead so that its heel is 2.5 cm in front of and 2.5 cm beside the other foot's toes.",
        "Close your eyes if the plan says so, and stand as still as you can for ten seconds or longer.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[&[HOLD], SWAY],
    method: "Feet more than 0.2 leg lengths apart along the facing direction and less than 0.2 across it; a camera cannot tell 2.5 cm, so a tandem stand looks the same. The hold is the longest stretch in which both ankles stay within 0.06 leg lengths, no knee bends and the hips stay high, until a foot moves or the recording ends.",
    source: "Tiedemann, Lord, Sherrington 2010, J Gerontol A 65:896-903, doi 10.1093/gerona/glq067",
    movement: Movement::Held,
    find,
    measure: |motion, found| {
        of_hold(
            motion,
            found,
            HOLD,
            "closed eyes, bare feet and a hand on a support cannot be seen, and a tandem stand looks the same",
        )
    },
};

fn find(motion: &Motion) -> Found {
    Found { hold: longest(motion, is_right), ..Found::default() }
}

/// Whether feet so far apart, along and across the facing direction in leg lengths, stand like this.
fn is_right(forward: f64, sideways: f64) -> bool {
    forward > 0.2 && sideways < 0.2
}
