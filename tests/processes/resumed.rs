//! Clients that are cut off at any byte and services that are killed between and within pieces: the upload goes on, and ends
//! with the very bytes that were sent.

use crate::support::{App, Service, number, recording};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::Write;
use std::net::TcpStream;
use std::time::Duration;

/// A request that breaks off: it announces all of `rest`, and its connection ends after `n` bytes of it.
fn break_off(service: &Service, key: &str, upload: &str, offset: usize, rest: &[u8], n: usize) {
    let host = service.address.strip_prefix("http://").expect("an address of HTTP");
    let Ok(mut line) = TcpStream::connect(host) else { return };
    let head = format!(
        "PATCH {upload} HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {key}\r\nTus-Resumable: 1.0.0\r\n\
         Upload-Offset: {offset}\r\nContent-Type: application/offset+octet-stream\r\nContent-Length: {}\r\n\r\n",
        rest.len()
    );
    // The service may refuse and close before everything is sent.
    let _ = line.write_all(head.as_bytes()).and_then(|()| line.write_all(&rest[..n]));
}

/// `SUREFOOT_ROUNDS` sets how often at least, `SUREFOOT_SEED` where and when.
#[tokio::test(flavor = "multi_thread")]
async fn an_upload_survives_clients_and_services_that_end_at_any_byte() {
    let (rounds, seed) = (number("SUREFOOT_ROUNDS", 12), number("SUREFOOT_SEED", 1));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let content = recording(60, 0);

    let start = || Service::start(&data, &[("SUREFOOT_WORKERS", "0")]);
    let mut service = start();
    let key = service.admin_key.clone().expect("the first start");
    let session = App::new(&service, &key).session("P-1").await;
    let upload = App::new(&service, &key).begin_upload(&session, content.len(), "application/json").await;

    let (mut promised, mut kills, mut cuts) = (0, 0, 0);
    for round in 0.. {
        let app = App::new(&service, &key);
        let offset = app.upload_offset(&upload).await;
        assert!(offset >= promised, "{promised} bytes were promised, {offset} are there");
        promised = offset;
        // After enough rounds, the rest in one go.
        if round >= rounds {
            match app.continue_upload(&upload, offset, content[offset..].to_vec()).await {
                Some(204) => break,
                // A request that was cut off is still being added.
                Some(409) => tokio::time::sleep(Duration::from_millis(50)).await,
                other => panic!("{other:?}"),
            }
            continue;
        }
        let most = ((content.len() - offset) / 3).max(1);
        let n = random.random_range(0..=most);
        if random.random_bool(0.6) {
            break_off(&service, &key, &upload, offset, &content[offset..], n);
            cuts += 1;
        } else if app.continue_upload(&upload, offset, content[offset..offset + n].to_vec()).await == Some(204) {
            promised = offset + n;
        }
        if random.random_bool(0.5) {
            tokio::time::sleep(Duration::from_millis(random.random_range(0..30))).await;
            drop(service);
            kills += 1;
            service = start();
        }
    }

    let app = App::new(&service, &key);
    let stored = app.get(&upload).await;
    assert_eq!(stored["state"], "stored", "{stored:#}");
    let id = stored["recording_id"].as_str().unwrap();
    let kept = app.get_bytes(&format!("/v1/recordings/{id}/content")).await;
    assert!(kept == content, "the bytes that are stored are those that were sent");
    assert_eq!(app.list(&format!("/v1/sessions/{session}/recordings")).await.len(), 1);
    assert_eq!(app.list("/v1/jobs").await.len(), 1);
    assert_eq!(std::fs::read_dir(data.join("resumable")).unwrap().count(), 0, "the file became the blob");
    println!("{} bytes, {cuts} connections cut, {kills} services killed (seed {seed})", content.len());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_that_is_killed_while_the_last_byte_is_worked_off_stores_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let start = || Service::start(&data, &[("SUREFOOT_WORKERS", "0")]);
    let service = start();
    let key = service.admin_key.clone().expect("the first start");
    let session = App::new(&service, &key).session("P-1").await;
    drop(service);

    let mut uploads = Vec::new();
    for version in 0..6 {
        let content = recording(30, version);
        let service = start();
        let app = App::new(&service, &key);
        let upload = app.begin_upload(&session, content.len(), "application/json").await;
        break_off(&service, &key, &upload, 0, &content, content.len());
        tokio::time::sleep(Duration::from_millis(60 * version as u64)).await;
        drop(service);
        uploads.push((upload, content));
    }

    let service = start();
    let app = App::new(&service, &key);
    for (upload, content) in &uploads {
        let offset = app.upload_offset(upload).await;
        // What is complete is finished by the service itself, in its time; asking again waits for it.
        assert_eq!(app.continue_upload(upload, offset, content[offset..].to_vec()).await, Some(204));
        assert_eq!(app.get(upload).await["state"], "stored");
    }
    assert_eq!(app.list(&format!("/v1/sessions/{session}/recordings")).await.len(), uploads.len());
}
