//! Depth images: what is read, what is refused, and how much is held.

use super::*;
use crate::recording::depth::{
    DepthCalibration, DepthCoding, DepthEncoder, DepthImage, DepthReader, DepthUnit, DepthWarningKind, DepthWriter,
};
use crate::recording::encode::{DEPTH_ENCODING, options, write_header};
use mcap::records::MessageHeader;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::{Cursor, Read};

const CALIBRATION: &[u8] = br#"{"fx": 580, "fy": 580, "cx": 31.5, "cy": 23.5, "camera_height_m": 0.5}"#;

/// A slanted surface that comes nearer, with a corner missing.
fn image(k: u16) -> DepthImage {
    let values = (0..64 * 48).map(|p| if p % 64 < 5 && p < 640 { 2047 } else { 800 - k + p / 64 % 3 });
    DepthImage { width: 64, height: 48, unit: DepthUnit::Raw11, values: values.collect() }
}

fn message(image: &DepthImage, coding: DepthCoding) -> Vec<u8> {
    DepthEncoder::new(coding).expect("zstd").encode(image).expect("an image").to_owned()
}

/// What comes before the images, and a number of them.
fn recording(n: u16) -> Vec<u8> {
    let calibration: DepthCalibration = serde_json::from_slice(CALIBRATION).expect("a calibration");
    let header = Header { protocol: Some("walk".into()), ..Header::default() };
    let mut writer =
        DepthWriter::new(Cursor::new(Vec::new()), &header, &calibration, Some(&image(0))).expect("a writer");
    for k in 0..n {
        writer.write(i64::from(k) * 33_333_333, &image(k)).expect("an image");
    }
    writer.finish(&example().references).expect("the end").into_inner()
}

/// Two good images, between which `messages` come.
fn around(messages: &[(&str, u64, Vec<u8>)]) -> Vec<u8> {
    let depth = |time| ("/depth", time, message(&image(1), DepthCoding::RunsZstd));
    file(&[&[depth(10)], messages, &[depth(20)]].concat())
}

fn place_and_code(bytes: &[u8]) -> (String, &'static str) {
    let found = defect(bytes, Format::Mcap);
    (found.place.unwrap_or_default(), found.code)
}

#[test]
fn a_recording_of_depth_alone_is_described_without_its_images() {
    let bytes = recording(31);
    for piece in [1, 1000, 1 << 20] {
        let inspection = inspect(&bytes, Format::Mcap, piece).expect("sound");
        let depth = inspection.depth.expect("depth");
        assert_eq!((depth.n_frames, depth.width, depth.height, depth.unit), (31, 64, 48, DepthUnit::Raw11));
        assert!((inspection.duration_s - 0.999_999_99).abs() < 1e-6 && (depth.rate_hz - 30.0).abs() < 1e-3);
        assert!((depth.missing_share - 50.0 / 3072.0).abs() < 1e-9 && depth.n_empty_frames == 0);
        assert!(depth.has_calibration && depth.has_background && depth.warnings.is_empty());
        assert_eq!((inspection.n_frames, inspection.ignored_channels.len()), (0, 0));
    }
    let recording = decode(&bytes[..], Format::Mcap, &Limits::default()).expect("sound");
    assert!(recording.skeleton.is_none() && recording.references.len() == 1);
}

#[test]
fn a_reader_gives_every_image_with_its_time_and_what_came_before_them() {
    let bytes = recording(25);
    let mut reader = DepthReader::open(&bytes[..], &Limits::default()).expect("sound");
    assert_eq!(reader.calibration().expect("a calibration").camera_height_m, Some(0.5));
    assert_eq!(reader.background(), Some(&image(0)));
    assert_eq!(reader.header().protocol.as_deref(), Some("walk"));
    for k in 0..25 {
        let (time, read) = reader.next().expect("an image").expect("sound");
        assert_eq!((time, read), (i64::from(k) * 33_333_333, image(k)));
    }
    assert!(reader.next().is_none());
    assert_eq!(bits(&Recording { skeleton: None, ..example() }), {
        let mut rest = reader.finish().expect("sound");
        rest.header = example().header;
        bits(&rest)
    });
}

