use super::*;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Cursor;

type File = Writer<Cursor<Vec<u8>>>;

fn header() -> BTreeMap<String, String> {
    let entries = [("version", "1"), ("handedness", "right"), ("up", "+y"), ("length_unit", "m")];
    entries.map(|(key, value)| (key.to_owned(), value.to_owned())).into()
}

fn joints(names: &str) -> BTreeMap<String, String> {
    BTreeMap::from([("joints".to_owned(), names.to_owned())])
}

fn send(file: &mut File, channel_id: u16, log_time: u64, message: &str) {
    let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
    file.write_to_known_channel(&header, message.as_bytes()).expect("written");
}

fn written(options: WriteOptions, write: impl FnOnce(&mut File)) -> Vec<u8> {
    let mut file = options.create(Cursor::new(Vec::new())).expect("created");
    write(&mut file);
    file.finish().expect("finished");
    file.into_inner().into_inner()
}

fn options() -> WriteOptions {
    WriteOptions::new().profile("surefoot").compression_threads(0)
}

/// A file with metadata changed by `header_change` and one `/skeleton` channel filled by `fill`.
fn file(
    header_change: impl FnOnce(&mut BTreeMap<String, String>),
    names: &str,
    fill: impl FnOnce(&mut File, u16),
) -> Vec<u8> {
    written(options(), |file| {
        let mut metadata = header();
        header_change(&mut metadata);
        file.write_metadata(&Metadata { name: "surefoot".into(), metadata }).expect("metadata");
        let channel = file.add_channel(0, "/skeleton", "json", &joints(names)).expect("channel");
        fill(file, channel);
    })
}

const FRAME: &str = r#"{"positions": [[0, 0, 1]]}"#;

fn two_frames(file: &mut File, channel: u16) {
    send(file, channel, 0, FRAME);
    send(file, channel, 1, FRAME);
}

fn code(bytes: &[u8]) -> (&'static str, String) {
    let defect = defect(bytes, Format::Mcap);
    (defect.code, defect.place.unwrap_or_default())
}

#[test]
fn chunks_may_be_compressed_either_way_or_not_at_all_or_be_absent() {
    let variants = [
        options().compression(Some(Compression::Zstd)),
        options().compression(Some(Compression::Lz4)),
        options().compression(None),
        options().use_chunks(false),
        options().calculate_chunk_crcs(false).calculate_data_section_crc(false).compression(None),
        options().emit_statistics(false).emit_summary_records(false),
    ];
    for variant in variants {
        let bytes = written(variant, |file| {
            file.write_metadata(&Metadata { name: "surefoot".into(), metadata: header() }).expect("metadata");
            let channel = file.add_channel(0, "/skeleton", "json", &joints("head")).expect("channel");
            two_frames(file, channel);
        });
        assert_eq!(inspect(&bytes, Format::Mcap, 5).expect("sound").n_frames, 2);
    }
}

