//! What a client uploads, decoded.
//!
//! Inside, every recording is in one convention whatever the client declared: metres, nanoseconds, the right-handed
//! `world` frame of the sensor with y up. `docs/recording-format.md` is the page for those who write recordings.

pub mod coordinates;
pub mod decode;
pub mod depth;
pub mod encode;
pub mod error;
pub mod import;
pub mod inertial;
pub mod inertial_quality;
pub mod side_camera;
pub mod skeleton;

pub use decode::{Format, Inspection, Inspector, Limits, decode};
pub use error::DecodeError;
pub use inertial::{InertialRecording, InertialSensor, Segment};
pub use skeleton::{ReferenceSeries, SkeletonRecording};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// One decoded upload.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// What was recorded, with what, of whom.
    pub header: Header,
    /// The camera's skeleton, when there is one.
    pub skeleton: Option<SkeletonRecording>,
    /// The inertial units, when there are any.
    pub inertial: Option<InertialRecording>,
    /// Gold-standard series that came with the recording, for evaluation.
    pub references: Vec<ReferenceSeries>,
}

/// Description of a recording, as the client gave it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Exercise or test that was done, for example `sit_front_knee`; free text of at most 64 characters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub protocol: Option<String>,
    /// The sensor.
    #[serde(default)]
    pub device: Device,
    /// The subject's stature in metres, 0.5 to 2.5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subject_height_m: Option<f64>,
    /// Lengths of the subject's limb segments as measured on the body, metres, 0.05 to 0.90; any of `left_upper_arm`,
    /// `left_forearm`, `left_thigh`, `left_shank` and the same with `right_`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub segment_lengths_m: BTreeMap<String, f64>,
    /// Wall-clock time of time stamp zero, RFC 3339.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "time::serde::rfc3339::option")]
    #[schema(value_type = Option<String>, format = DateTime)]
    pub start_time: Option<time::OffsetDateTime>,
}

/// The sensor that made a recording.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Model, for example `kinect-v2`. A description only: the noise model is chosen by the settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Body-tracking software and version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub middleware: Option<String>,
}
