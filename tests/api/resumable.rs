//! Uploads that go on where they broke off.

use crate::support::{Answer, Call, TestApp, samples, text};
use axum::body::Body;
use axum::http::{Method, StatusCode};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;
use futures::stream;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use surefoot::api::AppState;
use surefoot::api::upload::resumable::look_after;
use surefoot::cli::serve::recording_limits;
use surefoot::config::Config;
use surefoot::queue::{Queue, QueueSettings};
use surefoot::storage::{ManualClock, Places, Role, Store};
use time::Duration;
use time::macros::datetime;

const OFFSET_STREAM: &str = "application/offset+octet-stream";

/// A call that speaks tus.
fn tus<'a>(app: &'a TestApp, method: Method, path: &str) -> Call<'a> {
    app.request(method, path).header("tus-resumable", "1.0.0")
}

fn metadata(pairs: &[(&str, &str)]) -> String {
    let pairs: Vec<String> = pairs.iter().map(|(key, value)| format!("{key} {}", STANDARD.encode(value))).collect();
    pairs.join(",")
}

async fn begin(app: &TestApp, session: &str, length: usize, said: &[(&str, &str)]) -> Answer {
    let call = tus(app, Method::POST, &format!("/v1/sessions/{session}/uploads"));
    call.header("upload-length", &length.to_string()).header("upload-metadata", &metadata(said)).send().await
}

/// Address of a new upload.
async fn begun(app: &TestApp, length: usize, said: &[(&str, &str)]) -> String {
    let answer = begin(app, &app.session().await, length, said).await;
    answer.expect(StatusCode::CREATED);
    answer.header("location").to_owned()
}

fn patch<'a>(app: &'a TestApp, upload: &str, offset: usize, body: impl Into<Body>) -> Call<'a> {
    tus(app, Method::PATCH, upload).header("upload-offset", &offset.to_string()).body(OFFSET_STREAM, body)
}

async fn offset(app: &TestApp, upload: &str) -> String {
    let answer = tus(app, Method::HEAD, upload).send().await;
    answer.expect(StatusCode::OK);
    answer.header("upload-offset").to_owned()
}

async fn read(app: &TestApp, upload: &str) -> Value {
    app.get(upload).send().await.expect(StatusCode::OK)
}

/// How many recordings there are in the session of an upload.
async fn n_recordings(app: &TestApp, upload: &str) -> usize {
    let session = text(&read(app, upload).await["session_id"]).to_owned();
    let list = app.get(&format!("/v1/sessions/{session}/recordings")).send().await.expect(StatusCode::OK);
    list["items"].as_array().unwrap().len()
}

fn files(app: &TestApp) -> usize {
    std::fs::read_dir(app.folder.path().join("resumable")).map_or(0, Iterator::count)
}

#[tokio::test]
async fn an_upload_in_pieces_becomes_one_recording_that_is_assessed() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    let digest = hex::encode(Sha256::digest(&bytes));
    let said = [("filetype", "application/mcap"), ("filename", "squats.mcap"), ("sha256", digest.as_str())];
    let session = app.session().await;
    let answer = begin(&app, &session, bytes.len(), &said).await;
    let made = answer.expect(StatusCode::CREATED);
    assert_eq!((text(&made["state"]), &made["received_bytes"]), ("receiving", &json!(0)));
    assert_eq!(answer.header("tus-resumable"), "1.0.0");
    assert!(answer.header("upload-expires").ends_with(" GMT"), "{}", answer.header("upload-expires"));
    let upload = answer.header("location").to_owned();

    let cut = [0, 1, bytes.len() / 3, bytes.len() - 1, bytes.len()];
    for piece in cut.windows(2) {
        assert_eq!(offset(&app, &upload).await, piece[0].to_string());
        let answer = patch(&app, &upload, piece[0], bytes[piece[0]..piece[1]].to_vec()).send().await;
        assert_eq!(answer.status, StatusCode::NO_CONTENT, "{:?}", answer.body);
        assert_eq!(answer.header("upload-offset"), piece[1].to_string());
    }
    let stored = read(&app, &upload).await;
    assert_eq!(text(&stored["state"]), "stored", "{stored:#}");
    let recording = format!("/v1/recordings/{}", text(&stored["recording_id"]));
    let row = app.get(&recording).send().await.expect(StatusCode::OK);
    assert_eq!((text(&row["sha256"]), text(&row["session_id"])), (digest.as_str(), session.as_str()));
    let content = app.get(&format!("{recording}/content")).send().await;
    assert_eq!(content.body, bytes);
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&stored["job_id"]))).send().await.expect(StatusCode::OK);
    assert_eq!(job["state"], "done", "{job:#}");
    assert_eq!(files(&app), 0, "the file became the blob");
    assert_eq!(offset(&app, &upload).await, bytes.len().to_string());
}

