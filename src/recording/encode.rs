//! Recording → bytes, in both formats; the same recording always gives the same bytes.

use super::{Recording, ReferenceSeries, SkeletonRecording};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions};
use nalgebra::UnitQuaternion;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Cursor;

/// Samples of a reference batch: a few seconds at usual rates.
const BATCH: usize = 512;

/// JSON schema of a `/skeleton` message, embedded in every file.
pub const SKELETON_SCHEMA: &str = include_str!("schema/skeleton.json");

/// JSON schema of a `/reference/…` message, embedded in every file.
pub const REFERENCE_SCHEMA: &str = include_str!("schema/reference.json");

/// Why a recording has no encoding.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The recording breaks a rule of the format, for example has no skeleton or a negative time stamp.
    #[error("the recording cannot be written: {0}")]
    Unsuitable(&'static str),
    /// The container's writer failed.
    #[error("the container cannot be written: {0}")]
    Container(#[from] mcap::McapError),
    /// A value has no JSON.
    #[error("a message cannot be written: {0}")]
    Json(#[from] serde_json::Error),
}

/// The recording as MCAP: zstd chunks with checksums, indexed.
///
/// # Errors
/// [`EncodeError`] for a recording without skeleton or with a negative time stamp, which MCAP cannot hold.
pub fn mcap(recording: &Recording) -> Result<Vec<u8>, EncodeError> {
    let skeleton = recording.skeleton.as_ref().ok_or(EncodeError::Unsuitable("it has no skeleton"))?;
    if skeleton.time_ns.first().is_some_and(|first| *first < 0) {
        return Err(EncodeError::Unsuitable("its first time stamp is negative"));
    }
    let mut writer = WriteOptions::new()
        .profile("surefoot")
        .library(concat!("surefoot ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        // Threads would change how the stream is cut, and with it the bytes.
        .compression_threads(0)
        .create(Cursor::new(Vec::new()))?;
    writer.write_metadata(&Metadata { name: "surefoot".into(), metadata: header(recording)? })?;

    let schema = writer.add_schema("surefoot.skeleton", "jsonschema", SKELETON_SCHEMA.as_bytes())?;
    let names: Vec<&str> = skeleton.joints.iter().map(|joint| joint.name()).collect();
    let metadata = BTreeMap::from([("joints".to_owned(), names.join(","))]);
    let channel_id = writer.add_channel(schema, "/skeleton", "json", &metadata)?;
    for t in 0..skeleton.len() {
        let log_time = skeleton.time_ns[t].unsigned_abs();
        let header = MessageHeader { channel_id, sequence: t as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &serde_json::to_vec(&Frame::of(skeleton, t, None))?)?;
    }

    let schema = match recording.references.is_empty() {
        true => None,
        false => Some(writer.add_schema("surefoot.reference", "jsonschema", REFERENCE_SCHEMA.as_bytes())?),
    };
    for reference in &recording.references {
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
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

/// The recording as one JSON document.
///
/// # Errors
/// [`EncodeError`] for a recording without skeleton.
pub fn json(recording: &Recording) -> Result<Vec<u8>, EncodeError> {
    let skeleton = recording.skeleton.as_ref().ok_or(EncodeError::Unsuitable("it has no skeleton"))?;
    let document = Document {
        format: "surefoot",
        version: 1,
        coordinates: BTreeMap::from([("handedness", "right"), ("up", "+y"), ("length_unit", "m")]),
        header: &recording.header,
        joints: &skeleton.joints,
        frames: (0..skeleton.len()).map(|t| Frame::of(skeleton, t, Some(skeleton.time_ns[t]))).collect(),
        references: recording.references.iter().map(Reference::of).collect(),
    };
    Ok(serde_json::to_vec(&document)?)
}

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    version: u32,
    coordinates: BTreeMap<&'static str, &'static str>,
    header: &'a super::Header,
    joints: &'a [crate::body::Joint],
    frames: Vec<Frame>,
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
fn header(recording: &Recording) -> Result<BTreeMap<String, String>, EncodeError> {
    let header = &recording.header;
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
