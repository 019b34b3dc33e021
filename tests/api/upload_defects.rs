//! Every way in which an upload can be bad: each is refused with its own code, and nothing of it stays.

use crate::support::{Answer, TestApp, samples, text};
use axum::body::Body;
use axum::http::StatusCode;
use bytes::Bytes;
use futures::{StreamExt, stream};
use serde_json::{Value, json};
use surefoot::config::Config;

/// An upload that must be refused, and after which nothing may be stored.
async fn refused(app: &TestApp, kind: &str, body: impl Into<Body>, status: u16, code: &str) -> Value {
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let answer = app.post(&path).body(kind, body).send().await;
    nothing_stays(app, &path, &answer, status, code).await
}

async fn nothing_stays(app: &TestApp, path: &str, answer: &Answer, status: u16, code: &str) -> Value {
    let problem = answer.refused(status, code);
    let list = app.get(path).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"], json!([]), "{code}: a row stayed");
    assert_eq!(app.stored_uploads().await, 0, "{code}: a file stayed");
    problem
}

/// The sound JSON recording, changed at one place.
fn changed(change: impl FnOnce(&mut Value)) -> String {
    let mut document: Value = serde_json::from_slice(&samples::json_recording()).unwrap();
    change(&mut document);
    document.to_string()
}

#[tokio::test]
async fn a_truncated_mcap_is_refused() {
    let app = TestApp::new().await;
    let bytes = samples::mcap_recording();
    refused(&app, "application/mcap", bytes[..bytes.len() / 2].to_vec(), 422, "truncated").await;
}

#[tokio::test]
async fn a_flipped_bit_in_a_chunk_is_refused_with_its_place() {
    let app = TestApp::new().await;
    let mut bytes = samples::mcap_recording();
    let middle = bytes.len() / 3;
    bytes[middle] ^= 0x10;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let answer = app.post(&path).body("application/mcap", bytes).send().await;
    let code = text(&answer.json()["code"]).to_owned();
    let problem = nothing_stays(&app, &path, &answer, 422, &code).await;
    assert!(["checksum_mismatch", "invalid_mcap", "decompression_failed"].contains(&code.as_str()), "{problem:#}");
    assert!(problem["errors"][0]["path"].is_string(), "{problem:#}");
}

#[tokio::test]
async fn an_mcap_of_another_profile_is_refused() {
    let app = TestApp::new().await;
    let mut writer = mcap::WriteOptions::new().profile("ros2").create(std::io::Cursor::new(Vec::new())).unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    refused(&app, "application/mcap", bytes, 422, "wrong_profile").await;
}

#[tokio::test]
async fn bytes_of_no_known_format_are_refused() {
    let app = TestApp::new().await;
    refused(&app, "application/octet-stream", "PK\u{3}\u{4} this is an archive", 422, "unknown_format").await;
}

#[tokio::test]
async fn an_empty_body_is_refused() {
    let app = TestApp::new().await;
    refused(&app, "application/octet-stream", "", 422, "unknown_format").await;
}

#[tokio::test]
async fn an_unknown_joint_is_refused_by_its_path() {
    let app = TestApp::new().await;
    let body = changed(|document| document["joints"][3] = json!("left_tail"));
    let problem = refused(&app, "application/json", body, 422, "unknown_joint").await;
    assert!(text(&problem["errors"][0]["path"]).starts_with("joints"), "{problem:#}");
    assert!(text(&problem["detail"]).contains("left_tail"));
}

#[tokio::test]
async fn a_number_that_is_not_one_is_refused_by_its_path() {
    let app = TestApp::new().await;
    let body = changed(|document| document["frames"][2]["positions"][0][1] = json!(987.25)).replace("987.25", "NaN");
    let problem = refused(&app, "application/json", body, 422, "not_finite").await;
    assert!(text(&problem["errors"][0]["path"]).starts_with("frames[2]"), "{problem:#}");
}

#[tokio::test]
async fn times_that_go_back_or_repeat_are_refused_by_frame() {
    for time in [json!(0), json!(2 * samples::FRAME_NS)] {
        let app = TestApp::new().await;
        let body = changed(|document| document["frames"][3]["time_ns"] = time);
        let problem = refused(&app, "application/json", body, 422, "time_not_increasing").await;
        assert!(text(&problem["errors"][0]["path"]).starts_with("frames[3]"), "{problem:#}");
    }
}