#[tokio::test]
async fn what_came_through_before_a_connection_broke_stays() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    let upload = begun(&app, bytes.len(), &[]).await;
    let (first, second) = (Bytes::copy_from_slice(&bytes[..700]), Bytes::copy_from_slice(&bytes[700..1234]));
    let broken = [Ok(first), Ok(second), Err(std::io::Error::from(std::io::ErrorKind::ConnectionReset))];
    let answer = patch(&app, &upload, 0, Body::from_stream(stream::iter(broken))).send().await;
    answer.refused(400, "incomplete_body");
    assert_eq!(offset(&app, &upload).await, "1234");
    let short = patch(&app, &upload, 1234, bytes[1234..2000].to_vec()).header("content-length", "900").send().await;
    short.refused(400, "incomplete_body");
    let rest = patch(&app, &upload, 2000, bytes[2000..].to_vec()).send().await;
    assert_eq!(rest.status, StatusCode::NO_CONTENT);
    assert_eq!(text(&read(&app, &upload).await["state"]), "stored");
}

#[tokio::test]
async fn a_wrong_offset_is_refused_and_adds_nothing() {
    let app = TestApp::new().await;
    let upload = begun(&app, 100, &[]).await;
    patch(&app, &upload, 0, "0123456789").send().await.expect(StatusCode::NO_CONTENT);
    for wrong in [0, 9, 11, 100, 1000] {
        patch(&app, &upload, wrong, "abc").send().await.refused(409, "offset_mismatch");
    }
    patch(&app, &upload, 10, vec![0; 91]).send().await.refused(413, "too_large");
    let chunked = stream::iter([Ok::<_, std::io::Error>(Bytes::from(vec![0; 80])), Ok(Bytes::from(vec![0; 11]))]);
    patch(&app, &upload, 10, Body::from_stream(chunked)).send().await.refused(413, "too_large");
    let read = read(&app, &upload).await;
    assert_eq!(text(&read["state"]), "receiving");
}

#[tokio::test]
async fn other_organisations_and_other_devices_see_no_upload() {
    let app = TestApp::new().await;
    let upload = begun(&app, 100, &[]).await;
    for key in [app.stranger().await, app.key(Role::Device).await] {
        app.get(&upload).key(&key).send().await.refused(404, "not_found");
        patch(&app, &upload, 0, "abc").key(&key).send().await.refused(404, "not_found");
        tus(&app, Method::DELETE, &upload).key(&key).send().await.refused(404, "not_found");
        let head = tus(&app, Method::HEAD, &upload).key(&key).open().await;
        assert_eq!(head.status(), StatusCode::NOT_FOUND);
    }
    let session = app.session_of("P-2").await;
    let stranger = app.stranger_of("beyond").await;
    let call = tus(&app, Method::POST, &format!("/v1/sessions/{session}/uploads")).key(&stranger);
    call.header("upload-length", "10").send().await.refused(404, "not_found");
    assert_eq!(offset(&app, &upload).await, "0");
}

