//! Standing with the feet together.

use super::held::{SWAY, of_hold};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::stance::longest;
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// How long the stand was held.
const HOLD: MeasureSpec = ("side_by_side_hold_s", "s", "side-by-side stand, held for");

/// Standing with the feet together.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "side_by_side_stand",
    aliases: &[],
    version: 1,
    title: "Side-by-side stand",
    kind: ProtocolKind::Test,
    instructions: &[
        "Stand beside something to hold.",
        "Put the feet together, side by side and touching.",
        "Stand as still as you can for ten seconds or longer.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[&[HOLD], SWAY],
    method: "Feet less than 0.1 leg lengths apart along the facing direction and less than 0.2 across it. The hold is the longest stretch in which both ankles stay within 0.06 leg lengths, no knee bends and the hips stay high, until a foot moves or the recording ends.",
    source: "Guralnik et al. 1994, short physical performance battery",
    movement: Movement::Held,
    find,
    measure: |motion, found| {
        of_hold(
            motion,
            found,
            HOLD,
            "that the feet touch and that no hand helps cannot be seen: ankles a hand's breadth apart look the same",
        )
    },
};

fn find(motion: &Motion) -> Found {
    Found { hold: longest(motion, is_right), ..Found::default() }
}

/// Whether feet so far apart, along and across the facing direction in leg lengths, stand like this.
fn is_right(forward: f64, sideways: f64) -> bool {
    forward < 0.1 && sideways < 0.2
}
