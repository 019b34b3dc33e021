//! The inertial part: what is taken, what is refused and where, what is only doubted.

use super::*;
use crate::recording::inertial_quality::InertialWarningKind;
use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Cursor;

fn document() -> Value {
    serde_json::from_slice(&encode::json(&with_units()).expect("json")).expect("json")
}

/// The code and place after a change of the first unit of a sound document.
fn changed(change: impl FnOnce(&mut Value)) -> (&'static str, String) {
    let mut document = document();
    change(&mut document["inertial"][0]);
    let defect = defect(document.to_string().as_bytes(), Format::Json);
    (defect.code, defect.place.unwrap_or_default())
}

fn pair(code: &'static str, place: &str) -> (&'static str, String) {
    (code, place.to_owned())
}

#[test]
fn every_defect_of_a_unit_has_its_code_and_its_place() {
    assert_eq!(changed(|u| u["segment"] = json!("left_tail")), pair("unknown_segment", "inertial[0]"));
    assert_eq!(changed(|u| u["segment"] = json!("chest")), pair("duplicate_channel", "inertial[1]"));
    assert_eq!(changed(|u| u["mounting"] = json!("x".repeat(65))), pair("invalid_value", "inertial[0].mounting"));
    for rate in [json!(0), json!(-5), json!(1e6)] {
        assert_eq!(changed(|u| u["nominal_rate_hz"] = rate), pair("invalid_value", "inertial[0].nominal_rate_hz"));
    }
    assert_eq!(changed(|u| u["colour"] = json!(1)).0, "unknown_field");
    assert_eq!(changed(|u| u["time_ns"] = json!([0, 5, 5])), pair("time_not_increasing", "inertial[0].time_ns[2]"));
    assert_eq!(changed(|u| u["time_ns"] = json!([0, 5, 4])), pair("time_not_increasing", "inertial[0].time_ns[2]"));
    assert_eq!(changed(|u| u["time_ns"] = json!([0, 5, i64::MAX])), pair("too_long", "inertial[0].time_ns[2]"));
    assert_eq!(changed(|u| u["time_ns"] = json!([i64::MIN, 5, i64::MAX])), pair("too_long", "inertial[0].time_ns[1]"));
    assert_eq!(changed(|u| u["time_ns"] = json!([0, 5])), pair("sample_count_mismatch", "inertial[0].acceleration"));
    for list in ["acceleration", "angular_rate", "magnetic_field"] {
        let place = |rest: &str| format!("inertial[0].{list}{rest}");
        assert_eq!(changed(|u| u[list] = json!([[0, 9, 0]])), pair("sample_count_mismatch", &place("")));
        assert_eq!(changed(|u| u[list][1] = json!([0, 9])), pair("invalid_value", &place("[1]")));
        assert_eq!(changed(|u| u[list][1] = json!(null)), pair("invalid_value", &place("[1]")));
        let code = if list == "magnetic_field" { "invalid_value" } else { &format!("{list}_unit") };
        let beyond = changed(|u| u[list][1] = json!([0, 9, 20_000]));
        assert_eq!((beyond.0, beyond.1), (code, place("[1]")));
    }
    assert_eq!(
        changed(|u| {
            u.as_object_mut().expect("object").remove("angular_rate");
        })
        .0,
        "missing_field"
    );
    let text = document().to_string().replacen("[0.1,-0.01,0.0]", "[0.1,NaN,0.0]", 1);
    let found = defect(text.as_bytes(), Format::Json);
    assert_eq!((found.code, found.place.as_deref()), ("not_finite", Some("inertial[0].angular_rate[1][1]")));
}

#[test]
fn joints_without_frames_and_frames_without_joints_are_refused() {
    for absent in ["joints", "frames"] {
        let mut document = document();
        document.as_object_mut().expect("object").remove(absent);
        let found = defect(document.to_string().as_bytes(), Format::Json);
        assert_eq!((found.code, found.place.as_deref()), ("missing_field", Some(absent)));
    }
}

/// A unit that is turned about z in gravity along y, 4 s at 100 Hz, its numbers multiplied.
fn turned(acceleration: f64, angular_rate: f64) -> Recording {
    let mut unit = InertialSensor::new(Segment::LeftShank);
    for i in 0..400 {
        let t = f64::from(i) * 0.01;
        let (angle, rate) = ((2.0 * t).sin(), 2.0 * (2.0 * t).cos());
        unit.time_ns.push(i64::from(i) * 10_000_000);
        unit.acceleration.push(Vector3::new(angle.sin(), angle.cos(), 0.0) * 9.81 * acceleration);
        unit.angular_rate.push(Vector3::new(0.0, 0.0, rate) * angular_rate);
    }
    Recording { inertial: Some(InertialRecording { sensors: vec![unit] }), ..Recording::default() }
}

