use super::*;
use serde_json::{Value, json};

fn document() -> Value {
    serde_json::from_slice(&encode::json(&example()).expect("json")).expect("json")
}

/// The code and place after a change of a sound document.
fn changed(change: impl FnOnce(&mut Value)) -> (&'static str, String) {
    let mut document = document();
    change(&mut document);
    refused(&document.to_string())
}

fn refused(text: &str) -> (&'static str, String) {
    let defect = defect(text.as_bytes(), Format::Json);
    (defect.code, defect.place.unwrap_or_default())
}

fn pair(code: &'static str, place: &str) -> (&'static str, String) {
    (code, place.to_owned())
}

#[test]
fn every_defect_of_a_document_has_its_code_and_its_place() {
    let expected = |code, place: &str| pair(code, place);
    assert_eq!(changed(|d| d["format"] = json!("bvh")), expected("wrong_profile", "format"));
    assert_eq!(changed(|d| d["version"] = json!(2)), expected("unsupported_version", "version"));
    assert_eq!(
        changed(|d| d["coordinates"]["handedness"] = json!("both")),
        expected("invalid_value", "coordinates.handedness")
    );
    assert_eq!(changed(|d| d["coordinates"]["up"] = json!("y")), expected("invalid_value", "coordinates.up"));
    assert_eq!(
        changed(|d| d["coordinates"]["length_unit"] = json!("mm")),
        expected("invalid_value", "coordinates.length_unit")
    );
    assert_eq!(
        changed(|d| d["header"]["subject_height_m"] = json!(175)),
        expected("invalid_value", "header.subject_height_m")
    );
    for (name, length_m) in [("left_tigh", 0.4), ("left_thigh", 0.9), ("left_thigh", 42.0), ("left_thigh", 0.04)] {
        assert_eq!(
            changed(|d| d["header"]["segment_lengths_m"] = json!({"right_shank": 0.4, name: length_m})),
            expected("invalid_value", &format!("header.segment_lengths_m.{name}"))
        );
    }
    assert_eq!(
        changed(|d| d["header"]["start_time"] = json!("yesterday")),
        expected("invalid_value", "header.start_time")
    );
    assert_eq!(changed(|d| d["joints"][1] = json!("knie")), expected("unknown_joint", "joints[1]"));
    assert_eq!(changed(|d| d["joints"][1] = json!("right_hip")), expected("duplicate_joint", "joints[1]"));
    assert_eq!(changed(|d| d["joints"] = json!(vec!["right_hip"; 1000])), expected("duplicate_joint", "joints"));
    assert_eq!(changed(|d| d["frames"] = json!([])), expected("empty_recording", ""));
    assert_eq!(changed(|d| d["frames"].as_array_mut().expect("list").truncate(1)), expected("too_few_frames", ""));
    assert_eq!(
        changed(|d| d["frames"][3]["positions"] = json!([[0, 0, 0]])),
        expected("joint_count_mismatch", "frames[3].positions")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["confidence"] = json!([1])),
        expected("joint_count_mismatch", "frames[3].confidence")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["orientations"] = json!([])),
        expected("joint_count_mismatch", "frames[3].orientations")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["positions"][1] = json!([0, 0])),
        expected("invalid_value", "frames[3].positions[1]")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["positions"][1] = json!([0, 0, 0, 0])),
        expected("invalid_value", "frames[3].positions[1]")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["positions"][1] = json!([0, 0, 2000])),
        expected("position_out_of_range", "frames[3].positions[1]")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["confidence"][0] = json!(1.5)),
        expected("confidence_out_of_range", "frames[3].confidence[0]")
    );
    assert_eq!(
        changed(|d| d["frames"][3]["confidence"][0] = json!(-0.1)),
        expected("confidence_out_of_range", "frames[3].confidence[0]")
    );
    let bad = json!([[1, 1, 0, 0], null, null]);
    assert_eq!(
        changed(|d| d["frames"][3]["orientations"] = bad),
        expected("bad_quaternion", "frames[3].orientations[0]")
    );
    assert_eq!(changed(|d| d["frames"][3]["time_ns"] = json!(0)), expected("time_not_increasing", "frames[3].time_ns"));
    assert_eq!(
        changed(|d| d["frames"][3]["time_ns"] = d["frames"][2]["time_ns"].clone()),
        expected("time_not_increasing", "frames[3].time_ns")
    );
    assert_eq!(changed(|d| d["frames"][4]["time_ns"] = json!(i64::MAX)), expected("too_long", "frames[4].time_ns"));
    assert_eq!(
        changed(|d| d["frames"][3] = json!({"positions": [null, null, null]})),
        expected("missing_field", "frames[3]")
    );
    assert_eq!(changed(|d| d["frames"][3]["colour"] = json!(1)).0, "unknown_field");
    assert_eq!(changed(|d| d["colour"] = json!(1)).0, "unknown_field");
    assert_eq!(
        changed(|d| {
            d.as_object_mut().expect("object").remove("joints");
        })
        .0,
        "missing_field"
    );
    assert_eq!(
        changed(|d| d["references"][0]["channel"] = json!("Knee Flexion")),
        expected("invalid_value", "references[0]")
    );
    assert_eq!(changed(|d| d["references"][0]["values"] = json!([1])), expected("invalid_value", "references[0]"));
    assert_eq!(
        changed(|d| d["references"][0]["time_ns"][2] = json!(10)),
        expected("time_not_increasing", "references[0].time_ns[2]")
    );
    assert_eq!(
        changed(|d| {
            let r = d["references"][0].clone();
            d["references"].as_array_mut().expect("list").push(r);
        }),
        expected("duplicate_channel", "references[1]")
    );
}

