//! The Python examples: a recording that decodes, a home app that records, uploads, waits and shows the report, and uploads that
//! resume. They run when Python is there, with the `mcap` package where a recording is written.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use surefoot::body::Joint;
use surefoot::geometry::three_point::flexion_of_three_points;
use surefoot::recording::{Format, Inspector, Limits, decode};
use surefoot::signal::interpolation::interpolate;

#[test]
fn the_python_example_writes_a_recording_whose_knees_bend_as_its_reference_says() {
    if !has_mcap() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("squats.mcap");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/python/write_recording.py");
    let output = Command::new("python3").arg(script).arg(&file).output().expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let bytes = std::fs::read(&file).expect("written");
    let mut inspector = Inspector::new(Format::Mcap, &Limits::default());
    inspector.push(&bytes).expect("sound");
    let inspection = inspector.finish().expect("whole");
    assert_eq!(inspection.header.protocol.as_deref(), Some("squat"));
    assert_eq!(inspection.joints.len(), 16);

    let recording = decode(&bytes[..], Format::Mcap, &Limits::default()).expect("decodes");
    let skeleton = recording.skeleton.expect("a skeleton");
    assert_eq!(skeleton.len(), 421);
    let lost = skeleton.confidence.iter().filter(|confidence| **confidence == 0.0).count();
    assert_eq!(lost, 8, "the left hand, every fiftieth frame from the 25th on");
    let reference = &recording.references[1];
    assert_eq!(reference.channel, "right_knee_flexion_deg");
    let [hip, knee, foot] =
        [Joint::RightHip, Joint::RightKnee, Joint::RightFoot].map(|j| skeleton.column(j).expect("j"));
    for (t, &time_ns) in skeleton.time_ns.iter().enumerate() {
        let frame = skeleton.frame(t);
        let raw = flexion_of_three_points(&frame[hip], &frame[knee], &frame[foot]).to_degrees();
        let truth = interpolate(&reference.time_ns, &reference.values, time_ns);
        // Positions are rounded to 0.01 mm on segments of 0.4 m, angles are read between samples 10 ms apart.
        assert!(truth.is_nan() || (raw - truth).abs() < 0.01, "frame {t}: {raw} and {truth}");
    }
}

#[test]
fn the_home_app_records_uploads_waits_and_shows_the_report() {
    if !has_mcap() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (_service, address, key) = started(&folder.path().join("data"));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/python/home_app.py");
    let app = Command::new("python3")
        .arg(script)
        .args([&address, &key])
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&app.stdout);
    assert!(app.status.success(), "{said}{}", String::from_utf8_lossy(&app.stderr));
    assert!(said.contains("assessed: measured, 3 repetitions"), "{said}");
    assert!(said.contains("Report of home-") && said.contains("not a diagnosis"), "{said}");
}

#[test]
fn the_client_brings_a_recording_in_pieces_and_goes_on_where_it_broke_off() {
    const SCRIPT: &str = "
import sys
from surefoot_client import Client
address, key, path = sys.argv[1:]
client = Client(address, key)
patient = client.create_patient(body={'pseudonym': 'P-1'})
client.record_consent(id=patient['id'], body={'scope': 'assessment', 'text_version': 'test'})
session = client.create_session(body={'patient_id': patient['id']})['id']
upload = client.begin_upload(session, path)
with open(path, 'rb') as file:
    headers = {'Tus-Resumable': '1.0.0', 'Upload-Offset': '0', 'Content-Type': 'application/offset+octet-stream'}
    client.request('PATCH', '/v1/uploads/' + upload, file.read(777), headers)
recording, job = client.resume_upload(upload, path, piece_bytes=10_000)
assert client.read_job(id=job)['recording_id'] == recording
with open(path, 'rb') as file:
    assert client.request('GET', f'/v1/recordings/{recording}/content') == file.read()
again, _ = client.upload_file(session, path, resume_above=0, piece_bytes=50_000)
assert again != recording
";
    if !Command::new("python3").arg("--version").output().is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 is not there");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (service, address, key) = started(&folder.path().join("data"));
    let path = folder.path().join("knee.mcap");
    let mut simulate = Command::new(env!("CARGO_BIN_EXE_surefoot"));
    assert!(
        simulate.args(["simulate", "back_knee", "--out"]).arg(&path).stdout(Stdio::null()).status().unwrap().success()
    );
    let mut python = Command::new("python3");
    python.args(["-c", SCRIPT, &address, &key]).arg(path).env("PYTHONDONTWRITEBYTECODE", "1");
    python.env("PYTHONPATH", concat!(env!("CARGO_MANIFEST_DIR"), "/examples/python"));
    let output = python.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    drop(service);
}

/// A service on a data directory, its address and its first key.
fn started(data: &std::path::Path) -> (Service, String, String) {
    let arguments = ["serve", "--json", "--listen", "127.0.0.1:0", "--data-dir"];
    let mut service = Command::new(env!("CARGO_BIN_EXE_surefoot"));
    let service = service.args(arguments).arg(data).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut service = Service(service.spawn().expect("the binary starts"));
    let mut started = String::new();
    BufReader::new(service.0.stdout.take().expect("a pipe")).read_line(&mut started).expect("a line");
    let started: serde_json::Value = serde_json::from_str(&started).expect("JSON");
    let [address, key] =
        [&started["address"], &started["admin_key"]].map(|value| value.as_str().expect("text").to_owned());
    (service, address, key)
}

/// Ends with the test.
struct Service(Child);

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn has_mcap() -> bool {
    let found = Command::new("python3").args(["-c", "import mcap.writer, zstandard"]).output();
    let has_mcap = found.is_ok_and(|output| output.status.success());
    if !has_mcap {
        println!("skipped: python3 with the package `mcap` is not there");
    }
    has_mcap
}