#[test]
fn a_unit_in_g_or_in_degrees_is_named_as_such_in_both_formats() {
    for (recording, code, place, words) in [
        (turned(1.0 / 9.81, 1.0), "acceleration_unit", "inertial[0].acceleration", "is it in g?"),
        (turned(1000.0 / 9.81, 1.0), "acceleration_unit", "inertial[0].acceleration", "is it in mg?"),
        (turned(0.01, 1.0), "acceleration_unit", "inertial[0].acceleration", "was gravity subtracted?"),
        (turned(1.0, 57.29578 / 2.0), "angular_rate_unit", "inertial[0].angular_rate", "degrees per second"),
    ] {
        let mut recording = recording;
        if code == "angular_rate_unit" {
            // Half of it twice as slowly keeps the numbers of degrees below the bound on a single one.
            let unit = &mut recording.inertial.as_mut().expect("units").sensors[0];
            unit.time_ns.iter_mut().for_each(|time| *time *= 2);
        }
        for (format, bytes) in [
            (Format::Mcap, encode::mcap(&recording).expect("mcap")),
            (Format::Json, encode::json(&recording).expect("json")),
        ] {
            let found = defect(&bytes, format);
            assert_eq!((found.code, found.place.as_deref()), (code, Some(place)), "{}", found.sentence);
            assert!(found.sentence.contains(words) && found.sentence.contains("left_shank"), "{}", found.sentence);
        }
    }
}

#[test]
fn inertial_units_alone_are_a_recording_and_nothing_at_all_is_none() {
    let recording = turned(1.0, 1.0);
    for (format, bytes) in [
        (Format::Mcap, encode::mcap(&recording).expect("mcap")),
        (Format::Json, encode::json(&recording).expect("json")),
    ] {
        assert_eq!(bits(&decode(&bytes[..], format, &Limits::default()).expect("decodes")), bits(&recording));
        let inspection = inspect(&bytes, format, 777).expect("sound");
        assert_eq!((inspection.n_frames, inspection.duration_s, inspection.joints.len()), (0, 3.99, 0));
        let unit = &inspection.inertial_units[0];
        assert_eq!((unit.segment, unit.n_samples, unit.duration_s), (Segment::LeftShank, 400, 3.99));
        assert!((unit.rate_hz.expect("a rate") - 100.0).abs() < 1e-9);
        assert_eq!((unit.n_missing, &unit.warnings[..]), (0, &[][..]));
    }
    let mut silent = turned(1.0, 1.0);
    silent.inertial = Some(InertialRecording { sensors: vec![InertialSensor::new(Segment::Chest)] });
    for (format, bytes) in
        [(Format::Mcap, encode::mcap(&silent).expect("mcap")), (Format::Json, encode::json(&silent).expect("json"))]
    {
        assert_eq!(defect(&bytes, format).code, "empty_recording");
    }
}

#[test]
fn doubts_are_told_with_the_unit_and_do_not_refuse() {
    let mut recording = turned(1.0, -1.0);
    let unit = &mut recording.inertial.as_mut().expect("units").sensors[0];
    unit.nominal_rate_hz = Some(60.0);
    unit.clock_offset_ns = 2_000_000_000;
    let inspection = inspect(&encode::mcap(&recording).expect("mcap"), Format::Mcap, 999).expect("accepted");
    let unit = &inspection.inertial_units[0];
    let kinds: Vec<InertialWarningKind> = unit.warnings.iter().map(|warning| warning.kind).collect();
    assert_eq!(kinds, [InertialWarningKind::RateDiffers, InertialWarningKind::MirroredAxis]);
    assert_eq!((unit.start_s, unit.nominal_rate_hz), (2.0, Some(60.0)));
}

/// An MCAP file with one inertial channel.
fn file(topic: &str, encoding: &str, metadata: &[(&str, &str)], messages: &[&str]) -> Vec<u8> {
    let mut file = WriteOptions::new().profile("surefoot").create(Cursor::new(Vec::new())).expect("a writer");
    let header = [("version", "1"), ("handedness", "right"), ("up", "+y"), ("length_unit", "m")];
    let map = |entries: &[(&str, &str)]| -> BTreeMap<String, String> {
        entries.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
    };
    file.write_metadata(&Metadata { name: "surefoot".into(), metadata: map(&header) }).expect("metadata");
    let channel_id = file.add_channel(0, topic, encoding, &map(metadata)).expect("channel");
    for message in messages {
        let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
        file.write_to_known_channel(&header, message.as_bytes()).expect("written");
    }
    file.finish().expect("finished");
    file.into_inner().into_inner()
}

