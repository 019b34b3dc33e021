//! Tests of the decoders, by subject.

mod damage;
mod depth;
mod inertial;
mod json;
mod mcap_file;
mod round_trip;
mod side;

use super::*;
use crate::recording::encode;
use crate::recording::{InertialRecording, InertialSensor, ReferenceSeries, Segment, SkeletonRecording};
use mcap::records::MessageHeader;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::io::Cursor;

/// A small recording: three joints, five frames, one lost joint, one reference series.
fn example() -> Recording {
    let joints = vec![Joint::RightHip, Joint::RightKnee, Joint::RightAnkle];
    let n = 5;
    let positions = (0..n * 3).map(|i| Vector3::new(0.1, 1.0 - 0.4 * (i % 3) as f64, -2.0 + 0.01 * i as f64));
    let mut skeleton = SkeletonRecording {
        joints,
        time_ns: (0..n as i64).map(|t| t * 33_333_333).collect(),
        positions: positions.collect(),
        confidence: vec![1.0; n * 3],
        orientations: Vec::new(),
    };
    skeleton.positions[7] = Vector3::repeat(f64::NAN);
    skeleton.confidence[7] = 0.0;
    Recording {
        header: Header { protocol: Some("squat".into()), subject_height_m: Some(1.75), ..Header::default() },
        skeleton: Some(skeleton),
        inertial: None,
        references: vec![ReferenceSeries {
            channel: "right_knee_flexion_deg".into(),
            source: "goniometer".into(),
            clock_offset_ns: -5,
            time_ns: vec![0, 10, 25],
            values: vec![1.5, f64::NAN, -2.0],
        }],
    }
}

/// The same with two inertial units, one with a magnetometer and all that can be declared.
fn with_units() -> Recording {
    let mut thigh = InertialSensor::new(Segment::RightThigh);
    thigh.device_model = Some("x-imu".into());
    thigh.mounting = Some("strap, \"x\" down".into());
    thigh.nominal_rate_hz = Some(256.0);
    thigh.clock_offset_ns = -7;
    thigh.magnetic_field = Some(Vec::new());
    let mut chest = InertialSensor::new(Segment::Chest);
    for i in 0..3 {
        let wobble = 0.01 * f64::from(i);
        for unit in [&mut thigh, &mut chest] {
            unit.time_ns.push(i64::from(i) * 4_000_000 - 5);
            unit.acceleration.push(Vector3::new(wobble, 9.81, -wobble));
            unit.angular_rate.push(Vector3::new(0.1, -wobble, 0.0));
        }
        thigh.magnetic_field.as_mut().expect("a field").push(Vector3::new(20.0, -wobble, 43.0));
    }
    Recording { inertial: Some(InertialRecording { sensors: vec![thigh, chest] }), ..example() }
}

/// A file of messages `(topic, time, data)` of images and what belongs to them, as they are.
fn file(messages: &[(&str, u64, Vec<u8>)]) -> Vec<u8> {
    let mut writer = encode::options(None).create(Cursor::new(Vec::new())).expect("a writer");
    encode::write_header(&mut writer, &Header::default()).expect("a header");
    let mut channels = BTreeMap::new();
    for (topic, log_time, data) in messages {
        let channel_id = *channels.entry(*topic).or_insert_with(|| {
            let encoding = match *topic {
                topic if topic.ends_with("calibration") => "json",
                topic if topic.starts_with("/side/") => "png",
                _ => encode::DEPTH_ENCODING,
            };
            writer.add_channel(0, topic, encoding, &BTreeMap::new()).expect("a channel")
        });
        let header = MessageHeader { channel_id, sequence: 0, log_time: *log_time, publish_time: *log_time };
        writer.write_to_known_channel(&header, data).expect("a message");
    }
    writer.finish().expect("the end");
    writer.into_inner().into_inner()
}

/// Every number to the last bit, NaN equal to NaN.
fn bits(recording: &Recording) -> String {
    format!("{recording:?}")
}

/// The answer of an inspector that gets the bytes in pieces; it must be the answer of `decode`.
fn inspect(bytes: &[u8], format: Format, piece: usize) -> Result<Inspection, DecodeError> {
    let mut inspector = Inspector::new(format, &Limits::default());
    for part in bytes.chunks(piece) {
        if let Err(defect) = inspector.push(part) {
            assert_eq!(inspector.push(b"more"), Err(defect.clone()), "a defect stays");
            return Err(defect);
        }
    }
    inspector.finish()
}

/// The defect of both readers, which must agree.
fn defect(bytes: &[u8], format: Format) -> DecodeError {
    let defect = decode(bytes, format, &Limits::default()).map(|r| bits(&r)).expect_err("a defect");
    assert_eq!(inspect(bytes, format, 64 * 1024).expect_err("a defect"), defect);
    defect
}

#[test]
fn an_inspector_tells_what_the_recording_holds() {
    let recording = example();
    for (format, bytes) in [
        (Format::Mcap, encode::mcap(&recording).expect("mcap")),
        (Format::Json, encode::json(&recording).expect("json")),
    ] {
        assert_eq!(Format::sniff(&bytes[..8]), Some(format));
        for piece in [1, 7, 64 * 1024] {
            let inspection = inspect(&bytes, format, piece).expect("a sound recording");
            assert_eq!((inspection.n_frames, inspection.format), (5, format));
            assert!((inspection.duration_s - 0.133_333_332).abs() < 1e-12);
            assert_eq!(inspection.joints, [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle]);
            assert_eq!(inspection.reference_channels, ["right_knee_flexion_deg"]);
            assert_eq!(inspection.header, recording.header);
            assert!(!inspection.has_orientations && inspection.ignored_channels.is_empty());
        }
    }
}

#[test]
fn an_inspector_keeps_no_frame() {
    let mut decoder = Decoder::new(Format::Json, &Limits::default(), false);
    decoder.push(&encode::json(&example()).expect("json")).expect("sound");
    assert!(decoder.finish().expect("sound").recording.is_none());
}

#[test]
fn a_reader_that_fails_is_not_a_defect_of_the_recording() {
    struct Broken;
    impl std::io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("disk on fire"))
        }
    }
    let error = decode(Broken, Format::Mcap, &Limits::default()).map(|r| bits(&r)).expect_err("unreadable");
    assert_eq!(error.code, "unreadable");
}