#[test]
fn not_a_number_as_python_writes_it_is_not_finite_and_located() {
    let text = document().to_string();
    let broken = text.replacen("[0.1,0.6,-1.99]", "[0.1,NaN,-1.99]", 1);
    assert_ne!(broken, text, "the example holds the position that is replaced");
    assert_eq!(refused(&broken), pair("not_finite", "frames[0].positions[1][1]"));
    let broken = text.replacen("1.5", "-Infinity", 1);
    assert_eq!(refused(&broken), pair("not_finite", "references[0].values[0]"));
    let broken = text.replacen("[0.1,0.6,-1.99]", "[0.1,1e999,-1.99]", 1);
    assert_eq!(refused(&broken), pair("not_finite", "frames[0].positions[1][1]"));
}

#[test]
fn bombs_are_refused_without_memory_or_stack() {
    let nested = "[".repeat(1_000_000);
    assert_eq!(refused(&format!("{{\"joints\": {nested}")).0, "invalid_value");
    assert_eq!(refused(&format!("{{\"frames\": {nested}")).0, "truncated");
    let closed = format!("{nested}{}", "]".repeat(1_000_000));
    assert_eq!(changed_text("\"frames\":", &closed).0, "invalid_value");
    let objects = "{\"a\":".repeat(1_000_000);
    assert_eq!(refused(&objects).0, "unknown_field");
    let many = format!("[{}null]", "null,".repeat(1_000_000));
    assert_eq!(changed_text("\"positions\":", &many), pair("joint_count_mismatch", "frames[0].positions"));
}

/// The code and place after the first list of lists behind `name` was replaced in a sound document's text.
fn changed_text(name: &str, value: &str) -> (&'static str, String) {
    let text = document().to_string();
    let start = text.find(name).expect("the name") + name.len();
    let last = if name.contains("frames") { "}]" } else { "]]" };
    let end = start + text[start..].find(last).expect("the list's end") + 2;
    refused(&format!("{}{value}{}", &text[..start], &text[end..]))
}

#[test]
fn a_document_larger_than_the_limit_is_refused_while_it_arrives() {
    let limits = Limits { max_json_bytes: 1000, ..Limits::default() };
    let mut inspector = Inspector::new(Format::Json, &limits);
    inspector.push(&[b' '; 1000]).expect("within the limit");
    assert_eq!(inspector.push(b" ").expect_err("over it").code, "too_large");
}