#[tokio::test]
async fn a_recording_without_frames_or_with_one_is_refused() {
    let app = TestApp::new().await;
    let body = changed(|document| document["frames"] = json!([]));
    refused(&app, "application/json", body, 422, "empty_recording").await;
    let app = TestApp::new().await;
    let body = changed(|document| document["frames"].as_array_mut().unwrap().truncate(1));
    refused(&app, "application/json", body, 422, "too_few_frames").await;
}

#[tokio::test]
async fn a_wrong_version_is_refused() {
    let app = TestApp::new().await;
    let body = changed(|document| document["version"] = json!(2));
    refused(&app, "application/json", body, 422, "unsupported_version").await;
}

#[tokio::test]
async fn a_deeply_nested_document_is_refused_without_a_crash() {
    let app = TestApp::new().await;
    let bomb = format!("{{\"frames\": {}", "[".repeat(1 << 20));
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let answer = app.post(&path).body("application/json", bomb).send().await;
    assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY);
    let code = text(&answer.json()["code"]).to_owned();
    nothing_stays(&app, &path, &answer, 422, &code).await;
}

#[tokio::test]
async fn a_digest_of_other_bytes_is_refused() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let upload = app.post(&path).header("x-content-sha256", &"0".repeat(64));
    let answer = upload.body("application/json", samples::json_recording()).send().await;
    nothing_stays(&app, &path, &answer, 422, "digest_mismatch").await;
}

#[tokio::test]
async fn headers_that_cannot_be_read_are_refused_before_the_body() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    for (name, value) in [("content-digest", "sha-256=AAAA"), ("x-content-sha256", "abc"), ("idempotency-key", "a b")] {
        let upload = app.post(&path).header(name, value).body("application/json", samples::json_recording());
        let problem = upload.send().await.refused(400, "invalid_request");
        assert_eq!(text(&problem["errors"][0]["path"]).to_lowercase(), name);
    }
    refused_kind(&app, &path).await;
}

async fn refused_kind(app: &TestApp, path: &str) {
    let upload = app.post(path).body("text/csv", samples::json_recording());
    upload.send().await.refused(415, "unsupported_media_type");
}

#[tokio::test]
async fn an_announced_length_beyond_the_limit_is_refused_before_any_byte() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    // A body that panics when it is looked at.
    let untouched =
        stream::poll_fn(|_| -> std::task::Poll<Option<Result<Bytes, std::io::Error>>> { panic!("the body was read") });
    let upload = app.post(&path).header("content-length", "2147483648");
    let answer = upload.body("application/mcap", Body::from_stream(untouched)).send().await;
    nothing_stays(&app, &path, &answer, 413, "too_large").await;
}

#[tokio::test]
async fn a_body_that_grows_beyond_the_limit_is_refused_while_it_arrives() {
    let config = Config { max_json_recording_bytes: 64 << 10, ..Config::default() };
    let app = TestApp::with_config(config).await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let chunks = stream::iter((0..64).map(|_| Ok::<_, std::io::Error>(Bytes::from(vec![b' '; 4096]))));
    let head = stream::iter([Ok(Bytes::from_static(b"{\"format\":"))]);
    let answer = app.post(&path).body("application/json", Body::from_stream(head.chain(chunks))).send().await;
    nothing_stays(&app, &path, &answer, 413, "too_large").await;
}

#[tokio::test]
async fn a_connection_that_breaks_leaves_nothing() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let bytes = samples::mcap_recording();
    let half = Bytes::from(bytes[..bytes.len() / 2].to_vec());
    let broken = stream::iter([Ok(half), Err(std::io::Error::other("the line went dead"))]);
    let answer = app.post(&path).body("application/mcap", Body::from_stream(broken)).send().await;
    nothing_stays(&app, &path, &answer, 400, "incomplete_body").await;
}

#[tokio::test]
async fn a_client_that_goes_away_leaves_nothing() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let bytes = samples::mcap_recording();
    let half = stream::iter([Ok::<_, std::io::Error>(Bytes::from(bytes[..bytes.len() / 2].to_vec()))]);
    let stalled = Body::from_stream(half.chain(stream::pending()));
    {
        let upload = app.post(&path).body("application/mcap", stalled).open();
        let mut upload = std::pin::pin!(upload);
        // Driven until the part file is there, then dropped as the server drops it when the connection closes.
        while app.stored_uploads().await == 0 {
            assert!(futures::poll!(&mut upload).is_pending());
            tokio::task::yield_now().await;
        }
    }
    while app.stored_uploads().await > 0 {
        tokio::task::yield_now().await;
    }
    let list = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"], json!([]));
}