#[test]
fn every_defect_of_a_header_has_its_code() {
    let with = |key: &str, value: &str| {
        let (key, value) = (key.to_owned(), value.to_owned());
        code(&file(
            |m| {
                m.insert(key, value);
            },
            "head",
            two_frames,
        ))
    };
    assert_eq!(with("version", "2"), ("unsupported_version", "header.version".into()));
    assert_eq!(with("handedness", "both").0, "invalid_value");
    assert_eq!(with("up", "y").0, "invalid_value");
    assert_eq!(with("length_unit", "mm").0, "invalid_value");
    assert_eq!(with("subject_height_m", "tall").0, "invalid_value");
    assert_eq!(with("subject_height_m", "NaN").0, "invalid_value");
    assert_eq!(with("segment_lengths_m", "0.4"), ("invalid_value", "header.segment_lengths_m".into()));
    let unknown = ("invalid_value", "header.segment_lengths_m.left_tigh".into());
    assert_eq!(with("segment_lengths_m", r#"{"left_tigh": 0.4}"#), unknown);
    assert_eq!(with("start_time", "noon").0, "invalid_value");
    assert_eq!(with("protocol", &"x".repeat(65)).0, "invalid_value");
    assert_eq!(
        code(&file(
            |m| {
                m.remove("up");
            },
            "head",
            two_frames
        )),
        ("missing_field", "header.up".into())
    );
}

#[test]
fn every_defect_of_a_frame_has_its_code_and_its_place() {
    let with = |message: &str| code(&file(|_| (), "head,neck", |f, c| send(f, c, 0, message)));
    let place = |place: &str| place.to_owned();
    assert_eq!(with(r#"{"positions": [[0, 0, 0], [0, NaN, 0]]}"#), ("not_finite", place("frames[0].positions[1][1]")));
    assert_eq!(with(r#"{"positions": [[0, 0, 0], [0, Infinity, 0]]}"#).0, "not_finite");
    assert_eq!(with(r#"{"positions": [[0, 0, 0]]}"#), ("joint_count_mismatch", place("frames[0].positions")));
    assert_eq!(
        with(r#"{"positions": [[0, 0, 0], [0, 101, 0]]}"#),
        ("position_out_of_range", place("frames[0].positions[1]"))
    );
    assert_eq!(with(r#"{"positions": [null, null], "time_ns": 0}"#).0, "unknown_field");
    assert_eq!(with(r#"{"positions": [null, null], "extra": 0}"#).0, "unknown_field");
    assert_eq!(with(r#"{"positions": [null, nul"#).0, "truncated");
    assert_eq!(with("\x01\x02").0, "invalid_json");
    assert_eq!(with("{}").0, "missing_field");
}

#[test]
fn every_defect_of_the_structure_has_its_code() {
    assert_eq!(code(b"").0, "empty_recording");
    assert_eq!(code(b"PK\x03\x04 a zip file, say").0, "not_a_recording");
    assert_eq!(code(&file(|_| (), "head", |_, _| ())).0, "empty_recording");
    assert_eq!(code(&file(|_| (), "head", |f, c| send(f, c, 0, FRAME))).0, "too_few_frames");
    assert_eq!(code(&file(|_| (), "head,tail", two_frames)), ("unknown_joint", "joints[1]".into()));
    assert_eq!(code(&file(|_| (), "head,head", two_frames)), ("duplicate_joint", "joints[1]".into()));
    let repeated = file(
        |_| (),
        "head",
        |f, c| {
            send(f, c, 7, FRAME);
            send(f, c, 7, FRAME);
        },
    );
    assert_eq!(code(&repeated), ("time_not_increasing", "frames[1].time_ns".into()));
    let backwards = file(
        |_| (),
        "head",
        |f, c| {
            send(f, c, 7, FRAME);
            send(f, c, 6, FRAME);
        },
    );
    assert_eq!(code(&backwards).0, "time_not_increasing");
    let beyond = file(
        |_| (),
        "head",
        |f, c| {
            send(f, c, 7, FRAME);
            send(f, c, u64::MAX, FRAME);
        },
    );
    assert_eq!(code(&beyond), ("invalid_value", "frames[1].time_ns".into()));
    let second = file(
        |_| (),
        "head",
        |f, c| {
            two_frames(f, c);
            let other = f.add_channel(0, "/skeleton", "json", &joints("neck")).expect("channel");
            two_frames(f, other);
        },
    );
    assert_eq!(code(&second).0, "duplicate_channel");
    let twice = file(
        |_| (),
        "head",
        |f, _| f.write_metadata(&Metadata { name: "surefoot".into(), metadata: header() }).expect("metadata"),
    );
    assert_eq!(code(&twice).0, "invalid_mcap");
    let unknown = file(
        |_| (),
        "head",
        |f, _| {
            let other = f.add_channel(0, "/camera", "json", &BTreeMap::new()).expect("channel");
            two_frames(f, other);
        },
    );
    assert_eq!(code(&unknown).0, "unknown_topic");
    let binary = file(
        |_| (),
        "head",
        |f, _| {
            let other = f.add_channel(0, "/skeleton", "protobuf", &joints("head,neck")).expect("channel");
            two_frames(f, other);
        },
    );
    assert_eq!(code(&binary).0, "unsupported_encoding");
    let wrong = written(options().profile("ros2"), |_| ());
    assert_eq!(code(&wrong).0, "wrong_profile");
    let headless = written(options(), |f| {
        let channel = f.add_channel(0, "/skeleton", "json", &joints("head")).expect("channel");
        two_frames(f, channel);
    });
    assert_eq!(code(&headless).0, "missing_header");
}

#[test]
fn private_topics_are_accepted_counted_and_not_read() {
    let bytes = file(
        |_| (),
        "head",
        |f, c| {
            two_frames(f, c);
            for topic in ["/x/heart_rate", "/x/heart_rate_2"] {
                let other = f.add_channel(0, topic, "whatever", &BTreeMap::new()).expect("channel");
                send(f, other, 0, "\u{1}");
            }
        },
    );
    let ignored = inspect(&bytes, Format::Mcap, 1000).expect("sound").ignored_channels;
    let topics: Vec<&str> = ignored.iter().map(|channel| channel.topic.as_str()).collect();
    assert_eq!(topics, ["/x/heart_rate", "/x/heart_rate_2"]);
    assert!(ignored.iter().all(|channel| channel.n_messages == 1));
}

#[test]
fn reference_channels_are_checked() {
    let with = |topic: &str, metadata: &[(&str, &str)], messages: &[&str]| {
        let metadata = metadata.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        code(&file(
            |_| (),
            "head",
            |f, c| {
                two_frames(f, c);
                let other = f.add_channel(0, topic, "json", &metadata).expect("channel");
                messages.iter().for_each(|message| send(f, other, 0, message));
            },
        ))
    };
    let fine = r#"{"time_ns": [0, 1], "values": [0, null]}"#;
    let knee = "/reference/knee_deg";
    assert_eq!(with(knee, &[], &[fine]).0, "missing_field");
    assert_eq!(with(knee, &[("source", "a"), ("clock_offset_ns", "1.5")], &[fine]).0, "invalid_value");
    assert_eq!(with("/reference/", &[("source", "a")], &[fine]).0, "invalid_value");
    assert_eq!(
        with(knee, &[("source", "a")], &[fine, fine]),
        ("time_not_increasing", "references[0].batches[1].time_ns[0]".into())
    );
    assert_eq!(with(knee, &[("source", "a")], &[r#"{"time_ns": [0], "values": []}"#]).0, "invalid_value");
    assert_eq!(
        with(knee, &[("source", "a")], &[r#"{"time_ns": [0], "values": [NaN]}"#]),
        ("not_finite", "references[0].batches[0].values[0]".into())
    );
}

#[test]
fn a_decompression_bomb_is_refused_by_what_it_claims_and_by_what_it_holds() {
    let bytes = written(options().chunk_size(None), |file| {
        file.write_metadata(&Metadata { name: "surefoot".into(), metadata: header() }).expect("metadata");
        let channel = file.add_channel(0, "/skeleton", "json", &joints("head")).expect("channel");
        two_frames(file, channel);
        let padding = file.add_channel(0, "/x/zeros", "none", &BTreeMap::new()).expect("channel");
        send(file, padding, 2, &" ".repeat(20 << 20));
    });
    assert!(bytes.len() < 64 * 1024, "it is a bomb");
    assert_eq!(code(&bytes).0, "decompression_limit");
    let small = Limits { max_decompressed_bytes: 20 << 20, max_chunk_bytes: 32 << 20, ..Limits::default() };
    assert_eq!(
        decode(&bytes[..], Format::Mcap, &small).map(|r| bits(&r)).expect_err("bomb").code,
        "decompression_limit"
    );

    // The same with a header that lies about the size: nothing is read past the claim.
    let claim = position(&bytes, b"zstd") - 4 - 4 - 8;
    let mut lying = bytes.clone();
    lying[claim..claim + 8].copy_from_slice(&1000u64.to_le_bytes());
    assert_eq!(code(&lying).0, "checksum_mismatch");
}

#[test]
fn a_length_that_no_memory_could_hold_is_refused_at_once() {
    let mut bytes = mcap::MAGIC.to_vec();
    bytes.push(0x01);
    bytes.extend(u64::MAX.to_le_bytes());
    bytes.extend([0; 100]);
    assert_eq!(code(&bytes).0, "record_too_large");
}

fn position(haystack: &[u8], needle: &[u8]) -> usize {
    haystack.windows(needle.len()).position(|window| window == needle).expect("found")
}
