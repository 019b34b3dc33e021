//! Inertial units in memory: what each measured, and what it sat on.

use crate::body::{Bone, Limb};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;

macro_rules! segments {
    ($($(#[$doc:meta])* $variant:ident = $name:literal),+ $(,)?) => {
        /// What an inertial unit is fixed to: a segment of the body, or an object that is none.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum Segment { $($(#[$doc])* $variant),+ }

        impl Segment {
            /// Every segment, in the order of declaration.
            pub const ALL: &'static [Segment] = &[$(Segment::$variant),+];

            /// The segment's name in recordings, for example `left_thigh`.
            pub fn name(self) -> &'static str {
                match self { $(Segment::$variant => $name),+ }
            }
        }
    };
}

segments! {
    /// Pelvis.
    Pelvis = "pelvis",
    /// Trunk above the pelvis: sternum or upper back.
    Chest = "chest",
    /// Left upper arm.
    LeftUpperArm = "left_upper_arm",
    /// Left forearm.
    LeftForearm = "left_forearm",
    /// Left thigh.
    LeftThigh = "left_thigh",
    /// Left shank.
    LeftShank = "left_shank",
    /// Left foot.
    LeftFoot = "left_foot",
    /// Right upper arm.
    RightUpperArm = "right_upper_arm",
    /// Right forearm.
    RightForearm = "right_forearm",
    /// Right thigh.
    RightThigh = "right_thigh",
    /// Right shank.
    RightShank = "right_shank",
    /// Right foot.
    RightFoot = "right_foot",
    /// First rigid object that is no part of a person: a rod, a plank, a link of a test chain.
    Object1 = "object1",
    /// Second object.
    Object2 = "object2",
    /// Third object.
    Object3 = "object3",
    /// Fourth object.
    Object4 = "object4",
    /// Fifth object.
    Object5 = "object5",
}

impl Segment {
    /// The bone of the linked skeleton that the segment is; none for pelvis, feet and objects, which it does not have.
    pub fn bone(self) -> Option<Bone> {
        Some(match self {
            Segment::Chest => Bone::Trunk,
            Segment::LeftUpperArm => Bone::Proximal(Limb::LeftArm),
            Segment::LeftForearm => Bone::Distal(Limb::LeftArm),
            Segment::RightUpperArm => Bone::Proximal(Limb::RightArm),
            Segment::RightForearm => Bone::Distal(Limb::RightArm),
            Segment::LeftThigh => Bone::Proximal(Limb::LeftLeg),
            Segment::LeftShank => Bone::Distal(Limb::LeftLeg),
            Segment::RightThigh => Bone::Proximal(Limb::RightLeg),
            Segment::RightShank => Bone::Distal(Limb::RightLeg),
            _ => return None,
        })
    }

    /// The segment of a bone.
    pub fn of_bone(bone: Bone) -> Segment {
        Segment::ALL.iter().copied().find(|segment| segment.bone() == Some(bone)).unwrap_or(Segment::Chest)
    }
}

/// Name of the mounting of \[fusion\] in [`InertialSensor::mounting`]: the unit sits as [`Bone::scheme_from_imu`] says,
/// within what a hand and an eye can do.
pub const MOUNTING_SCHEME: &str = "scheme";

/// `world_from_imu` of every unit while the units lie on the plank at the start (\[fusion\], initialization).
///
/// The plank lies level before the camera, each unit with its top (z) up and its x to the right as the camera sees it; y
/// then points towards the camera. `world` has x to the right, y up and z away from the camera.
pub fn world_from_plank() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[Vector3::x(), -Vector3::z(), Vector3::y()]))
}

/// A name that is not a segment's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a segment name")]
pub struct UnknownSegment(pub String);

impl FromStr for Segment {
    type Err = UnknownSegment;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let found = Segment::ALL.iter().find(|segment| segment.name() == name);
        found.copied().ok_or_else(|| UnknownSegment(name.to_owned()))
    }
}

impl fmt::Display for Segment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The inertial units of a recording, each on a segment of its own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InertialRecording {
    /// One entry for each unit, in the order in which they were declared.
    pub sensors: Vec<InertialSensor>,
}