#[tokio::test]
async fn a_request_with_a_checksum_is_kept_whole_or_not_at_all() {
    let app = TestApp::new().await;
    let upload = begun(&app, 100, &[]).await;
    let sum = |bytes: &[u8]| format!("sha256 {}", STANDARD.encode(Sha256::digest(bytes)));
    let with =
        |offset, body: &'static str, sum: &str| patch(&app, &upload, offset, body).header("upload-checksum", sum);
    with(0, "hello", &sum(b"hullo"))
        .header("content-length", "5")
        .send()
        .await
        .refused(460, "upload_checksum_mismatch");
    with(0, "hello", &sum(b"hullo")).send().await.refused(460, "upload_checksum_mismatch");
    assert_eq!(offset(&app, &upload).await, "0");
    with(0, "hello", &sum(b"hello")).header("content-length", "5").send().await.expect(StatusCode::NO_CONTENT);
    with(5, " there", &sum(b" there")).send().await.expect(StatusCode::NO_CONTENT);
    with(11, "x", "crc99 AAAA").send().await.refused(400, "invalid_request");
    let broken = [Ok(Bytes::from_static(b"abc")), Err(std::io::Error::from(std::io::ErrorKind::ConnectionReset))];
    let broken = patch(&app, &upload, 11, Body::from_stream(stream::iter(broken))).header("content-length", "5");
    broken.header("upload-checksum", &sum(b"abcde")).send().await.refused(400, "incomplete_body");
    assert_eq!(offset(&app, &upload).await, "11");
}

#[tokio::test]
async fn another_digest_at_the_end_is_refused_and_stays_refused() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    let upload = begun(&app, bytes.len(), &[("sha256", &"0".repeat(64))]).await;
    let first = patch(&app, &upload, 0, bytes.clone()).send().await;
    let told = first.refused(422, "digest_mismatch");
    let read = read(&app, &upload).await;
    assert_eq!((text(&read["state"]), &read["problem"]["detail"]), ("refused", &told["detail"]));
    patch(&app, &upload, bytes.len(), "").send().await.refused(422, "digest_mismatch");
    let head = tus(&app, Method::HEAD, &upload).open().await;
    assert_eq!(head.status(), StatusCode::UNPROCESSABLE_ENTITY);
    assert_eq!((files(&app), app.stored_uploads().await), (0, 0), "a file stayed");
    assert_eq!(n_recordings(&app, &upload).await, 0);
}

#[tokio::test]
async fn a_defect_is_told_with_its_code_and_place() {
    let app = TestApp::new().await;
    let mut document: Value = serde_json::from_slice(&samples::json_recording()).unwrap();
    document["joints"][3] = json!("left_tail");
    let bytes = document.to_string().into_bytes();
    let upload = begun(&app, bytes.len(), &[("filetype", "application/json")]).await;
    let problem = patch(&app, &upload, 0, bytes).send().await.refused(422, "unknown_joint");
    assert!(text(&problem["errors"][0]["path"]).starts_with("joints"), "{problem:#}");
    assert_eq!(text(&read(&app, &upload).await["problem"]["code"]), "unknown_joint");

    let archive = "PK\u{3}\u{4} this is an archive";
    let upload = begin(&app, &app.session_of("P-2").await, archive.len(), &[]).await;
    patch(&app, upload.header("location"), 0, archive).send().await.refused(422, "not_a_recording");
}

#[tokio::test]
async fn whoever_missed_the_answer_to_the_last_byte_asks_again() {
    let app = TestApp::new().await;
    let bytes = samples::json_recording();
    let upload = begun(&app, bytes.len(), &[]).await;
    patch(&app, &upload, 0, bytes.clone()).send().await.expect(StatusCode::NO_CONTENT);
    for _ in 0..3 {
        patch(&app, &upload, bytes.len(), "").send().await.expect(StatusCode::NO_CONTENT);
        look_after(&app.state).await.unwrap();
    }
    patch(&app, &upload, 0, bytes).send().await.refused(409, "offset_mismatch");
    assert_eq!(n_recordings(&app, &upload).await, 1);
}

