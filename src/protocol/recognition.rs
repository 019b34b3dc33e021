//! Which protocols a recording looks like, and the performance of the one that was declared.

use super::catalogue::PROTOCOLS;
use super::motion::Motion;
use super::repetitions::Found;
use super::{Movement, Protocol, ProtocolSensor, find};
use crate::assessment::{Assessment, Performance, PerformanceStatus};
use crate::gait::{self, GaitFindings};

/// Share of the best movement's time that another one must fill to be recognised beside it.
const BESIDE: f64 = 0.4;

/// Share of a stand's time that repetitions may fill for the recording to be a stand.
const BESIDE_HOLD: f64 = 0.3;

/// Shortest stand that a recording is recognised by, seconds.
const SHORTEST_HOLD_S: f64 = 3.0;

/// Share of the recording in which the knees must be seen for anything to be said.
const LEAST_COVERAGE: f64 = 0.4;

/// Measures how the declared protocol was performed. Pure: the same assessment gives the same performance.
///
/// Without a protocol of the catalogue nothing is measured, but what the movement looks like is told.
pub fn perform(declared: Option<&str>, assessment: &Assessment) -> Performance {
    let seen = Seen::of(assessment);
    let mut performance = Performance {
        protocol: declared.map(str::to_owned),
        protocol_version: None,
        status: PerformanceStatus::NotMeasured,
        reason: String::new(),
        recognized: seen.recognized.iter().map(|id| (*id).to_owned()).collect(),
        repetitions: Vec::new(),
        measures: Vec::new(),
        footfalls: None,
    };
    let Some(protocol) = declared.and_then(find) else {
        performance.reason = not_of_the_catalogue(declared, &seen.recognized);
        return performance;
    };
    performance.protocol = Some(protocol.id.to_owned());
    performance.protocol_version = Some(protocol.version);
    if let Some(why) = seen.refusal(protocol) {
        performance.reason = why;
        return performance;
    }
    let found = seen.found_of(protocol);
    if seen.recognized.contains(&protocol.id) {
        performance.status = PerformanceStatus::Measured;
        if let (Some(found), Some(motion)) = (found, &seen.motion) {
            performance.repetitions = found.repetitions.clone();
            performance.measures = (protocol.measure)(motion, found);
        }
        if let (Movement::Walked, Some(found)) = (protocol.movement, steps_of(assessment)) {
            let (measures, footfalls) = found.into_parts();
            performance.measures.extend(measures);
            performance.footfalls = Some(footfalls);
        }
        return performance;
    }
    if seen.recognized.is_empty() {
        let partly = found.filter(|found| !found.repetitions.is_empty() || found.n_unseen > 0);
        if let Some(found) = partly {
            performance.repetitions = found.repetitions.clone();
            performance.reason = format!(
                "no repetition of {} was seen from start to end: {} cut off by the recording's ends, {} hardly seen; begin to \
                 record before the first repetition, stop after the last, and keep the whole body in view",
                protocol.id,
                found.repetitions.len(),
                found.n_unseen
            );
            return performance;
        }
    }
    performance.status = PerformanceStatus::OtherMovement;
    performance.reason = other_movement(protocol, &seen.recognized);
    performance
}

/// What the footfalls of a walk tell: those of the leg trackers, or else those of the skeleton.
fn steps_of(assessment: &Assessment) -> Option<GaitFindings> {
    let of_legs = assessment.gait.as_ref().map(gait::measures_of_steps);
    of_legs.or_else(|| assessment.joints.as_ref().map(gait::measures_of_track))
}

/// Protocols of the catalogue that a recording looks like, the likeliest first.
pub fn recognize(assessment: &Assessment) -> Vec<&'static str> {
    Seen::of(assessment).recognized
}

/// Everything that was looked for in a recording.
struct Seen {
    motion: Option<Motion>,
    /// What each repeated or held protocol found.
    found: Vec<(&'static Protocol, Found)>,
    recognized: Vec<&'static str>,
    is_walker: bool,
}

impl Seen {
    fn of(assessment: &Assessment) -> Self {
        let is_walker = assessment.pipeline == "leg_pose";
        let motion = if is_walker { None } else { Motion::of(assessment) };
        let mut seen = Self { motion, found: Vec::new(), recognized: Vec::new(), is_walker };
        if is_walker {
            let steps = assessment.gait.as_ref().map_or(0, |gait| gait.steps.len());
            let walked = PROTOCOLS.iter().filter(|protocol| protocol.sensor == ProtocolSensor::DepthWalker);
            seen.recognized = walked.filter(|_| steps >= 2).map(|protocol| protocol.id).collect();
            return seen;
        }
        let Some(motion) = &seen.motion else { return seen };
        let of_skeleton = PROTOCOLS.iter().filter(|protocol| protocol.sensor == ProtocolSensor::Skeleton);
        seen.found = of_skeleton.map(|protocol| (*protocol, (protocol.find)(motion))).collect();
        seen.recognized = recognized(&seen.found);
        seen
    }