impl InertialRecording {
    /// The unit on a segment, when there is one.
    pub fn sensor(&self, segment: Segment) -> Option<&InertialSensor> {
        self.sensors.iter().find(|sensor| sensor.segment == segment)
    }
}

/// What one inertial unit measured, in its own right-handed `imu` frame.
///
/// Every list has one entry for each time stamp, and every number is finite. Time stamps are strictly increasing; a
/// sample that was lost has no entry, so it shows as a gap in time.
#[derive(Debug, Clone, PartialEq)]
pub struct InertialSensor {
    /// What the unit is fixed to.
    pub segment: Segment,
    /// Model of the unit, for example `mtw-awinda`.
    pub device_model: Option<String>,
    /// How the unit sits on its segment, in the client's words.
    pub mounting: Option<String>,
    /// Sample rate that the client declared, per second; the time stamps say the true one.
    pub nominal_rate_hz: Option<f64>,
    /// To be added to `time_ns` to reach the recording's clock, nanoseconds.
    pub clock_offset_ns: i64,
    /// Time of each sample on the unit's own clock, nanoseconds.
    pub time_ns: Vec<i64>,
    /// Specific force, m/s²: a unit at rest with z up reads +9.81 in z.
    pub acceleration: Vec<Vector3<f64>>,
    /// Angular rate, rad/s, positive by the right-hand rule.
    pub angular_rate: Vec<Vector3<f64>>,
    /// Magnetic flux density, microtesla, where the unit measured it.
    pub magnetic_field: Option<Vec<Vector3<f64>>>,
}

impl InertialSensor {
    /// A unit without samples.
    pub fn new(segment: Segment) -> Self {
        Self {
            segment,
            device_model: None,
            mounting: None,
            nominal_rate_hz: None,
            clock_offset_ns: 0,
            time_ns: Vec::new(),
            acceleration: Vec::new(),
            angular_rate: Vec::new(),
            magnetic_field: None,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_ns.len()
    }

    /// True without any sample.
    pub fn is_empty(&self) -> bool {
        self.time_ns.is_empty()
    }

    /// Time between the first and the last sample, seconds.
    pub fn duration_s(&self) -> f64 {
        match (self.time_ns.first(), self.time_ns.last()) {
            (Some(first), Some(last)) => (last - first) as f64 * 1e-9,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_segment_name_parses_back_and_is_the_name_in_json() {
        for &segment in Segment::ALL {
            assert_eq!(segment.name().parse(), Ok(segment));
            assert_eq!(serde_json::json!(segment), serde_json::json!(segment.name()));
        }
    }

    #[test]
    fn on_the_plank_z_is_up_x_to_the_right_and_y_towards_the_camera() {
        let turn = world_from_plank();
        assert_eq!(
            [turn * Vector3::x(), turn * Vector3::y(), turn * Vector3::z()],
            [Vector3::x(), -Vector3::z(), Vector3::y()]
        );
        assert_eq!(turn.matrix().determinant(), 1.0);
    }

    #[test]
    fn every_bone_has_a_segment() {
        for bone in Bone::ALL {
            assert_eq!(Segment::of_bone(bone).bone(), Some(bone));
        }
    }

    #[test]
    fn an_unknown_segment_is_refused_with_the_name() {
        assert_eq!("left_tail".parse::<Segment>(), Err(UnknownSegment("left_tail".into())));
    }

    #[test]
    fn a_unit_is_found_by_its_segment() {
        let units = [Segment::LeftThigh, Segment::Chest].map(InertialSensor::new).to_vec();
        let recording = InertialRecording { sensors: units };
        assert_eq!(recording.sensor(Segment::Chest), Some(&InertialSensor::new(Segment::Chest)));
        assert_eq!(recording.sensor(Segment::RightThigh), None);
    }

    #[test]
    fn the_duration_runs_from_the_first_to_the_last_sample() {
        let mut sensor = InertialSensor::new(Segment::Pelvis);
        assert!(sensor.is_empty() && sensor.duration_s() == 0.0);
        sensor.time_ns = vec![-500_000_000, 0, 1_000_000_000];
        assert_eq!((sensor.len(), sensor.duration_s()), (3, 1.5));
    }
}