#[tokio::test]
async fn an_upload_whose_service_died_after_the_last_byte_is_finished() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    let upload = begun(&app, bytes.len(), &[]).await;
    patch(&app, &upload, 0, bytes[..50].to_vec()).send().await.expect(StatusCode::NO_CONTENT);
    // As a process leaves it that dies with all bytes on the disk, before any row says so.
    let id = upload.rsplit('/').next().unwrap();
    std::fs::write(app.folder.path().join("resumable").join(id), &bytes).unwrap();
    let before = read(&app, &upload).await;
    assert_eq!((text(&before["state"]), &before["received_bytes"]), ("receiving", &before["length_bytes"]));
    look_after(&app.state).await.unwrap();
    look_after(&app.state).await.unwrap();
    assert_eq!(text(&read(&app, &upload).await["state"]), "stored");
    assert_eq!(n_recordings(&app, &upload).await, 1);
    assert_eq!(files(&app), 0);
}

#[tokio::test]
async fn two_who_bring_the_last_bytes_at_once_make_one_recording() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    let upload = begun(&app, bytes.len(), &[]).await;
    let bring = || patch(&app, &upload, 0, bytes.clone()).send();
    let answers = futures::join!(bring(), bring(), bring());
    let status = [&answers.0, &answers.1, &answers.2].map(|answer| answer.status.as_u16());
    assert!(status.contains(&204) && status.iter().all(|status| [204, 409].contains(status)), "{answers:?}");
    assert_eq!(n_recordings(&app, &upload).await, 1);
}

#[tokio::test]
async fn whoever_asks_while_the_recording_is_looked_at_waits_and_is_told_its_end() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    let upload = begun(&app, bytes.len(), &[]).await;
    patch(&app, &upload, 0, bytes[..100].to_vec()).send().await.expect(StatusCode::NO_CONTENT);
    let last = patch(&app, &upload, 100, bytes[100..].to_vec()).send();
    let heads = async {
        let mut offsets = Vec::new();
        while offsets.last().is_none_or(|last: &String| *last != bytes.len().to_string()) {
            offsets.push(offset(&app, &upload).await);
        }
        offset(&app, &upload).await
    };
    let (last, end) = futures::join!(last, heads);
    assert_eq!((last.status, end), (StatusCode::NO_CONTENT, bytes.len().to_string()));
}

#[tokio::test]
async fn an_upload_that_is_given_up_leaves_nothing() {
    let app = TestApp::new().await;
    let upload = begun(&app, 100, &[]).await;
    patch(&app, &upload, 0, "0123456789").send().await.expect(StatusCode::NO_CONTENT);
    assert_eq!(files(&app), 1);
    tus(&app, Method::DELETE, &upload).send().await.expect(StatusCode::NO_CONTENT);
    app.get(&upload).send().await.refused(404, "not_found");
    patch(&app, &upload, 10, "abc").send().await.refused(404, "not_found");
    assert_eq!(files(&app), 0);
}