    fn found_of(&self, protocol: &Protocol) -> Option<&Found> {
        self.found.iter().find(|(other, _)| other.id == protocol.id).map(|(_, found)| found)
    }

    /// Why the recording cannot show a protocol at all.
    fn refusal(&self, protocol: &Protocol) -> Option<String> {
        match (protocol.sensor, self.is_walker, &self.motion) {
            (ProtocolSensor::DepthWalker, false, _) => Some(format!(
                "{} is measured in depth images of the legs behind a walker; this recording has none",
                protocol.id
            )),
            (ProtocolSensor::Skeleton, true, _) => Some(format!(
                "{} needs the skeleton of a camera that sees the whole body; this recording holds the legs behind a walker",
                protocol.id
            )),
            (ProtocolSensor::Skeleton, false, None) => Some(
                "the recording is shorter than a movement, or has no angles of hips and knees; record the whole body for \
                 several seconds"
                    .to_owned(),
            ),
            (ProtocolSensor::Skeleton, false, Some(motion)) => {
                let coverage = motion.coverage(0, motion.len - 1, &crate::body::Side::BOTH);
                (coverage < LEAST_COVERAGE).then(|| {
                    format!(
                        "both knees were seen in {:.0} % of the recording only; keep the whole body in view, the feet too",
                        100.0 * coverage
                    )
                })
            }
            (ProtocolSensor::DepthWalker, true, _) => self.recognized.is_empty().then(|| {
                "fewer than two steps were found; walk some metres behind the walker while it records".to_owned()
            }),
        }
    }
}

/// Which of the protocols are recognised, by the time that they fill.
fn recognized(found: &[(&'static Protocol, Found)]) -> Vec<&'static str> {
    let filled = |protocol: &Protocol, found: &Found| match protocol.movement {
        Movement::Repeated(least) if found.complete().count() >= least => found.filled_s(),
        Movement::Walked => found.walk.map_or(0.0, |walk| walk.moving_s),
        _ => 0.0,
    };
    let best = found.iter().map(|(protocol, found)| filled(protocol, found)).fold(0.0, f64::max);
    let held_s = |found: &Found| found.hold.map_or(0.0, |hold| hold.seconds());
    let longest_s = found.iter().map(|(_, found)| held_s(found)).fold(0.0, f64::max);
    let mut recognized: Vec<(f64, &'static str)> = Vec::new();
    for (protocol, found) in found {
        let seconds = filled(protocol, found);
        if seconds > 0.0 && seconds >= BESIDE * best {
            recognized.push((seconds, protocol.id));
        }
        let hold_s = held_s(found);
        let is_long = hold_s >= SHORTEST_HOLD_S && hold_s >= BESIDE * longest_s;
        if is_long && best <= BESIDE_HOLD * hold_s {
            recognized.push((hold_s, protocol.id));
        }
    }
    // A stable sort: equals stay in the catalogue's order.
    recognized.sort_by(|a, b| b.0.total_cmp(&a.0));
    recognized.into_iter().map(|(_, id)| id).collect()
}

fn not_of_the_catalogue(declared: Option<&str>, recognized: &[&str]) -> String {
    let what = match declared {
        Some(name) => format!("`{name}` is not in the catalogue of protocols"),
        None => "the recording names no protocol".to_owned(),
    };
    let looks = match recognized {
        [] => "the movement looks like none of them".to_owned(),
        some => format!("the movement looks like {}", some.join(" or ")),
    };
    let ids: Vec<&str> = PROTOCOLS.iter().map(|protocol| protocol.id).collect();
    format!("{what} ({}); {looks}. Name one of them in the recording's header", ids.join(", "))
}

fn other_movement(protocol: &Protocol, recognized: &[&str]) -> String {
    let looks = match recognized {
        [] => "looks like nothing in the catalogue".to_owned(),
        some => format!("looks like {}", some.join(" or ")),
    };
    let first = protocol.instructions.first().copied().unwrap_or_default();
    format!("the movement {looks}, not like {}; record again as that protocol says: {first}", protocol.id)
}
