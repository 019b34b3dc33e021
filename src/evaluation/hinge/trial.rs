//! Joints with a known angle.

use crate::body::Side;
use crate::recording::{InertialSensor, Recording, ReferenceSeries, Segment};
use nalgebra::{Quaternion, UnitQuaternion};
use std::f64::consts::{PI, TAU};

/// Hinges of the test chain: proximal and distal link, and the component of the axis, which the set's authors name.
const CHAIN_HINGES: [(Segment, Segment, usize); 3] = [
    (Segment::Object2, Segment::Object3, 0),
    (Segment::Object3, Segment::Object4, 1),
    (Segment::Object4, Segment::Object5, 2),
];

/// Two units on the segments of one joint, and the joint's angle.
#[derive(Debug, Clone, PartialEq)]
pub struct HingeTrial {
    /// Trials of one set are averaged.
    pub set: String,
    /// Name within the set.
    pub name: String,
    /// Proximal and distal unit.
    pub units: [InertialSensor; 2],
    /// Times of the reference on the units' clock, nanoseconds.
    pub reference_time_ns: Vec<i64>,
    /// Reference angle, rad; NaN where there is none.
    pub reference: Vec<f64>,
    /// True when positive is flexion; otherwise the reference's sense is arbitrary.
    pub has_sense: bool,
}

/// The joints of a recording whose angle is known: knees with a channel `<side>_knee_flexion_deg`, and the hinges of a chain
/// of five objects with optical orientations.
pub fn trials(set: &str, name: &str, recording: &Recording) -> Vec<HingeTrial> {
    let Some(inertial) = &recording.inertial else { return Vec::new() };
    let mut trials = Vec::new();
    for side in [Side::Left, Side::Right] {
        let (proximal, distal) = match side {
            Side::Left => (Segment::LeftThigh, Segment::LeftShank),
            Side::Right => (Segment::RightThigh, Segment::RightShank),
        };
        let channel = format!("{}_knee_flexion_deg", side.name());
        let reference = recording.references.iter().find(|series| series.channel == channel);
        let units = (inertial.sensor(proximal), inertial.sensor(distal));
        let (Some(reference), (Some(proximal), Some(distal))) = (reference, units) else { continue };
        trials.push(HingeTrial {
            set: set.to_owned(),
            name: format!("{name} {} knee", side.name()),
            units: [proximal.clone(), distal.clone()],
            reference_time_ns: reference.time_ns.iter().map(|time| time + reference.clock_offset_ns).collect(),
            reference: reference.values.iter().map(|value| value.to_radians()).collect(),
            has_sense: true,
        });
    }
    if inertial.sensor(Segment::Object1).is_some() {
        trials.extend(CHAIN_HINGES.into_iter().filter_map(|hinge| chain_trial(set, name, recording, hinge)));
    }
    trials
}

fn chain_trial(
    set: &str,
    name: &str,
    recording: &Recording,
    (proximal, distal, axis): (Segment, Segment, usize),
) -> Option<HingeTrial> {
    let inertial = recording.inertial.as_ref()?;
    let units = [inertial.sensor(proximal)?.clone(), inertial.sensor(distal)?.clone()];
    let (times, proximal_turns) = orientations(&recording.references, proximal)?;
    let (_, distal_turns) = orientations(&recording.references, distal)?;
    let mut last: f64 = 0.0;
    let angles = proximal_turns.iter().zip(&distal_turns).map(|(a, b)| {
        let (Some(a), Some(b)) = (a, b) else { return f64::NAN };
        let turn = a.inverse() * b;
        let angle = 2.0 * turn.imag()[axis].atan2(turn.w);
        last += (angle - last + PI).rem_euclid(TAU) - PI;
        last
    });
    let reference = angles.collect();
    let mounting = units[0].mounting.iter().map(|mounting| format!(" {mounting}"));
    Some(HingeTrial {
        set: std::iter::once(set.to_owned()).chain(mounting).collect(),
        name: format!("{name} {proximal}-{distal}"),
        units,
        reference_time_ns: times,
        reference,
        has_sense: false,
    })
}

/// Times and optical orientation of a segment; none in the list where markers were lost.
#[expect(clippy::type_complexity, reason = "two parallel series, used once")]
fn orientations(
    references: &[ReferenceSeries],
    segment: Segment,
) -> Option<(Vec<i64>, Vec<Option<UnitQuaternion<f64>>>)> {
    let part = |part: &str| {
        let channel = format!("{segment}_orientation_{part}");
        references.iter().find(|series| series.channel == channel)
    };
    let (w, x, y, z) = (part("w")?, part("x")?, part("y")?, part("z")?);
    let turns = (0..w.time_ns.len()).map(|i| {
        let q = Quaternion::new(w.values[i], *x.values.get(i)?, *y.values.get(i)?, *z.values.get(i)?);
        // NaN compares false.
        (q.norm() > 0.5).then(|| UnitQuaternion::from_quaternion(q))
    });
    Some((w.time_ns.iter().map(|time| time + w.clock_offset_ns).collect(), turns.collect()))
}
