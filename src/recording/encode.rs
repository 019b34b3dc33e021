//! Recording → bytes, in both formats; the same recording always gives the same bytes.

use super::{Header, InertialSensor, Recording, ReferenceSeries, Segment, SkeletonRecording};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{Cursor, Seek, Write};

/// Samples of a reference batch: a few seconds at usual rates.
const BATCH: usize = 512;

/// Samples of an inertial batch: a quarter of a second at 256 Hz.
const INERTIAL_BATCH: usize = 64;

/// JSON schema of an `/inertial/…` message, embedded in every file that has one.
pub const INERTIAL_SCHEMA: &str = include_str!("schema/inertial.json");

/// JSON schema of a `/skeleton` message, embedded in every file.
pub const SKELETON_SCHEMA: &str = include_str!("schema/skeleton.json");

/// JSON schema of a `/reference/…` message, embedded in every file.
pub const REFERENCE_SCHEMA: &str = include_str!("schema/reference.json");

/// Message encoding of `/depth` and `/depth/background`.
pub const DEPTH_ENCODING: &str = "surefoot.depth";

/// Why a recording has no encoding.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The recording breaks a rule of the format, for example has no skeleton or a negative time stamp.
    #[error("the recording cannot be written: {0}")]
    Unsuitable(&'static str),
    /// The container's writer failed.
    #[error("the container cannot be written: {0}")]
    Container(#[from] mcap::McapError),
    /// A compressor failed.
    #[error("an image cannot be written: {0}")]
    Compression(#[from] std::io::Error),
    /// A value has no JSON.
    #[error("a message cannot be written: {0}")]
    Json(#[from] serde_json::Error),
}

/// The recording as MCAP: zstd chunks with checksums, indexed.
///
/// # Errors
/// [`EncodeError`] for a recording without skeleton and inertial units, or with a frame at a negative time stamp, which
/// MCAP cannot hold.
pub fn mcap(recording: &Recording) -> Result<Vec<u8>, EncodeError> {
    check_content(recording)?;
    let first_ns = recording.skeleton.as_ref().and_then(|skeleton| skeleton.time_ns.first());
    if first_ns.is_some_and(|first| *first < 0) {
        return Err(EncodeError::Unsuitable("its first time stamp is negative"));
    }
    let mut writer = options(Some(Compression::Zstd)).create(Cursor::new(Vec::new()))?;
    write_header(&mut writer, &recording.header)?;

    if let Some(skeleton) = &recording.skeleton {
        write_skeleton(&mut writer, skeleton)?;
    }
    if let Some(inertial) = &recording.inertial {
        write_inertial(&mut writer, &inertial.sensors)?;
    }
    write_references(&mut writer, &recording.references)?;
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

/// The rules that every file follows.
pub(super) fn options(compression: Option<Compression>) -> WriteOptions {
    WriteOptions::new()
        .profile("surefoot")
        .library(concat!("surefoot ", env!("CARGO_PKG_VERSION")))
        .compression(compression)
        // Threads would change how the stream is cut, and with it the bytes.
        .compression_threads(0)
}

/// Writes the metadata record that makes a file a recording.
pub(super) fn write_header<W: Write + Seek>(writer: &mut mcap::Writer<W>, header: &Header) -> Result<(), EncodeError> {
    writer.write_metadata(&Metadata { name: "surefoot".into(), metadata: header_fields(header)? })?;
    Ok(())
}

/// Writes reference series, each on its own channel.
pub(super) fn write_references<W: Write + Seek>(
    writer: &mut mcap::Writer<W>,
    references: &[ReferenceSeries],
) -> Result<(), EncodeError> {
    let schema = match references.is_empty() {
        true => None,
        false => Some(writer.add_schema("surefoot.reference", "jsonschema", REFERENCE_SCHEMA.as_bytes())?),
    };
    for reference in references {
        let metadata = BTreeMap::from([
            ("source".to_owned(), reference.source.clone()),
            ("clock_offset_ns".to_owned(), reference.clock_offset_ns.to_string()),
        ]);
        let topic = format!("/reference/{}", reference.channel);
        let channel_id = writer.add_channel(schema.unwrap_or(0), &topic, "json", &metadata)?;
        for (i, (times, values)) in reference.time_ns.chunks(BATCH).zip(reference.values.chunks(BATCH)).enumerate() {
            // On the skeleton's clock, as far as MCAP's unsigned time can say it.
            let on_skeleton_clock = times[0].saturating_add(reference.clock_offset_ns).max(0);
            let log_time = on_skeleton_clock.unsigned_abs();
            let header = MessageHeader { channel_id, sequence: i as u32, log_time, publish_time: log_time };
            writer.write_to_known_channel(
                &header,
                &serde_json::to_vec(&Batch { time_ns: times, values: numbers(values) })?,
            )?;
        }
    }
    Ok(())
}

type File = mcap::Writer<Cursor<Vec<u8>>>;

fn check_content(recording: &Recording) -> Result<(), EncodeError> {
    let has_units = recording.inertial.as_ref().is_some_and(|inertial| !inertial.sensors.is_empty());
    match recording.skeleton.is_some() || has_units {
        true => Ok(()),
        false => Err(EncodeError::Unsuitable("it has neither a skeleton nor inertial units")),
    }?;
    let units = recording.inertial.iter().flat_map(|inertial| &inertial.sensors);
    let is_even = |unit: &InertialSensor| {
        let fields = unit.magnetic_field.as_ref().map_or(unit.len(), Vec::len);
        [unit.acceleration.len(), unit.angular_rate.len(), fields] == [unit.len(); 3]
    };
    match units.into_iter().all(is_even) {
        true => Ok(()),
        false => Err(EncodeError::Unsuitable("an inertial unit's lists differ in length")),
    }
}

fn write_skeleton(writer: &mut File, skeleton: &SkeletonRecording) -> Result<(), EncodeError> {
    let schema = writer.add_schema("surefoot.skeleton", "jsonschema", SKELETON_SCHEMA.as_bytes())?;
    let names: Vec<&str> = skeleton.joints.iter().map(|joint| joint.name()).collect();
    let metadata = BTreeMap::from([("joints".to_owned(), names.join(","))]);
    let channel_id = writer.add_channel(schema, "/skeleton", "json", &metadata)?;
    for t in 0..skeleton.len() {
        let log_time = skeleton.time_ns[t].unsigned_abs();
        let header = MessageHeader { channel_id, sequence: t as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &serde_json::to_vec(&Frame::of(skeleton, t, None))?)?;
    }
    Ok(())
}

fn write_inertial(writer: &mut File, sensors: &[InertialSensor]) -> Result<(), EncodeError> {
    let schema = writer.add_schema("surefoot.inertial", "jsonschema", INERTIAL_SCHEMA.as_bytes())?;
    for sensor in sensors {
        let entries = [
            ("device_model", sensor.device_model.clone()),
            ("mounting", sensor.mounting.clone()),
            ("nominal_rate_hz", sensor.nominal_rate_hz.map(|rate| rate.to_string())),
            ("clock_offset_ns", Some(sensor.clock_offset_ns.to_string())),
        ];
        let metadata = entries.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect();
        let channel_id = writer.add_channel(schema, &format!("/inertial/{}", sensor.segment), "json", &metadata)?;
        for (i, start) in (0..sensor.len()).step_by(INERTIAL_BATCH).enumerate() {
            let batch = UnitSamples::of(sensor, start..sensor.len().min(start + INERTIAL_BATCH));
            // On the recording's clock, as far as MCAP's unsigned time can say it.
            let log_time = sensor.time_ns[start].saturating_add(sensor.clock_offset_ns).max(0).unsigned_abs();
            let header = MessageHeader { channel_id, sequence: i as u32, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, &serde_json::to_vec(&batch)?)?;
        }
    }
    Ok(())
}

/// The recording as one JSON document.
///
/// # Errors
/// [`EncodeError`] for a recording without skeleton and inertial units.
pub fn json(recording: &Recording) -> Result<Vec<u8>, EncodeError> {
    check_content(recording)?;
    let skeleton = recording.skeleton.as_ref();
    let frames = |skeleton: &SkeletonRecording| -> Vec<Frame> {
        (0..skeleton.len()).map(|t| Frame::of(skeleton, t, Some(skeleton.time_ns[t]))).collect()
    };
    let sensors = recording.inertial.iter().flat_map(|inertial| &inertial.sensors);
    let document = Document {
        format: "surefoot",
        version: 1,
        coordinates: BTreeMap::from([("handedness", "right"), ("up", "+y"), ("length_unit", "m")]),
        header: &recording.header,
        joints: skeleton.map(|skeleton| &skeleton.joints[..]),
        frames: skeleton.map(frames),
        inertial: sensors.map(Unit::of).collect(),
        references: recording.references.iter().map(Reference::of).collect(),
    };
    Ok(serde_json::to_vec(&document)?)
}

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    version: u32,
    coordinates: BTreeMap<&'static str, &'static str>,
    header: &'a Header,
    #[serde(skip_serializing_if = "Option::is_none")]
    joints: Option<&'a [crate::body::Joint]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<Vec<Frame>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    inertial: Vec<Unit<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    references: Vec<Reference<'a>>,
}

#[derive(Serialize)]
struct Frame {
    #[serde(skip_serializing_if = "Option::is_none")]
    time_ns: Option<i64>,
    positions: Vec<Option<[f64; 3]>>,
    confidence: Vec<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    orientations: Option<Vec<Option<[f64; 4]>>>,
}

impl Frame {
    fn of(skeleton: &SkeletonRecording, t: usize, time_ns: Option<i64>) -> Self {
        let n = skeleton.joints.len();
        let wxyz = |q: &UnitQuaternion<f64>| [q.w, q.i, q.j, q.k];
        Self {
            time_ns,
            positions: skeleton.frame(t).iter().map(|p| (!p.x.is_nan()).then_some([p.x, p.y, p.z])).collect(),
            confidence: skeleton.frame_confidence(t).to_vec(),
            orientations: skeleton
                .orientations
                .get(t * n..(t + 1) * n)
                .map(|frame| frame.iter().map(|q| q.as_ref().map(wxyz)).collect()),
        }
    }
}

/// Samples of an inertial unit; a vector is written as a list of three.
#[derive(Serialize)]
struct UnitSamples<'a> {
    time_ns: &'a [i64],
    acceleration: Vec<[f64; 3]>,
    angular_rate: Vec<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    magnetic_field: Option<Vec<[f64; 3]>>,
}

impl<'a> UnitSamples<'a> {
    fn of(sensor: &'a InertialSensor, samples: std::ops::Range<usize>) -> Self {
        let lists = |vectors: &[Vector3<f64>]| vectors[samples.clone()].iter().map(|v| [v.x, v.y, v.z]).collect();
        Self {
            time_ns: &sensor.time_ns[samples.clone()],
            acceleration: lists(&sensor.acceleration),
            angular_rate: lists(&sensor.angular_rate),
            magnetic_field: sensor.magnetic_field.as_deref().map(lists),
        }
    }
}

/// Element of `inertial` in a JSON recording.
#[derive(Serialize)]
struct Unit<'a> {
    segment: Segment,
    #[serde(skip_serializing_if = "Option::is_none")]
    device_model: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mounting: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    nominal_rate_hz: Option<f64>,
    clock_offset_ns: i64,
    #[serde(flatten)]
    samples: UnitSamples<'a>,
}

impl<'a> Unit<'a> {
    fn of(sensor: &'a InertialSensor) -> Self {
        Self {
            segment: sensor.segment,
            device_model: sensor.device_model.as_deref(),
            mounting: sensor.mounting.as_deref(),
            nominal_rate_hz: sensor.nominal_rate_hz,
            clock_offset_ns: sensor.clock_offset_ns,
            samples: UnitSamples::of(sensor, 0..sensor.len()),
        }
    }
}

#[derive(Serialize)]
struct Batch<'a> {
    time_ns: &'a [i64],
    values: Vec<Option<f64>>,
}