#[tokio::test]
async fn half_an_upload_expires_a_day_after_its_last_byte() {
    let clock = ManualClock::at(datetime!(2026-11-22 08:00 UTC));
    let mut app = TestApp::new().await;
    let store = Store::open_at(&Places::in_directory(app.folder.path()), Arc::new(clock.clone())).await.unwrap();
    let config = Config { data_dir: app.folder.path().to_owned(), ..Config::default() };
    let queue = Queue::new(store, QueueSettings::from(&config));
    let limits = recording_limits(&config);
    app.use_state(AppState::new(queue, config, limits).unwrap());

    let upload = begun(&app, 100, &[]).await;
    clock.advance(Duration::hours(23));
    patch(&app, &upload, 0, "0123456789").send().await.expect(StatusCode::NO_CONTENT);
    clock.advance(Duration::hours(23));
    look_after(&app.state).await.unwrap();
    assert_eq!(offset(&app, &upload).await, "10");
    clock.advance(Duration::hours(1));
    // Before a round has looked after it, and after.
    for _ in 0..2 {
        app.get(&upload).send().await.refused(410, "upload_expired");
        patch(&app, &upload, 10, "abc").send().await.refused(410, "upload_expired");
        assert_eq!(tus(&app, Method::HEAD, &upload).open().await.status(), StatusCode::GONE);
        look_after(&app.state).await.unwrap();
        assert_eq!(files(&app), 0);
    }
    clock.advance(Duration::days(31));
    look_after(&app.state).await.unwrap();
    app.get(&upload).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn what_cannot_be_received_is_refused_before_its_bytes() {
    let app = TestApp::with_config(Config { max_recording_bytes: 1000, ..Config::default() }).await;
    let session = app.session().await;
    let path = format!("/v1/sessions/{session}/uploads");
    begin(&app, &session, 1001, &[]).await.refused(413, "too_large");
    begin(&app, &session, 10, &[("filetype", "image/png")]).await.refused(415, "unsupported_media_type");
    begin(&app, &session, 10, &[("sha256", "abc")]).await.refused(400, "invalid_request");
    begin(&app, &session, 0, &[]).await.refused(400, "invalid_request");
    tus(&app, Method::POST, &path).send().await.refused(400, "invalid_request");
    tus(&app, Method::POST, &path).header("upload-defer-length", "1").send().await.refused(400, "invalid_request");
    let without = app.post(&path).header("upload-length", "10").send().await;
    without.refused(412, "tus_version");
    assert_eq!(without.header("tus-version"), "1.0.0");
    let upload = begin(&app, &session, 10, &[]).await.header("location").to_owned();
    let kind = tus(&app, Method::PATCH, &upload).header("upload-offset", "0").body("application/mcap", "abc");
    kind.send().await.refused(415, "unsupported_media_type");
    let no_offset = tus(&app, Method::PATCH, &upload).body(OFFSET_STREAM, "abc").send().await;
    no_offset.refused(400, "invalid_request");
    assert_eq!(files(&app), 1);
}

#[tokio::test]
async fn a_queue_without_room_takes_no_new_upload_and_finishes_those_under_way() {
    let app = TestApp::with_config(Config { max_waiting_jobs_of_organisation: 1, ..Config::default() }).await;
    let bytes = samples::json_recording();
    let session = app.session().await;
    let upload = begin(&app, &session, bytes.len(), &[]).await.header("location").to_owned();
    let direct = app.post(&format!("/v1/sessions/{session}/recordings"));
    direct.body("application/json", samples::json_recording()).send().await.expect(StatusCode::ACCEPTED);
    begin(&app, &session, bytes.len(), &[]).await.refused(429, "too_many_waiting_jobs");
    patch(&app, &upload, 0, bytes).send().await.expect(StatusCode::NO_CONTENT);
    assert_eq!(text(&read(&app, &upload).await["state"]), "stored");
}

#[tokio::test]
async fn the_service_says_what_of_tus_it_speaks() {
    let app = TestApp::new().await;
    for path in ["/v1/uploads".to_owned(), format!("/v1/sessions/{}/uploads", app.session().await)] {
        let answer = app.request(Method::OPTIONS, &path).without_key().send().await;
        answer.expect(StatusCode::NO_CONTENT);
        assert_eq!(answer.header("tus-version"), "1.0.0");
        assert_eq!(answer.header("tus-extension"), "checksum,creation,expiration,termination");
        assert_eq!(answer.header("tus-checksum-algorithm"), "sha1,sha256");
        assert_eq!(answer.header("tus-max-size"), (1_u64 << 30).to_string());
    }
}
