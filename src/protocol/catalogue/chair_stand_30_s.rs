//! Rises from a chair in thirty seconds.

use crate::assessment::PerformanceMeasure;
use crate::protocol::chair::{self, rises};
use crate::protocol::measures::{OF_BOTH_SIDES, measured, missing, of_repetitions};
use crate::protocol::motion::{INTERVAL_S, Motion};
use crate::protocol::repetitions::Found;
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Length of the test, seconds.
const WINDOW_S: f64 = 30.0;

/// The count of the test.
const CHAIR_STANDS: MeasureSpec = ("chair_stands_30_s", "1", "rises in thirty seconds from the first start");

/// Longest time without an observation in which no rise can be missed, seconds.
const LONGEST_UNSEEN_S: f64 = 0.5;

/// Thirty-second chair stand.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "chair_stand_30_s",
    aliases: &["chair30", "chair_stands_30_s"],
    version: 1,
    title: "30-second chair stand",
    kind: ProtocolKind::Test,
    instructions: &[
        "Place a firm chair of 43 cm without arms against a wall and sit with your arms folded.",
        "Start to record, then stand up fully and sit down as often as you can for thirty seconds.",
        "Keep recording for some seconds after the end.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: true,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[&[CHAIR_STANDS], OF_BOTH_SIDES],
    method: "Rises are ways of the mean knee flexion from sitting (both knees and thighs bent, the body's weight behind the feet) to standing; starts and ends lie where the speed falls below 25 % of the rise's largest. Counted are rises that are more than halfway up 30 s after the first start.",
    source: "CDC STEADI 30-second chair stand, 2017",
    movement: Movement::Repeated(1),
    find: chair::find,
    measure,
};

fn measure(motion: &Motion, found: &Found) -> Vec<PerformanceMeasure> {
    let mut measures = vec![count(motion)];
    measures.extend(of_repetitions(found));
    measures
}

/// Rises that are more than halfway up thirty seconds after the first one's start.
fn count(motion: &Motion) -> PerformanceMeasure {
    let rises = rises(motion);
    let Some(first) = rises.first().filter(|rise| rise.is_complete) else {
        return missing(
            CHAIR_STANDS,
            "the recording does not show the start of the first rise; begin to record while sitting",
        );
    };
    let end_s = motion.seconds(first.onset) + WINDOW_S;
    let recorded_s = motion.seconds(motion.len - 1);
    if recorded_s < end_s {
        let reason = format!(
            "the recording ends {:.1} s after the start of the first rise and the test lasts 30 s; record longer",
            recorded_s - motion.seconds(first.onset)
        );
        return missing(CHAIR_STANDS, reason);
    }
    let last = ((end_s / INTERVAL_S) as usize).min(motion.len - 1);
    if motion.longest_unseen_s(first.onset, last) > LONGEST_UNSEEN_S {
        return missing(CHAIR_STANDS, "the legs were out of sight for more than 0.5 s within the test; repeat it");
    }
    // A rise that turns back before standing counts only when time ran out in it.
    let counts = |rise: &&chair::Rise| {
        motion.seconds(rise.halfway) <= end_s && (rise.is_complete || motion.seconds(rise.way.end) > end_s)
    };
    let n = rises.iter().filter(counts).count();
    let mut count = measured(CHAIR_STANDS, n as f64);
    count.n_observations = Some(n as u64);
    count.reason = "using the arms scores 0 by the test's rules, and arms on the seat cannot be seen; a count has no \
                    standard error"
        .to_owned();
    count
}
