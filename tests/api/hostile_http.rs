//! Requests that are written to be read in two ways: two lengths, two ends, addresses that climb. Over a real socket.

use crate::serving::start;
use std::time::Duration;
use surefoot::cli::serve::Running;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// Everything that comes back until the service closes or falls silent.
async fn answers(running: &Running, bytes: &[u8]) -> String {
    let mut socket = TcpStream::connect(running.addr).await.unwrap();
    let mut all = Vec::new();
    // The service may close before the last byte.
    let _ = socket.write_all(bytes).await;
    let mut piece = [0; 4096];
    while let Ok(Ok(n @ 1..)) = tokio::time::timeout(Duration::from_millis(700), socket.read(&mut piece)).await {
        all.extend_from_slice(&piece[..n]);
    }
    String::from_utf8_lossy(&all).into_owned()
}

fn statuses(answers: &str) -> Vec<&str> {
    answers.split("HTTP/1.1 ").skip(1).map(|answer| &answer[..3]).collect()
}

/// What would be slipped in: it would make a patient.
fn slipped_in(key: &str) -> String {
    let body = r#"{"pseudonym": "SLIPPED-IN"}"#;
    format!(
        "POST /v1/patients HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {key}\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_with_two_lengths_is_refused_and_nothing_is_slipped_in_behind_it() {
    let folder = tempfile::tempdir().unwrap();
    let running = start(&folder).await;
    let key = running.admin_key.clone().unwrap();
    let inner = slipped_in(&key);
    let head = format!(
        "POST /v1/patients HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {key}\r\nContent-Type: application/json\r\n"
    );
    let n = inner.len();
    for (name, framing) in [
        ("two lengths", format!("Content-Length: 2\r\nContent-Length: {n}\r\n\r\n{{}}{inner}")),
        ("a list of lengths", format!("Content-Length: 2, {n}\r\n\r\n{{}}{inner}")),
        ("a signed length", format!("Content-Length: +2\r\n\r\n{{}}{inner}")),
        ("a folded length", format!("Content-Length:\r\n 2\r\n\r\n{{}}{inner}")),
        ("a space before the colon", format!("Content-Length : 2\r\n\r\n{{}}{inner}")),
        ("another last encoding", format!("Transfer-Encoding: chunked, identity\r\n\r\n0\r\n\r\n{inner}")),
        ("an unknown encoding", format!("Transfer-Encoding: xchunked\r\n\r\n0\r\n\r\n{inner}")),
        ("a chunk of no number", format!("Transfer-Encoding: chunked\r\n\r\n0x2\r\n{{}}\r\n0\r\n\r\n{inner}")),
    ] {
        let answer = answers(&running, format!("{head}{framing}").as_bytes()).await;
        let made = statuses(&answer).iter().filter(|status| **status == "201").count();
        assert_eq!(made, 0, "{name}: {answer}");
        assert!(statuses(&answer).len() <= 1, "{name} was read as two requests: {answer}");
    }
    let client = reqwest::Client::new();
    let patients = client.get(format!("http://{}/v1/patients", running.addr)).bearer_auth(&key).send().await.unwrap();
    assert!(!patients.text().await.unwrap().contains("SLIPPED-IN"));
    // Of a length and chunks the chunks count (RFC 9112, section 6.3), and what follows them is a request of its own or none.
    let both = format!("{head}Content-Length: {}\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n{inner}", 5 + n);
    let answer = answers(&running, both.as_bytes()).await;
    assert_ne!(statuses(&answer).first(), Some(&"201"), "{answer}");
    running.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_address_that_climbs_leads_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let running = start(&folder).await;
    let key = running.admin_key.clone().unwrap();
    for path in [
        "/app/assets/../../../etc/passwd",
        "/app/assets/..%2f..%2fsurefoot.sqlite",
        "/app/assets/%2e%2e/%2e%2e/surefoot.sqlite",
        "/app/assets/surefoot.sqlite",
        "/app/assets//etc/passwd",
        "/v1/../metrics",
        "/v1/recordings/../patients",
        "/v1/recordings/..%2f..%2fsurefoot.sqlite/content",
        "/v1/patients/%00",
        "/v1/patients/%ff%fe",
        "/v1/uploads/..%2f..%2fsurefoot.sqlite",
    ] {
        let request =
            format!("GET {path} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {key}\r\nConnection: close\r\n\r\n");
        let answer = answers(&running, request.as_bytes()).await;
        assert!(["400", "404", "303"].contains(&statuses(&answer)[0]), "{path}: {answer}");
        assert!(!answer.contains("SQLite format") && !answer.contains("root:"), "{path}: {answer}");
    }
    running.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_head_without_end_is_refused_before_it_fills_memory() {
    let folder = tempfile::tempdir().unwrap();
    let running = start(&folder).await;
    let long = format!("GET /v1/patients HTTP/1.1\r\nHost: x\r\nX-Long: {}\r\n\r\n", "a".repeat(4 << 20));
    let many = format!("GET /v1/patients HTTP/1.1\r\nHost: x\r\n{}\r\n", "X-Many: 1\r\n".repeat(10_000));
    for head in [long, many] {
        let answer = answers(&running, head.as_bytes()).await;
        assert!(answer.is_empty() || statuses(&answer)[0] == "431", "{answer}");
    }
    running.stop().await.unwrap();
}
