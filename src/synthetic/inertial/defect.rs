//! Mistakes that clients make with inertial units, for tests of what they are answered.

use crate::recording::{InertialRecording, InertialSensor, Segment};
use nalgebra::Vector3;

/// One mistake. Units that a recording does not have are left alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Defect {
    /// The names of two units were exchanged.
    Swapped(Segment, Segment),
    /// The z axis of a unit points the other way: a left-handed frame, determinant −1.
    MirroredAxes(Segment),
    /// The gyroscope's numbers are °/s.
    GyroscopeInDegrees(Segment),
    /// The accelerometer's numbers are g.
    AccelerometerInG(Segment),
    /// The accelerometer shows its first value for ever.
    ConstantAccelerometer(Segment),
    /// A unit is not there.
    Missing(Segment),
    /// A unit's clock is this many seconds ahead.
    ClockAhead(Segment, f64),
    /// A unit's samples are in the reverse order of time.
    ClockBackwards(Segment),
}

impl Defect {
    /// Makes the mistake.
    pub fn apply(self, inertial: &mut InertialRecording) {
        let units = &mut inertial.sensors;
        let mut change = |segment: Segment, change: &dyn Fn(&mut InertialSensor)| {
            units.iter_mut().filter(|unit| unit.segment == segment).for_each(change);
        };
        match self {
            Defect::Swapped(a, b) => {
                for unit in units {
                    unit.segment = match unit.segment {
                        name if name == a => b,
                        name if name == b => a,
                        name => name,
                    };
                }
            }
            Defect::MirroredAxes(segment) => change(segment, &|unit| {
                unit.acceleration.iter_mut().chain(&mut unit.angular_rate).for_each(|vector| vector.z = -vector.z);
            }),
            Defect::GyroscopeInDegrees(segment) => {
                change(segment, &|unit| scale(&mut unit.angular_rate, 1f64.to_degrees()));
            }
            Defect::AccelerometerInG(segment) => {
                change(segment, &|unit| scale(&mut unit.acceleration, 1.0 / super::STANDARD_GRAVITY));
            }
            Defect::ConstantAccelerometer(segment) => change(segment, &|unit| {
                let first = unit.acceleration.first().copied().unwrap_or_default();
                unit.acceleration.fill(first);
            }),
            Defect::Missing(segment) => units.retain(|unit| unit.segment != segment),
            Defect::ClockAhead(segment, seconds) => {
                let ahead_ns = (seconds * 1e9).round() as i64;
                change(segment, &|unit| unit.time_ns.iter_mut().for_each(|time| *time += ahead_ns));
            }
            Defect::ClockBackwards(segment) => change(segment, &|unit| unit.time_ns.reverse()),
        }
    }
}

fn scale(vectors: &mut [Vector3<f64>], factor: f64) {
    vectors.iter_mut().for_each(|vector| *vector *= factor);
}
