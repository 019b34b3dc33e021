//! The alternate step test of QuickScreen: eight steps, the feet in turn.

use super::step;
use crate::assessment::{PerformanceMeasure, Repetition};
use crate::protocol::measures::{OF_EACH_SIDE, missing, of_repetitions, timed};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::{MeasureSpec, Movement, Protocol, ProtocolKind, ProtocolSensor};

/// Steps that are timed.
const STEPS: usize = 8;

/// The time of the test.
const ALTERNATE_STEP: MeasureSpec = ("alternate_step_s", "s", "eight steps onto the step, the feet in turn");

/// Alternate step test.
pub(super) static PROTOCOL: Protocol = Protocol {
    id: "alternate_step",
    aliases: &[],
    version: 1,
    title: "Alternate step test",
    kind: ProtocolKind::Test,
    instructions: &[
        "Place a firm step of 18 cm in front of you, something to hold within reach.",
        "Put the whole left foot on the step and back on the floor, then the right one.",
        "Do this eight times, the feet in turn, as fast as is safe.",
    ],
    sensor: ProtocolSensor::Skeleton,
    needs_chair: false,
    view: "in front, two to three metres away, at hip height, the whole body with both feet in view",
    measures: &[&[ALTERNATE_STEP], OF_EACH_SIDE],
    method: "Repetitions as in `step`; the time runs from the first foot's lift to the eighth foot's return to the floor, and there is one only when eight complete steps follow each other with the feet in turn.",
    source: "Tiedemann, Lord, Sherrington 2010, J Gerontol A 65:896-903, doi 10.1093/gerona/glq067",
    movement: Movement::Repeated(1),
    find: step::find,
    measure,
};

fn measure(motion: &Motion, found: &Found) -> Vec<PerformanceMeasure> {
    let mut measures = vec![time(motion, found)];
    measures.extend(of_repetitions(found));
    measures
}

/// Time of the first eight complete steps with the feet in turn.
fn time(motion: &Motion, found: &Found) -> PerformanceMeasure {
    let complete: Vec<&Repetition> = found.complete().collect();
    let alternates = |steps: &&[&Repetition]| steps.windows(2).all(|pair| pair[0].side != pair[1].side);
    let Some(steps) = complete.windows(STEPS).find(alternates) else {
        let reason = format!(
            "{} complete steps were seen, but not eight after each other with the feet in turn; record all eight",
            complete.len()
        );
        return missing(ALTERNATE_STEP, reason);
    };
    timed(
        motion,
        ALTERNATE_STEP,
        [steps[0].start_s, steps[STEPS - 1].end_s],
        STEPS,
        "from the first foot's lift to the eighth's return; the step's height and a hand on a rail cannot be seen",
    )
}
