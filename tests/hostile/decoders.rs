//! Everything that reads bytes from outside, and sound bytes for it.

use crate::mutation::Shape;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::io::{Cursor, Write};
use surefoot::assessment::{LegPoseSettings, Settings};
use surefoot::body::Joint;
use surefoot::fall_risk::Answers;
use surefoot::geometry::colour_image::ColourImage;
use surefoot::progress::Monitor;
use surefoot::recording::decode::{DepthReader, Format, Inspector, Limits, decode};
use surefoot::recording::depth::{DepthImage, DepthUnit};
use surefoot::recording::import::{CameraFile, RawImages};
use surefoot::recording::side_camera::png_image;
use surefoot::recording::{Header, Recording, SkeletonRecording, encode};
use surefoot::report::TrainingPlan;
use surefoot::synthetic::walker::{Course, WalkerSettings, WalkerSimulation, cesium, trousers};

/// One reader of bytes.
pub struct Decoder {
    pub name: &'static str,
    /// It gets so many times fewer inputs than the quick ones.
    pub cost: u64,
    pub shape: Shape,
    /// Whether the bytes were accepted.
    pub read: fn(&[u8]) -> bool,
    /// Bytes that are accepted.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

pub const DECODERS: &[Decoder] = &[
    Decoder { name: "mcap", cost: 1, shape: Shape::Mcap, read: read_mcap, seeds: mcap_seeds },
    Decoder { name: "json", cost: 1, shape: Shape::Text, read: read_json, seeds: json_seeds },
    Decoder { name: "depth_mcap", cost: 100, shape: Shape::Mcap, read: read_depth, seeds: depth_seeds },
    Decoder { name: "side_images", cost: 1, shape: Shape::Bytes, read: read_side_image, seeds: side_image_seeds },
    Decoder { name: "raw_depth", cost: 1, shape: Shape::Bytes, read: read_raw_depth, seeds: raw_depth_seeds },
    Decoder { name: "camera_file", cost: 1, shape: Shape::Text, read: read_camera_file, seeds: camera_file_seeds },
    Decoder { name: "gltf", cost: 1, shape: Shape::Bytes, read: read_gltf, seeds: gltf_seeds },
    Decoder { name: "request_bodies", cost: 1, shape: Shape::Text, read: read_bodies, seeds: body_seeds },
];

/// Small limits: what is to be found is found in small inputs.
fn limits() -> Limits {
    Limits { max_frames: 10_000, ..Limits::default() }
}

/// In pieces, as they come over a line.
fn inspect(bytes: &[u8], format: Format) -> bool {
    let mut inspector = Inspector::new(format, &limits());
    bytes.chunks(1021).try_for_each(|piece| inspector.push(piece)).and_then(|()| inspector.finish()).is_ok()
}

fn read_mcap(bytes: &[u8]) -> bool {
    let is_sound = inspect(bytes, Format::Mcap);
    assert_eq!(decode(bytes, Format::Mcap, &limits()).is_ok(), is_sound, "inspection and decoding agree");
    is_sound
}

fn read_json(bytes: &[u8]) -> bool {
    let is_sound = inspect(bytes, Format::Json);
    assert_eq!(decode(bytes, Format::Json, &limits()).is_ok(), is_sound, "inspection and decoding agree");
    is_sound
}

fn skeleton(n: usize) -> Recording {
    let joints = [Joint::Head, Joint::Torso, Joint::LeftHip, Joint::RightHip, Joint::RightKnee];
    let place = |t: usize, j: usize| Vector3::new(0.1 * j as f64, 0.7 - 0.2 * j as f64, 2.0 + 0.01 * (t as f64).sin());
    Recording {
        header: Header { protocol: Some("standing".into()), ..Header::default() },
        skeleton: Some(SkeletonRecording {
            joints: joints.into(),
            time_ns: (0..n as i64).map(|t| t * 33_333_333).collect(),
            positions: (0..n).flat_map(|t| (0..joints.len()).map(move |j| place(t, j))).collect(),
            confidence: vec![1.0; n * joints.len()],
            orientations: Vec::new(),
        }),
        inertial: None,
        references: Vec::new(),
    }
}

fn mcap_seeds() -> Vec<Vec<u8>> {
    vec![encode::mcap(&skeleton(6)).unwrap(), encode::mcap(&skeleton(40)).unwrap()]
}

fn json_seeds() -> Vec<Vec<u8>> {
    vec![encode::json(&skeleton(4)).unwrap(), encode::json(&skeleton(12)).unwrap()]
}

fn walk(seconds: f64) -> WalkerSimulation {
    let settings = WalkerSettings { duration_s: seconds, rate_hz: 3.0, ..WalkerSettings::of_seed(Course::Straight, 3) };
    WalkerSimulation::new(&settings, trousers::trousers()).unwrap()
}

fn depth_seeds() -> Vec<Vec<u8>> {
    vec![walk(1.0).write(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner()]
}

fn read_depth(bytes: &[u8]) -> bool {
    if !inspect(bytes, Format::Mcap) {
        return false;
    }
    let Ok(mut reader) = DepthReader::open(bytes, &limits()) else { return false };
    let mut image = DepthImage::missing(1, 1, DepthUnit::Millimetres);
    loop {
        match reader.next_into(&mut image) {
            Ok(Some(_)) => {}
            Ok(None) => break,
            Err(_) => return false,
        }
    }
    // A few are assessed too: what is accepted must not make the tracker fail.
    if bytes.len().is_multiple_of(64)
        && let Ok(reader) = DepthReader::open(bytes, &limits())
    {
        let _ = surefoot::pipeline::leg_pose::assess(reader, &LegPoseSettings::default(), &Monitor::default());
    }
    true
}

/// A colour image, and labels.
fn side_image_seeds() -> Vec<Vec<u8>> {
    let image = ColourImage { width: 9, height: 7, pixels: (0..63).map(|k| [k, 3 * k, 255 - k]).collect() };
    let labels: Vec<u8> = (0..63).map(|k| k % 7).collect();
    vec![png_image::encode_colour(&image).unwrap(), png_image::encode_labels([9, 7], &labels).unwrap()]
}

fn read_side_image(bytes: &[u8]) -> bool {
    let is_colour = png_image::colour(bytes).is_ok_and(|image| image.pixels.len() == image.width * image.height);
    is_colour || png_image::labels(bytes).is_ok_and(|([width, height], labels)| labels.len() == width * height)
}

const CAMERA: &str =
    r#"{"width": 8, "height": 6, "unit": "raw11", "rate_hz": 30, "fx": 580, "fy": 580, "cx": 4, "cy": 3}"#;

fn camera_file_seeds() -> Vec<Vec<u8>> {
    vec![CAMERA.as_bytes().to_vec()]
}

fn read_camera_file(bytes: &[u8]) -> bool {
    serde_json::from_slice::<CameraFile>(bytes).is_ok_and(|camera| {
        camera.width.saturating_mul(camera.height) > 1_000_000 || RawImages::new(&[][..], &camera).is_ok()
    })
}

fn raw_depth_seeds() -> Vec<Vec<u8>> {
    let plain: Vec<u8> = (0..8 * 6 * 3u16).flat_map(|i| (600 + i).to_le_bytes()).collect();
    let mut xz = liblzma::write::XzEncoder::new(Vec::new(), 1);
    xz.write_all(&plain).unwrap();
    vec![zstd::encode_all(&plain[..], 1).unwrap(), xz.finish().unwrap(), plain]
}

fn read_raw_depth(bytes: &[u8]) -> bool {
    let camera: CameraFile = serde_json::from_str(CAMERA).unwrap();
    let Ok(mut images) = RawImages::new(bytes, &camera) else { return false };
    // A bomb ends here and not in memory: one image is held, whatever comes.
    for _ in 0..100_000 {
        match images.next_image() {
            Ok(Some(_)) => {}
            Ok(None) => return true,
            Err(_) => return false,
        }
    }
    true
}

fn gltf_seeds() -> Vec<Vec<u8>> {
    vec![small_glb()]
}

/// The smallest document that the parser takes; the figure in it is refused, with an error.
fn small_glb() -> Vec<u8> {
    let mut json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "skin": 0}, {}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "skins": [{"joints": [1], "inverseBindMatrices": 2}],
        "buffers": [{"byteLength": 112}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6},
                        {"buffer": 0, "byteOffset": 44, "byteLength": 64}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 1, "type": "MAT4"}]
    })
    .to_string()
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), &kind[..], bytes].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &[0; 112])].concat();
    [&b"glTF"[..], &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

fn read_gltf(bytes: &[u8]) -> bool {
    cesium::body_from_glb(bytes).is_ok() || bytes == small_glb()
}

fn body_seeds() -> Vec<Vec<u8>> {
    let bodies: [Value; 4] = [
        json!(Settings::default()),
        json!(Settings::LegPose(LegPoseSettings::default())),
        json!(Answers::default()),
        json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee", "repetitions": 10}]}),
    ];
    bodies.map(|body| serde_json::to_vec(&body).unwrap()).into()
}

fn read_bodies(bytes: &[u8]) -> bool {
    let settings = serde_json::from_slice::<Settings>(bytes).is_ok();
    let answers = serde_json::from_slice::<Answers>(bytes).is_ok();
    settings | answers | serde_json::from_slice::<TrainingPlan>(bytes).is_ok()
}