#[test]
fn inertial_channels_are_checked() {
    let of = |topic: &str, encoding: &str, metadata: &[(&str, &str)], messages: &[&str]| {
        let found = defect(&file(topic, encoding, metadata, messages), Format::Mcap);
        (found.code, found.place.unwrap_or_default())
    };
    let chest = "/inertial/chest";
    let plain = r#"{"time_ns": [0], "acceleration": [[0, 9.8, 0]], "angular_rate": [[0, 0, 0]]}"#;
    let later = r#"{"time_ns": [9], "acceleration": [[0, 9.8, 0]], "angular_rate": [[0, 0, 0]], "magnetic_field": [[1, 2, 3]]}"#;
    assert!(inspect(&file(chest, "json", &[], &[plain]), Format::Mcap, 100).is_ok());
    assert_eq!(of("/inertial/nose", "json", &[], &[plain]), pair("unknown_segment", "/inertial/nose"));
    assert_eq!(of(chest, "cbor", &[], &[plain]), pair("unsupported_encoding", chest));
    let offset = [("clock_offset_ns", "1.5")];
    assert_eq!(of(chest, "json", &offset, &[plain]), pair("invalid_value", "/inertial/chest.clock_offset_ns"));
    for rate in ["fast", "NaN", "inf", "-1"] {
        let rate = [("nominal_rate_hz", rate)];
        assert_eq!(of(chest, "json", &rate, &[plain]), pair("invalid_value", "/inertial/chest.nominal_rate_hz"));
    }
    assert_eq!(
        of(chest, "json", &[], &[plain, plain]),
        pair("time_not_increasing", "inertial[0].batches[1].time_ns[0]")
    );
    assert_eq!(
        of(chest, "json", &[], &[plain, later]),
        pair("sample_count_mismatch", "inertial[0].batches[1].magnetic_field")
    );
    let infinite = plain.replace("9.8", "1e999");
    assert_eq!(of(chest, "json", &[], &[&infinite]), pair("not_finite", "inertial[0].batches[0].acceleration[0][1]"));
}

#[test]
fn hostile_sizes_are_refused_by_the_limit_on_samples() {
    let recording = turned(1.0, 1.0);
    let limits = Limits { max_inertial_samples: 399, ..Limits::default() };
    for (format, bytes) in [
        (Format::Mcap, encode::mcap(&recording).expect("mcap")),
        (Format::Json, encode::json(&recording).expect("json")),
    ] {
        let found = decode(&bytes[..], format, &limits).map(|r| bits(&r)).expect_err("too many");
        assert_eq!(found.code, "too_many_samples");
    }
    // More time stamps in one batch than are kept are counted, not stored.
    let zeros = vec!["0"; 1_000_001].join(",");
    let message = format!(r#"{{"time_ns": [{zeros}], "acceleration": [], "angular_rate": []}}"#);
    assert_eq!(defect(&file("/inertial/chest", "json", &[], &[&message]), Format::Mcap).code, "too_many_samples");
    let short = Limits { max_duration_s: 3, ..Limits::default() };
    let bytes = encode::mcap(&recording).expect("mcap");
    let found = decode(&bytes[..], Format::Mcap, &short).map(|r| bits(&r)).expect_err("too long");
    assert_eq!(found.code, "too_long");
}

#[test]
fn an_inspector_keeps_no_sample() {
    let mut decoder = Decoder::new(Format::Mcap, &Limits::default(), false);
    decoder.push(&encode::mcap(&turned(1.0, 1.0)).expect("mcap")).expect("sound");
    assert!(decoder.finish().expect("sound").recording.is_none());
}

#[test]
fn the_page_names_every_segment() {
    let page = include_str!("../../../../docs/recording-format.md");
    let section = page.split("\n### Topics `/inertial/<segment>`").nth(1).expect("the section");
    let list = section.split("```text").nth(1).expect("the list").split("```").next().expect("its text");
    let mut named: Vec<&str> = list.split_whitespace().collect();
    let mut known: Vec<&str> = Segment::ALL.iter().map(|segment| segment.name()).collect();
    named.sort_unstable();
    known.sort_unstable();
    assert_eq!(named, known);
}
