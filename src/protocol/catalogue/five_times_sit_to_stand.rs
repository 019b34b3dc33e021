//! Five rises from a chair as fast as is safe.

use crate::assessment::PerformanceMeasure;
use crate::protocol::chair::{self, rises};
use crate::protocol::measures::{OF_BOTH_SIDES, missing, of_repetitions, timed};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Rises that are timed.
const RISES: usize = 5;

/// The time of the test.
const FIVE_TIMES: MeasureSpec =
    ("five_times_sit_to_stand_s", "s", "five rises, from the first start to the fifth standing");

/// Five-times sit-to-stand.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "five_times_sit_to_stand",
    aliases: &["sit_to_stand", "sts5"],
    version: 1,
    title: "Five-times sit-to-stand",
    kind: ProtocolKind::Test,
    instructions: &[
        "Place a firm chair of 43 to 45 cm without arms against a wall and sit with your arms folded.",
        "Stand up fully and sit down, five times, as fast as is safe.",
        "Stay standing after the fifth rise.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: true,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[&[FIVE_TIMES], OF_BOTH_SIDES],
    method: "Rises are ways of the mean knee flexion from sitting (both knees and thighs bent, the body's weight behind the feet) to standing; starts and ends lie where the speed falls below 25 % of the rise's largest.",
    source: "Tiedemann et al. 2008, Age Ageing 37:430-435, doi 10.1093/ageing/afn100",
    movement: Movement::Repeated(1),
    find: chair::find,
    measure,
};

fn measure(motion: &Motion, found: &Found) -> Vec<PerformanceMeasure> {
    let mut measures = vec![time(motion)];
    measures.extend(of_repetitions(found));
    measures
}

/// Time from the start of the first rise to the full standing of the fifth.
fn time(motion: &Motion) -> PerformanceMeasure {
    let rises = rises(motion);
    let complete: Vec<_> = rises.iter().filter(|rise| rise.is_complete).collect();
    let (Some(first), Some(fifth)) = (complete.first(), complete.get(RISES - 1)) else {
        let reason = format!(
            "{} complete rises were seen and five are timed; record from sitting before the first to standing after the fifth",
            complete.len()
        );
        return missing(FIVE_TIMES, reason);
    };
    let is_whole = rises.iter().take_while(|rise| rise.way.end <= fifth.way.end).count() == RISES;
    if !is_whole {
        return missing(
            FIVE_TIMES,
            "a rise before the fifth did not reach full standing or was cut off; repeat the test",
        );
    }
    timed(
        motion,
        FIVE_TIMES,
        [motion.seconds(first.onset), motion.seconds(fifth.way.end)],
        RISES,
        "from the trunk's first lean or the knees' first extension; whether the arms helped, and the seat's height, cannot be \
         seen",
    )
}