#[test]
fn a_reader_holds_no_more_than_a_chunk() {
    /// Counts what was read.
    struct Counted<'a>(&'a [u8], std::rc::Rc<std::cell::Cell<usize>>);
    impl Read for Counted<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let n = self.0.read(buffer)?;
            self.1.set(self.1.get() + n);
            Ok(n)
        }
    }
    // Uncompressible, so that each image fills a chunk of its own.
    let noisy = |k: u64| DepthImage {
        width: 640,
        height: 480,
        unit: DepthUnit::Raw11,
        values: (0..640 * 480).map(|p: u64| ((p * 0x9e37_79b9 + k) >> 7) as u16 % 2047).collect(),
    };
    let mut writer = DepthWriter::new(
        Cursor::new(Vec::new()),
        &Header::default(),
        &serde_json::from_slice(CALIBRATION).expect("a calibration"),
        None,
    )
    .expect("a writer");
    for k in 0..40u64 {
        writer.write(k as i64, &noisy(k)).expect("an image");
    }
    let bytes = writer.finish(&[]).expect("the end").into_inner();
    let n_read = std::rc::Rc::new(std::cell::Cell::new(0));
    let mut reader = DepthReader::open(Counted(&bytes, n_read.clone()), &Limits::default()).expect("sound");
    let mut read = noisy(0);
    for k in 0..40u64 {
        assert_eq!(reader.next_into(&mut read), Ok(Some(k as i64)));
        assert_eq!(read, noisy(k));
        let share = (k + 1) as f64 / 40.0;
        assert!((n_read.get() as f64) < share * bytes.len() as f64 + 2.5e6, "image {k}: {} bytes", n_read.get());
    }
}

#[test]
fn a_recording_without_calibration_or_background_is_accepted_and_says_so() {
    let depth = inspect(&around(&[]), Format::Mcap, 100).expect("sound").depth.expect("depth");
    let kinds: Vec<DepthWarningKind> = depth.warnings.iter().map(|warning| warning.kind).collect();
    assert_eq!(kinds, [DepthWarningKind::NoCalibration, DepthWarningKind::NoBackground]);
    let skeletons = encode::mcap(&example()).expect("mcap");
    let none = DepthReader::open(&skeletons[..], &Limits::default());
    assert_eq!(none.err().expect("no depth").code, "empty_recording");
}

#[test]
fn what_belongs_before_the_images_is_refused_after_them_and_twice() {
    let calibration = |time| ("/depth/calibration", time, CALIBRATION.to_vec());
    let background = ("/depth/background", 0, message(&image(0), DepthCoding::Zstd));
    assert_eq!(place_and_code(&around(&[calibration(0)])), ("depth.calibration".into(), "misplaced_message"));
    assert_eq!(place_and_code(&around(&[background])), ("depth.background".into(), "misplaced_message"));
    let twice = file(&[calibration(0), calibration(0)]);
    assert_eq!(place_and_code(&twice), ("depth.calibration".into(), "misplaced_message"));
}

#[test]
fn images_out_of_order_of_another_size_or_unit_and_a_single_one_are_refused() {
    let good = message(&image(1), DepthCoding::None);
    let at = |time, data: &Vec<u8>| around(&[("/depth", time, data.clone())]);
    assert_eq!(place_and_code(&at(10, &good)), ("depth[1].time_ns".into(), "time_not_increasing"));
    assert_eq!(place_and_code(&at(5, &good)), ("depth[1].time_ns".into(), "time_not_increasing"));
    assert_eq!(place_and_code(&at(u64::MAX, &good)), ("depth[1].time_ns".into(), "invalid_value"));
    assert_eq!(place_and_code(&at(1 << 60, &good)), ("depth[1].time_ns".into(), "too_long"));
    let mut turned = image(1);
    (turned.width, turned.height) = (48, 64);
    assert_eq!(place_and_code(&at(15, &message(&turned, DepthCoding::None))), ("depth[1]".into(), "depth_size"));
    let mut millimetres = image(1);
    millimetres.unit = DepthUnit::Millimetres;
    assert_eq!(place_and_code(&at(15, &message(&millimetres, DepthCoding::None))), ("depth[1]".into(), "depth_size"));
    assert_eq!(defect(&file(&[("/depth", 0, good)]), Format::Mcap).code, "too_few_frames");
}

#[test]
fn images_that_are_none_are_refused_by_both_readers_at_their_place() {
    let good = message(&image(1), DepthCoding::RunsZstd);
    let mut garbage = message(&image(1), DepthCoding::None);
    garbage[8..].iter_mut().enumerate().for_each(|(k, byte)| *byte = (k * 37) as u8);
    let cases = [
        (good[..good.len() - 5].to_vec(), "invalid_depth"),
        (good[..8].to_vec(), "invalid_depth"),
        (Vec::new(), "invalid_depth"),
        (garbage, "invalid_value"),
    ];
    for (data, code) in cases {
        let bytes = around(&[("/depth", 15, data)]);
        assert_eq!(place_and_code(&bytes), ("depth[1]".into(), code));
        let found: Vec<_> = DepthReader::open(&bytes[..], &Limits::default()).expect("sound so far").collect();
        let last = found.last().expect("an answer").as_ref().expect_err("a defect");
        assert_eq!((last.place.as_deref(), last.code), (Some("depth[1]"), code));
        assert_eq!(found.len(), 2);
    }
}

