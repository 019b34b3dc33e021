//! Colour images of cameras at the sides: what belongs to which depth image, what is refused, what is told.

use super::*;
use crate::geometry::camera::Intrinsics;
use crate::geometry::colour_image::ColourImage;
use crate::recording::depth::{
    DepthCalibration, DepthCoding, DepthEncoder, DepthImage, DepthReader, DepthSummary, DepthUnit, DepthWarningKind,
    DepthWriter,
};
use crate::recording::side_camera::{SideCamera, SideImages, png_image};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::io::Cursor;

const CALIBRATION: &[u8] = br#"{"fx": 290, "fy": 290, "cx": 7.5, "cy": 5.5,
    "camera_from_sensor": {"rotation": [1, 0, 0, 0], "translation_m": [0.1, 0, 0]}}"#;
const TIMES_NS: [i64; 3] = [10_000_000, 43_000_000, 76_000_000];

fn depth_image() -> DepthImage {
    DepthImage { width: 16, height: 12, unit: DepthUnit::Millimetres, values: vec![900; 16 * 12] }
}

fn colour_image(k: u8) -> ColourImage {
    ColourImage { width: 16, height: 12, pixels: (0..16 * 12).map(|p| [k, p, 255 - p]).collect() }
}

fn colour_message(k: u8) -> Vec<u8> {
    png_image::encode_colour(&colour_image(k)).expect("an image")
}

fn labels(size: [usize; 2]) -> Vec<u8> {
    png_image::encode_labels(size, &vec![2; size[0] * size[1]]).expect("labels")
}

fn cameras() -> [SideCamera; 2] {
    [0.1, -0.1].map(|x| SideCamera {
        intrinsics: Intrinsics { fx: 290.0, fy: 291.0, cx: 7.5, cy: 5.5 },
        camera_from_sensor: Isometry3::from_parts(Translation3::new(x, 0.0, 0.01), UnitQuaternion::identity()),
        first: colour_image(if x > 0.0 { 0 } else { 100 }),
        labels: (0..16 * 12).map(|p| p % 7).collect(),
    })
}

fn images(k: u8) -> SideImages {
    [colour_image(k), colour_image(100 + k)]
}

/// Three depth images; beside the second one there is no colour.
fn recording() -> Vec<u8> {
    let calibration = DepthCalibration::of_intrinsics(&cameras()[0].intrinsics);
    let out = Cursor::new(Vec::new());
    let mut writer = DepthWriter::new(out, &Header::default(), &calibration, Some(&depth_image())).expect("a writer");
    writer.describe_sides(&cameras()).expect("cameras");
    for (k, time) in TIMES_NS.into_iter().enumerate() {
        if k != 1 {
            writer.write_sides(time - 5_000_000, &images(k as u8)).expect("colour");
        }
        writer.write(time, &depth_image()).expect("depth");
    }
    writer.finish(&[]).expect("the end").into_inner()
}

fn depth(time: u64) -> (&'static str, u64, Vec<u8>) {
    let mut encoder = DepthEncoder::new(DepthCoding::RunsZstd).expect("zstd");
    ("/depth", time, encoder.encode(&depth_image()).expect("an image").to_owned())
}

fn summary(bytes: &[u8]) -> DepthSummary {
    inspect(bytes, Format::Mcap, 1000).expect("sound").depth.expect("depth")
}

fn place_and_code(messages: &[(&str, u64, Vec<u8>)]) -> (String, &'static str) {
    let found = defect(&file(messages), Format::Mcap);
    (found.place.unwrap_or_default(), found.code)
}

#[test]
fn a_reader_gives_the_cameras_and_what_they_saw_at_the_time_of_each_depth_image() {
    let bytes = recording();
    let mut reader = DepthReader::open(&bytes[..], &Limits::default()).expect("sound");
    assert_eq!(reader.side_cameras(), Some(&cameras()));
    let mut image = depth_image();
    let mut seen = Vec::new();
    while reader.next_into(&mut image).expect("sound").is_some() {
        seen.push(reader.side_images().expect("sound"));
    }
    assert_eq!(seen, [Some(images(0)), None, Some(images(2))]);
}

