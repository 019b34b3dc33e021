//! The service over a real socket, as `surefoot serve` starts it.

use crate::support::{samples, text};
use serde_json::{Value, json};
use std::net::SocketAddr;
use surefoot::cli::serve::{self, Running};
use surefoot::config::Config;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

/// A service in a data directory of its own, at a free port.
pub async fn start(folder: &tempfile::TempDir) -> Running {
    let listen = SocketAddr::from(([127, 0, 0, 1], 0));
    serve::start(Config { data_dir: folder.path().to_owned(), listen, ..Config::default() }).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_over_a_socket_is_worked_on_and_its_events_end() {
    let folder = tempfile::tempdir().unwrap();
    let running = start(&folder).await;
    let key = running.admin_key.clone().expect("the first start makes a key");
    let client = reqwest::Client::new();
    let address = |path: &str| format!("http://{}{path}", running.addr);
    let post = |path: &str, body: Value| {
        let request = client.post(address(path)).bearer_auth(&key).json(&body);
        async { request.send().await.unwrap().json::<Value>().await.unwrap() }
    };
    let patient = post("/v1/patients", json!({"pseudonym": "P-1"})).await;
    let consent = json!({"scope": "assessment", "text_version": "test"});
    post(&format!("/v1/patients/{}/consents", text(&patient["id"])), consent).await;
    let session = post("/v1/sessions", json!({"patient_id": patient["id"]})).await;
    let upload = client
        .post(address(&format!("/v1/sessions/{}/recordings", text(&session["id"]))))
        .bearer_auth(&key)
        .header("content-type", "application/mcap")
        .body(samples::mcap_recording());
    let answer = upload.send().await.unwrap();
    assert_eq!(answer.status(), 202);
    let job = answer.headers()["location"].to_str().unwrap().to_owned();

    // The stream ends when the job is over: no need to ask again and again.
    let events = client.get(address(&format!("{job}/events"))).bearer_auth(&key).send().await.unwrap();
    let events = events.text().await.unwrap();
    let last = events.lines().rev().find_map(|line| line.strip_prefix("data: ")).expect("an event");
    let last: Value = serde_json::from_str(last).unwrap();
    assert!(["done", "failed"].contains(&text(&last["state"])), "{last:#}");
    running.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_start_makes_no_second_admin() {
    let folder = tempfile::tempdir().unwrap();
    let first = start(&folder).await;
    assert!(first.admin_key.as_ref().is_some_and(|key| key.starts_with("surefoot_")));
    first.stop().await.unwrap();
    let second = start(&folder).await;
    assert_eq!(second.admin_key, None);
    second.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_gigabytes_are_refused_before_the_first_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let running = start(&folder).await;
    let key = running.admin_key.clone().unwrap();
    let client = reqwest::Client::new();
    let post = |path: &str, body: Value| {
        let request = client.post(format!("http://{}{path}", running.addr)).bearer_auth(&key).json(&body);
        async { request.send().await.unwrap().json::<Value>().await.unwrap() }
    };
    let patient = post("/v1/patients", json!({"pseudonym": "P-1"})).await;
    let consent = json!({"scope": "assessment", "text_version": "test"});
    post(&format!("/v1/patients/{}/consents", text(&patient["id"])), consent).await;
    let session = post("/v1/sessions", json!({"patient_id": patient["id"]})).await;

    let mut socket = tokio::net::TcpStream::connect(running.addr).await.unwrap();
    let head = format!(
        "POST /v1/sessions/{}/recordings HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {key}\r\n\
         Content-Type: application/mcap\r\nContent-Length: 2147483648\r\nExpect: 100-continue\r\n\r\n",
        text(&session["id"])
    );
    socket.write_all(head.as_bytes()).await.unwrap();
    let mut answer = vec![0; 12];
    socket.read_exact(&mut answer).await.unwrap();
    assert_eq!(String::from_utf8_lossy(&answer), "HTTP/1.1 413");
    drop(socket);
    running.stop().await.unwrap();
}
