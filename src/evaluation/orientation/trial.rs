//! Trials with a known orientation.

use super::alignment::align;
use crate::recording::{InertialSensor, Recording, ReferenceSeries};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Time after which a trial without a record of its movement is scored, s: filters may settle before.
const SETTLING_SECONDS: f64 = 5.0;
/// Channel that says by 1 where a sample counts.
const MOVEMENT: &str = "movement";

/// One unit with an optical reference.
#[derive(Debug, Clone, PartialEq)]
pub struct OrientationTrial {
    /// Trials of one set are averaged.
    pub set: String,
    /// Name within the set.
    pub name: String,
    /// Times of the unit's samples, nanoseconds.
    pub time_ns: Vec<i64>,
    /// Specific force, m/s².
    pub acceleration: Vec<Vector3<f64>>,
    /// Angular rate, rad/s.
    pub angular_rate: Vec<Vector3<f64>>,
    /// The reference, on the unit's clock.
    pub reference: Vec<ReferencePoint>,
}

/// What the optical system saw at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferencePoint {
    /// Time on the unit's clock, nanoseconds.
    pub time_ns: i64,
    /// Rotation from the unit's frame into `earth` (y up).
    pub earth_from_sensor: UnitQuaternion<f64>,
    /// True where errors count.
    pub is_scored: bool,
}

/// The trials of a recording: one for each unit that has the four channels `<segment>_orientation_w` to `_z`.
///
/// Where the recording has a channel `movement`, samples at 1 are scored, otherwise those from 5 s on. With
/// `is_aligned` the reference is taken as it is; otherwise it is brought to the unit's frame, to the vertical and to the
/// unit's clock from the movement itself ([`align`]).
pub fn trials(set: &str, name: &str, recording: &Recording, is_aligned: bool) -> Vec<OrientationTrial> {
    let sensors = recording.inertial.iter().flat_map(|inertial| &inertial.sensors);
    sensors
        .filter_map(|sensor| {
            let mut trial = trial(set, name, sensor, &recording.references)?;
            if !is_aligned {
                align(&mut trial);
            }
            Some(trial)
        })
        .collect()
}

fn trial(set: &str, name: &str, sensor: &InertialSensor, references: &[ReferenceSeries]) -> Option<OrientationTrial> {
    let channel = |name: &str| references.iter().find(|series| series.channel == name);
    let part = |part: &str| channel(&format!("{}_orientation_{part}", sensor.segment));
    let (w, x, y, z) = (part("w")?, part("x")?, part("y")?, part("z")?);
    let movement = channel(MOVEMENT);
    let first = *sensor.time_ns.first()?;
    let mut reference = Vec::new();
    for (i, time_ns) in w.time_ns.iter().enumerate() {
        let q = Quaternion::new(w.values[i], *x.values.get(i)?, *y.values.get(i)?, *z.values.get(i)?);
        // Where markers were lost there are no numbers.
        if q.norm().is_nan() || q.norm() < 0.5 {
            continue;
        }
        let time_ns = time_ns + w.clock_offset_ns - sensor.clock_offset_ns;
        let has_settled = (time_ns - first) as f64 * 1e-9 >= SETTLING_SECONDS;
        let is_scored = movement.map_or(has_settled, |series| series.values.get(i).is_some_and(|value| *value > 0.5));
        reference.push(ReferencePoint { time_ns, earth_from_sensor: UnitQuaternion::from_quaternion(q), is_scored });
    }
    let mounting = sensor.mounting.iter().map(|mounting| format!(" {mounting}"));
    Some(OrientationTrial {
        set: std::iter::once(set.to_owned()).chain(mounting).collect(),
        name: format!("{name} {}", sensor.segment),
        time_ns: sensor.time_ns.clone(),
        acceleration: sensor.acceleration.clone(),
        angular_rate: sensor.angular_rate.clone(),
        reference,
    })
}
