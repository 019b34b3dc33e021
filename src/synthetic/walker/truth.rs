//! What is known of a simulated walk.

use super::bones::LegPoints;
use super::course::Footprint;
use nalgebra::{Isometry3, Point3, Vector3};

/// The truth of one frame; side 0 is the left.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameTruth {
    /// Time of the frame, nanoseconds.
    pub time_ns: i64,
    /// Points of both legs in `sensor`, metres.
    pub legs: [LegPoints; 2],
    /// Whether each foot is in contact with the floor, from heel strike to toe off.
    pub contacts: [bool; 2],
    /// Upward normal of the floor in `sensor`; a point of the floor has `normal · p = −height`.
    pub floor_normal: Vector3<f64>,
    /// Height of the camera above the floor, metres.
    pub camera_height_m: f64,
    /// Where the camera is.
    pub world_from_sensor: Isometry3<f64>,
}

/// The truth of one step: a foot comes down while the other one stands.
///
/// Lengths run towards the walker and widths to the subject's left, in the levelled axes of the sensor (`floor axes`) at
/// mid double support: the floor's normal is up, the direction of view along the floor is length.
#[derive(Debug, Clone, PartialEq)]
pub struct StepTruth {
    /// The foot that came down; 0 is the left.
    pub side: usize,
    /// Its heel strike, seconds.
    pub contact_s: f64,
    /// The toe off of the other foot that follows, seconds; none when both stay.
    pub release_s: Option<f64>,
    /// Middle of the double support, seconds.
    pub mid_double_support_s: f64,
    /// Definition `ankle_to_ankle`: from the standing ankle to the one that came down, at mid double support, metres.
    pub ankle_length_m: f64,
    /// The distance of the same ankles across, left minus right, metres.
    pub ankle_width_m: f64,
    /// Definition `footprint`: from the one footprint to the other when each foot is flat, metres.
    pub footprint_length_m: f64,
    /// The distance of the same footprints across, left minus right, metres.
    pub footprint_width_m: f64,
    /// Place in its bout of walking, from 0, and the number of steps that follow in it.
    pub place_in_bout: usize,
    /// See `place_in_bout`.
    pub steps_to_come: usize,
    /// Whether the two footprints point into different directions.
    pub is_turning: bool,
    /// The footprint of the foot that came down, in `world`.
    pub footprint: Footprint,
    /// The footprint of the foot that stood, in `world`.
    pub standing: Footprint,
}

/// The axes of the floor for a camera: `floor_from_sensor` turns a vector of `sensor` into length (towards the camera),
/// up, and width (to the subject's left).
pub(super) fn length_and_width(world_from_sensor: &Isometry3<f64>, from: &Point3<f64>, to: &Point3<f64>) -> [f64; 2] {
    let view = world_from_sensor * Vector3::z();
    let length = -Vector3::new(view.x, 0.0, view.z).normalize();
    let left = Vector3::y().cross(&length);
    let step = to - from;
    [step.dot(&length), step.dot(&left)]
}
