//! Standing with the heel of one foot beside the big toe of the other.

use super::held::{SWAY, of_hold};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::stance::longest;
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// How long the stand was held.
const HOLD: MeasureSpec = ("semi_tandem_hold_s", "s", "semi-tandem stand, held for");

/// Standing with the heel of one foot beside the big toe of the other.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "semi_tandem_stand",
    aliases: &[],
    version: 1,
    title: "Semi-tandem stand",
    kind: ProtocolKind::Test,
    instructions: &[
        "Stand beside something to hold.",
        "Put the heel of one foot beside the big toe of the other, the feet touching.",
        "Stand as still as you can for ten seconds or longer.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[&[HOLD], SWAY],
    method: "Feet 0.1 to 0.28 leg lengths apart along the facing direction and less than 0.25 across it. The hold is the longest stretch in which both ankles stay within 0.06 leg lengths, no knee bends and the hips stay high, until a foot moves or the recording ends.",
    source: "Guralnik et al. 1994, short physical performance battery",
    movement: Movement::Held,
    find,
    measure: |motion, found| of_hold(motion, found, HOLD, "that the feet touch and that no hand helps cannot be seen"),
};

fn find(motion: &Motion) -> Found {
    Found { hold: longest(motion, is_right), ..Found::default() }
}

/// Whether feet so far apart, along and across the facing direction in leg lengths, stand like this.
fn is_right(forward: f64, sideways: f64) -> bool {
    (0.1..0.28).contains(&forward) && sideways < 0.25
}
