use super::*;
use nalgebra::{Quaternion, UnitQuaternion};
use proptest::prelude::*;

type JointSample = (Option<[f64; 3]>, f32, Option<[f64; 4]>);

fn joint_sample() -> impl Strategy<Value = JointSample> {
    (
        prop::option::weighted(0.9, prop::array::uniform3(-100.0..=100.0f64)),
        1e-6..=1.0f32,
        prop::option::of(
            prop::array::uniform4(-1.0..1.0f64)
                .prop_filter("not zero", |q| q.iter().map(|v| v * v).sum::<f64>() > 0.01),
        ),
    )
}

fn reference() -> impl Strategy<Value = ReferenceSeries> {
    let samples = prop::collection::vec((1..1_000_000_000i64, prop::option::of(-1e6..1e6f64)), 0..1300);
    (-1_000_000_000..1_000_000_000i64, samples).prop_map(|(clock_offset_ns, samples)| {
        let mut time = -7;
        let (time_ns, values) = samples
            .into_iter()
            .map(|(step, value)| {
                time += step;
                (time, value.unwrap_or(f64::NAN))
            })
            .unzip();
        let channel = "left_knee_flexion_deg".to_owned();
        ReferenceSeries { channel, source: "Vicon, \"plug-in\"".into(), clock_offset_ns, time_ns, values }
    })
}

fn header() -> impl Strategy<Value = Header> {
    let segments = prop::collection::btree_map("(left|right)_(upper_arm|forearm|thigh|shank)", 0.05..0.9f64, 0..4);
    let protocol = prop::option::of("[a-zäö \"=,]{0,64}");
    (protocol, prop::option::of(0.5..=2.5f64), segments, prop::option::of(0..4_000_000_000i64)).prop_map(
        |(protocol, subject_height_m, segment_lengths_m, start)| Header {
            protocol,
            device: Device { model: Some("kinect-v2".into()), middleware: None },
            subject_height_m,
            segment_lengths_m,
            start_time: start.map(|s| time::OffsetDateTime::from_unix_timestamp(s).expect("in range")),
        },
    )
}

use crate::recording::Device;

fn unit(segment: Segment) -> impl Strategy<Value = InertialSensor> {
    let vector = |limit: f64| prop::array::uniform3(-limit..=limit).prop_map(Vector3::from);
    // Shaken around gravity, so that the unit of the median is what it says.
    let force = prop::array::uniform3(-3.0..3.0f64).prop_map(|v| Vector3::from(v) + Vector3::new(0.0, 9.81, 0.0));
    let samples = prop::collection::vec((1..1_000_000_000i64, force, vector(100.0), vector(10_000.0)), 0..200);
    // Not a range of floats: over eight decades proptest's own sampler of them trips over its rounding now and then.
    let rate = (1..100_000_000_u32).prop_map(|thousandths| f64::from(thousandths) * 1e-3);
    let declared = (prop::option::of("[a-z \",é]{0,64}"), prop::option::of(rate), any::<i32>());
    (samples, declared, any::<bool>()).prop_map(move |(samples, (text, rate, offset), has_field)| {
        let mut unit = InertialSensor::new(segment);
        (unit.device_model, unit.mounting) = (text.clone(), text);
        (unit.nominal_rate_hz, unit.clock_offset_ns) = (rate, offset.into());
        let mut time = -1_000_000_000;
        for (step, force, rate, field) in samples {
            time += step;
            unit.time_ns.push(time);
            unit.acceleration.push(force);
            unit.angular_rate.push(rate);
            if has_field {
                unit.magnetic_field.get_or_insert_default().push(field);
            }
        }
        unit
    })
}

/// No unit, or up to three.
fn inertial() -> impl Strategy<Value = Option<InertialRecording>> {
    let units = [Segment::LeftForearm, Segment::Chest, Segment::Object5].map(unit);
    (units, 0..=3usize).prop_map(|(units, n)| {
        let sensors: Vec<InertialSensor> = units.into_iter().take(n).collect();
        (n > 0).then_some(InertialRecording { sensors })
    })
}