#[test]
fn an_inspection_counts_the_images_and_those_that_belong_to_a_depth_image() {
    let summary = summary(&recording());
    let sides = summary.side_cameras.expect("cameras");
    assert_eq!((sides.n_images, sides.n_paired, sides.is_usable), ([2, 2], 2, true));
    assert!(summary.warnings.is_empty(), "{:?}", summary.warnings);
}

#[test]
fn cameras_that_cannot_be_used_are_accepted_and_told_with_what_is_missing() {
    let told = |messages: &[(&str, u64, Vec<u8>)]| {
        let summary = summary(&file(messages));
        assert!(summary.side_cameras.is_some_and(|sides| !sides.is_usable));
        let mut warnings = summary.warnings.into_iter();
        warnings.find(|warning| warning.kind == DepthWarningKind::SideCameras).expect("a warning").sentence
    };
    let left = [
        ("/side/left/calibration", 0, CALIBRATION.to_vec()),
        ("/side/left/labels", 0, labels([16, 12])),
        ("/side/left", 1, colour_message(0)),
    ];
    let sentence = told(&[&left[..], &[depth(2), depth(3)]].concat());
    assert!(sentence.contains("/side/right/labels") && !sentence.contains("/side/left"), "{sentence}");
    let right = [
        ("/side/right/calibration", 0, CALIBRATION.to_vec()),
        ("/side/right/labels", 0, labels([16, 12])),
        ("/side/right", 5, colour_message(0)),
    ];
    let late = [&left[..], &right[..2], &[depth(2)], &right[2..], &[depth(6)]].concat();
    assert!(told(&late).contains("after the first depth image"));
}

#[test]
fn what_is_wrong_with_a_colour_image_is_told_with_its_place() {
    let [first, last] = [depth(100), depth(200)];
    let around = |messages: &[(&'static str, u64, Vec<u8>)]| {
        place_and_code(&[std::slice::from_ref(&first), messages, std::slice::from_ref(&last)].concat())
    };
    let before = |messages: &[(&'static str, u64, Vec<u8>)]| {
        place_and_code(&[messages, &[first.clone(), last.clone()]].concat())
    };
    let place = |place: &str, code| (place.to_owned(), code);
    let colour = |time| ("/side/left", time, colour_message(0));
    assert_eq!(around(&[("/side/left", 1, b"GIF89a".to_vec())]), place("side.left", "invalid_image"));
    assert_eq!(around(&[colour(2), colour(2)]), place("side.left", "time_not_increasing"));
    let small = png_image::encode_colour(&ColourImage::black(2, 2)).expect("an image");
    assert_eq!(around(&[colour(2), ("/side/left", 3, small)]), place("side.left", "invalid_image"));
    let late = ("/side/right/labels", 0, labels([16, 12]));
    assert_eq!(around(std::slice::from_ref(&late)), place("side.right.labels", "misplaced_message"));
    assert_eq!(before(&[late.clone(), late.clone()]), place("side.right.labels", "misplaced_message"));
    let grey = ("/side/left/labels", 0, colour_message(0));
    assert_eq!(before(&[grey]), place("side.left.labels", "invalid_image"));
    let calibration = |text: &str| ("/side/left/calibration", 0, text.as_bytes().to_vec());
    let skewed = r#"{"fx": 290, "fy": 290, "cx": 7, "cy": 5,
        "camera_from_sensor": {"rotation": [1, 1, 0, 0], "translation_m": [0, 0, 0]}}"#;
    assert_eq!(before(&[calibration(skewed)]), place("side.left.calibration.camera_from_sensor", "invalid_value"));
    assert_eq!(before(&[calibration("{]")]).1, "invalid_json");
    let sizes_differ =
        [("/side/left/calibration", 0, CALIBRATION.to_vec()), ("/side/left/labels", 0, labels([12, 16])), colour(1)];
    assert_eq!(before(&sizes_differ), place("side.left.labels", "invalid_image"));
    assert_eq!(before(&[("/side/middle", 0, colour_message(0))]).1, "unknown_topic");
}

#[test]
fn colour_images_count_among_the_bytes_that_images_may_hold() {
    let limits = Limits { max_depth_bytes: 2 * 16 * 12 * 4, ..Limits::default() };
    let refused = DepthReader::open(&recording()[..], &limits).and_then(|reader| reader.finish()).unwrap_err();
    assert_eq!(refused.code, "decompression_limit");
}