#[test]
fn a_wrong_calibration_names_the_field() {
    let refused = |text: &str| place_and_code(&file(&[("/depth/calibration", 0, text.into())]));
    let wrong = r#"{"fx": 0.5, "fy": 580, "cx": 1, "cy": 1}"#;
    assert_eq!(refused(wrong), ("depth.calibration.fx".into(), "invalid_value"));
    assert_eq!(refused(r#"{"fx": 580}"#).1, "missing_field");
    assert_eq!(refused(r#"{"fx": "wide"}"#).1, "invalid_value");
}

#[test]
fn other_encodings_and_a_second_channel_are_refused() {
    let bytes = |topics: &[(&str, &str)]| {
        let mut writer = options(None).create(Cursor::new(Vec::new())).expect("a writer");
        write_header(&mut writer, &Header::default()).expect("a header");
        for (k, (topic, encoding)) in topics.iter().enumerate() {
            let metadata = BTreeMap::from([("k".to_owned(), k.to_string())]);
            let channel_id = writer.add_channel(0, topic, encoding, &metadata).expect("a channel");
            let header = MessageHeader { channel_id, sequence: 0, log_time: k as u64, publish_time: 0 };
            writer.write_to_known_channel(&header, &message(&image(1), DepthCoding::None)).expect("a message");
        }
        writer.finish().expect("the end");
        writer.into_inner().into_inner()
    };
    assert_eq!(defect(&bytes(&[("/depth", "png")]), Format::Mcap).code, "unsupported_encoding");
    let twice = bytes(&[("/depth", DEPTH_ENCODING), ("/depth", DEPTH_ENCODING)]);
    assert_eq!(defect(&twice, Format::Mcap).code, "duplicate_channel");
}

#[test]
fn images_that_grow_beyond_the_limits_are_refused() {
    let bytes = recording(20);
    let code = |limits: &Limits| {
        let mut inspector = Inspector::new(Format::Mcap, limits);
        let refused = inspector.push(&bytes).expect_err("too much").code;
        let read = DepthReader::open(&bytes[..], limits).and_then(|reader| reader.collect::<Result<Vec<_>, _>>());
        assert_eq!(read.expect_err("too much").code, refused);
        refused
    };
    let one_less = 20 * 2 * 64 * 48 - 1;
    assert_eq!(code(&Limits { max_depth_bytes: one_less, ..Limits::default() }), "decompression_limit");
    assert_eq!(code(&Limits { max_frames: 19, ..Limits::default() }), "too_many_frames");
}

#[test]
fn a_depth_recording_cut_anywhere_is_refused() {
    let bytes = recording(3);
    for length in 1..bytes.len() {
        assert_eq!(defect(&bytes[..length], Format::Mcap).code, "truncated", "cut to {length}");
        let read = DepthReader::open(&bytes[..length], &Limits::default());
        let last = read.map_or_else(Some, |reader| reader.last().and_then(Result::err));
        assert_eq!(last.expect("a defect").code, "truncated", "cut to {length}");
    }
}

proptest! {
    #[test]
    fn any_bytes_as_messages_are_refused_or_read_without_panic(
        messages in prop::collection::vec(
            (prop::sample::select(vec!["/depth", "/depth/background", "/depth/calibration"]), any::<u64>(),
                prop::collection::vec(any::<u8>(), 0..60)), 0..5),
        unit in 0u8..2, coding in 0u8..3,
    ) {
        let with_header = |(topic, time, mut data): (&'static str, u64, Vec<u8>)| {
            data.splice(0..0, [4, 0, 2, 0, unit, coding, 0, 0]);
            (topic, time, data)
        };
        let messages: Vec<_> = messages.into_iter().map(with_header).collect();
        let bytes = file(&messages);
        let _ = inspect(&bytes, Format::Mcap, 300);
        let _ = DepthReader::open(&bytes[..], &Limits::default()).map(|reader| reader.count());
    }

    #[test]
    fn a_depth_recording_with_a_byte_changed_is_refused_or_read_without_panic(
        at in any::<prop::sample::Index>(), byte in any::<u8>()
    ) {
        let mut damaged = recording(3);
        let at = at.index(damaged.len());
        damaged[at] = byte;
        let _ = inspect(&damaged, Format::Mcap, 64);
        let _ = DepthReader::open(&damaged[..], &Limits::default()).map(|reader| reader.count());
    }
}