#[derive(Serialize)]
struct Reference<'a> {
    channel: &'a str,
    source: &'a str,
    clock_offset_ns: i64,
    time_ns: &'a [i64],
    values: Vec<Option<f64>>,
}

impl<'a> Reference<'a> {
    fn of(series: &'a ReferenceSeries) -> Self {
        Self {
            channel: &series.channel,
            source: &series.source,
            clock_offset_ns: series.clock_offset_ns,
            time_ns: &series.time_ns,
            values: numbers(&series.values),
        }
    }
}

/// JSON has no NaN: a missing value is null.
fn numbers(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|value| value.is_finite().then_some(*value)).collect()
}

/// The `surefoot` metadata record.
fn header_fields(header: &Header) -> Result<BTreeMap<String, String>, EncodeError> {
    let start_time = header.start_time.map(|time| time.format(&time::format_description::well_known::Rfc3339));
    let start_time =
        start_time.transpose().map_err(|_| EncodeError::Unsuitable("its start time has no RFC 3339 form"))?;
    let segment_lengths = (!header.segment_lengths_m.is_empty()).then(|| json!(header.segment_lengths_m).to_string());
    let entries = [
        ("version", Some("1".to_owned())),
        ("handedness", Some("right".to_owned())),
        ("up", Some("+y".to_owned())),
        ("length_unit", Some("m".to_owned())),
        ("protocol", header.protocol.clone()),
        ("device_model", header.device.model.clone()),
        ("device_middleware", header.device.middleware.clone()),
        ("subject_height_m", header.subject_height_m.map(|stature| stature.to_string())),
        ("segment_lengths_m", segment_lengths),
        ("start_time", start_time),
    ];
    Ok(entries.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect())
}