#[test]
fn things_that_are_no_document_are_refused() {
    assert_eq!(refused("").0, "empty_recording");
    assert_eq!(refused("  \n").0, "empty_recording");
    assert_eq!(refused("[]").0, "invalid_value");
    assert_eq!(refused("{").0, "truncated");
    assert_eq!(refused("{\"format\": \"\u{fffd}").0, "truncated");
    assert_eq!(defect(b"{\"format\": \"\xff\"}", Format::Json).code, "invalid_json");
    let text = document().to_string();
    assert_eq!(refused(&format!("{text} x")).0, "invalid_json");
}

#[test]
fn the_order_of_fields_and_a_byte_order_mark_do_not_matter() {
    let document = document();
    let fields = ["references", "frames", "joints", "header", "coordinates", "version", "format"];
    let parts: Vec<String> = fields.iter().map(|name| format!("\"{name}\": {}", document[name])).collect();
    let text = format!("\u{feff}{{{}}}", parts.join(",\n"));
    let back = decode(text.as_bytes(), Format::Json, &Limits::default()).expect("decodes");
    assert_eq!(bits(&back), bits(&example()));
}

#[test]
fn lost_joints_keep_nothing_however_they_are_written() {
    let mut document = document();
    document["frames"][0]["confidence"][1] = json!(0);
    document["frames"][1]["positions"][0] = json!(null);
    document["frames"][1]["orientations"] = json!([[1, 0, 0, 0], [0, 0, 0, 0], [0.9999, 0, 0, 0]]);
    let back = decode(document.to_string().as_bytes(), Format::Json, &Limits::default()).expect("decodes");
    let skeleton = back.skeleton.expect("skeleton");
    assert!(skeleton.positions[1].x.is_nan() && skeleton.confidence[1] == 0.0);
    assert!(skeleton.positions[3].x.is_nan() && skeleton.confidence[3] == 0.0);
    assert_eq!(skeleton.orientations.len(), 15);
    assert_eq!(
        skeleton.orientations.iter().flatten().count(),
        1,
        "of the lost joint and of four zeros nothing is kept"
    );
    assert_eq!(skeleton.orientations[5].map(|q| q.w), Some(1.0));
}

#[test]
fn left_handed_numbers_are_mirrored() {
    let mut document = document();
    document["coordinates"] = json!({"handedness": "left", "up": "+y", "length_unit": "m"});
    let back = decode(document.to_string().as_bytes(), Format::Json, &Limits::default()).expect("decodes");
    assert_eq!(back.skeleton.expect("skeleton").positions[0], Vector3::new(-0.1, 1.0, -2.0));
}

#[test]
fn limits_on_frames_and_samples_hold() {
    let text = document().to_string();
    let code =
        |limits: Limits| decode(text.as_bytes(), Format::Json, &limits).map(|r| bits(&r)).expect_err("limit").code;
    assert_eq!(code(Limits { max_frames: 4, ..Limits::default() }), "too_many_frames");
    assert_eq!(code(Limits { max_reference_samples: 2, ..Limits::default() }), "too_many_samples");
    assert_eq!(code(Limits { max_duration_s: 0, ..Limits::default() }), "too_long");
}

#[test]
fn the_example_on_the_page_is_a_valid_recording() {
    let page = include_str!("../../../../docs/recording-format.md");
    let section = page.split("\n## JSON").nth(1).expect("the section");
    let example = section.split("```json").nth(1).expect("the example").split("```").next().expect("its text");
    let inspection = inspect(example.as_bytes(), Format::Json, 100).expect("valid");
    assert_eq!((inspection.n_frames, inspection.joints.len()), (2, 2));
    assert_eq!(inspection.header.device.model.as_deref(), Some("kinect-v2"));
}

#[test]
fn the_page_names_every_joint() {
    let page = include_str!("../../../../docs/recording-format.md");
    let list = page.split("```text").nth(1).expect("the list").split("```").next().expect("its text");
    let mut named: Vec<&str> = list.split_whitespace().collect();
    let mut known: Vec<&str> = Joint::ALL.iter().map(|joint| joint.name()).collect();
    named.sort_unstable();
    known.sort_unstable();
    assert_eq!(named, known);
}