/// Any recording in the form that decoding gives: what is lost keeps nothing.
fn recording() -> impl Strategy<Value = Recording> {
    (1..Joint::ALL.len(), 2..12usize, any::<bool>()).prop_flat_map(|(n_joints, n_frames, with_orientations)| {
        let samples = prop::collection::vec(joint_sample(), n_joints * n_frames);
        let steps = prop::collection::vec(1..1_000_000_000i64, n_frames);
        (samples, steps, header(), prop::option::of(reference()), inertial()).prop_map(
            move |(samples, steps, header, reference, inertial)| {
                let mut skeleton =
                    SkeletonRecording { joints: Joint::ALL[..n_joints].to_vec(), ..SkeletonRecording::default() };
                let mut time = -1;
                for step in steps {
                    time += step;
                    skeleton.time_ns.push(time);
                }
                for (position, confidence, q) in samples {
                    skeleton.positions.push(position.map_or(Vector3::repeat(f64::NAN), Vector3::from));
                    skeleton.confidence.push(if position.is_some() { confidence } else { 0.0 });
                    let q = q.filter(|_| position.is_some());
                    let unit = |q: [f64; 4]| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
                    skeleton.orientations.push(q.map(unit));
                }
                if !with_orientations || skeleton.orientations.iter().all(Option::is_none) {
                    skeleton.orientations.clear();
                }
                Recording { header, skeleton: Some(skeleton), inertial, references: reference.into_iter().collect() }
            },
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_was_encoded_decodes_to_the_same_bits(recording in recording(), piece in 1..5000usize) {
        for (format, bytes) in [
            (Format::Mcap, encode::mcap(&recording).expect("mcap")),
            (Format::Json, encode::json(&recording).expect("json")),
        ] {
            let back = decode(&bytes[..], format, &Limits::default()).expect("decodes");
            prop_assert_eq!(bits(&back), bits(&recording));
            let inspection = inspect(&bytes, format, piece).expect("sound");
            let skeleton = back.skeleton.expect("skeleton");
            let units = back.inertial.iter().flat_map(|inertial| &inertial.sensors);
            prop_assert_eq!(units.clone().count(), inspection.inertial_units.len());
            for (unit, summary) in units.zip(&inspection.inertial_units) {
                prop_assert_eq!((unit.segment, unit.len() as u64), (summary.segment, summary.n_samples));
                prop_assert_eq!(unit.duration_s(), summary.duration_s);
                prop_assert_eq!(unit.magnetic_field.is_some(), summary.has_magnetic_field);
            }
            prop_assert_eq!(inspection.n_frames as usize, skeleton.len());
            prop_assert_eq!(inspection.duration_s, skeleton.duration_s());
            prop_assert_eq!(inspection.has_orientations, !skeleton.orientations.is_empty());
        }
    }
}

#[test]
fn encoding_twice_gives_the_same_bytes() {
    let recording = example();
    assert_eq!(encode::mcap(&recording).expect("mcap"), encode::mcap(&recording).expect("mcap"));
    assert_eq!(encode::json(&recording).expect("json"), encode::json(&recording).expect("json"));
}

#[test]
fn the_embedded_schemas_accept_what_is_written_and_refuse_what_is_refused() {
    let skeleton: serde_json::Value = serde_json::from_str(encode::SKELETON_SCHEMA).expect("json");
    let reference: serde_json::Value = serde_json::from_str(encode::REFERENCE_SCHEMA).expect("json");
    let inertial: serde_json::Value = serde_json::from_str(encode::INERTIAL_SCHEMA).expect("json");
    let batch = serde_json::json!({"time_ns": [1], "acceleration": [[0, 9.8, 0]], "angular_rate": [[0, 0, 1]]});
    assert!(jsonschema::is_valid(&inertial, &batch));
    assert!(!jsonschema::is_valid(&inertial, &serde_json::json!({"time_ns": [1], "acceleration": [[0, 9.8, 0]]})));
    let document: serde_json::Value = serde_json::from_slice(&encode::json(&example()).expect("json")).expect("json");
    let mut frame = document["frames"][2].clone();
    frame.as_object_mut().expect("object").remove("time_ns");
    assert!(jsonschema::is_valid(&skeleton, &frame));
    frame["positions"][0] = serde_json::json!([1, 2]);
    assert!(!jsonschema::is_valid(&skeleton, &frame));
    assert!(jsonschema::is_valid(&reference, &serde_json::json!({"time_ns": [1, 2], "values": [0.5, null]})));
    assert!(!jsonschema::is_valid(&reference, &serde_json::json!({"time_ns": [1.5], "values": [0.5]})));
}

#[test]
fn a_recording_that_mcap_cannot_hold_is_refused_by_the_encoder() {
    assert!(matches!(encode::mcap(&Recording::default()), Err(encode::EncodeError::Unsuitable(_))));
    let mut uneven = with_units();
    uneven.inertial.as_mut().expect("units").sensors[1].angular_rate.pop();
    assert!(matches!(encode::mcap(&uneven), Err(encode::EncodeError::Unsuitable(_))));
    assert!(matches!(encode::json(&uneven), Err(encode::EncodeError::Unsuitable(_))));
    let mut early = example();
    early.skeleton.as_mut().expect("skeleton").time_ns[0] = -1;
    assert!(matches!(encode::mcap(&early), Err(encode::EncodeError::Unsuitable(_))));
}
