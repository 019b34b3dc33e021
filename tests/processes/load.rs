//! A queue under load: reads are answered while sessions are worked off, and memory stays where it is. The numbers are printed.
//!
//! ```sh
//! SUREFOOT_SESSIONS=1000 cargo test --release --test processes load -- --nocapture
//! SUREFOOT_SOAK_S=3600 cargo test --release --test processes load -- --nocapture    # uploads for an hour
//! ```

use crate::support::{App, Service, number, recording};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Uploads at the same time.
const UPLOADERS: u64 = 4;
/// Time between two looks at the memory.
const LOOK: Duration = Duration::from_secs(10);

#[tokio::test(flavor = "multi_thread")]
async fn reads_are_answered_while_a_queue_is_worked_off() {
    let (sessions, soak_s) = (number("SUREFOOT_SESSIONS", 12), number("SUREFOOT_SOAK_S", 0));
    let folder = tempfile::tempdir().expect("a folder");
    let settings = [("SUREFOOT_WORKERS", "2")];
    let service = Service::start(&folder.path().join("data"), &settings);
    let app = App::new(&service, service.admin_key.as_ref().expect("the first start"));
    let session = app.session("P-1").await;
    let process = service.process.0.id();

    let is_over = Arc::new(AtomicBool::new(false));
    let memory = tokio::spawn(watch_memory(process, is_over.clone()));
    let begun = Instant::now();
    let uploaders: Vec<_> = (0..UPLOADERS)
        .map(|uploader| {
            let (app, session) = (app.clone(), session.clone());
            tokio::spawn(async move {
                let mut sent = 0;
                while sent * UPLOADERS + uploader < sessions || begun.elapsed().as_secs() < soak_s {
                    let number = sent * UPLOADERS + uploader;
                    let content = recording(10, (number % 100) as usize);
                    match app.try_upload(&session, &format!("upload-{number}"), content).await {
                        Some((202, _)) => sent += 1,
                        // Told to come again: too many wait.
                        _ => tokio::time::sleep(Duration::from_secs(1)).await,
                    }
                    if soak_s > 0 {
                        tokio::time::sleep(Duration::from_millis(400)).await;
                    }
                }
                sent
            })
        })
        .collect();
    let reading = tokio::spawn(read_until(app.clone(), is_over.clone()));
    let mut uploaded = 0;
    for uploader in uploaders {
        uploaded += uploader.await.expect("an uploader");
    }
    let sent_s = begun.elapsed().as_secs_f64();
    app.until_all_jobs_are_over().await;
    let done_s = begun.elapsed().as_secs_f64();
    is_over.store(true, Ordering::Relaxed);
    let mut reads = reading.await.expect("reads");
    let curve = memory.await.expect("memory");
    reads.sort_unstable();
    let at = |share: f64| reads[((reads.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    println!(
        "{uploaded} sessions uploaded in {sent_s:.1} s, all worked off after {done_s:.1} s ({:.1} a second)",
        uploaded as f64 / done_s
    );
    println!(
        "{} reads meanwhile: p50 {:.1} ms, p95 {:.1} ms, p99 {:.1} ms, longest {:.1} ms",
        reads.len(),
        at(0.5),
        at(0.95),
        at(0.99),
        at(1.0)
    );
    println!("memory of the server, MB, every {} s: {curve:?}", LOOK.as_secs());
}

/// Reads of several kinds, one after another, as a page and an app do.
async fn read_until(app: App, is_over: Arc<AtomicBool>) -> Vec<Duration> {
    let mut took = Vec::new();
    while !is_over.load(Ordering::Relaxed) {
        let mut paths = vec!["/v1/patients?limit=20".to_owned(), "/v1/jobs?limit=20".to_owned()];
        if let Some(one) = app.get("/v1/assessments?limit=1").await["items"].get(0) {
            let id = one["id"].as_str().expect("an id");
            paths.extend([format!("/v1/assessments/{id}"), format!("/v1/assessments/{id}/series?max_points=500")]);
        }
        for path in paths {
            let begun = Instant::now();
            app.get_bytes(&path).await;
            took.push(begun.elapsed());
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
    took
}

/// Resident memory from time to time, megabytes.
async fn watch_memory(process: u32, is_over: Arc<AtomicBool>) -> Vec<u64> {
    let mut curve = Vec::new();
    while !is_over.load(Ordering::Relaxed) {
        let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes = line.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok());
        curve.extend(kilobytes.map(|kb| kb / 1024));
        let next = Instant::now() + LOOK;
        while Instant::now() < next && !is_over.load(Ordering::Relaxed) {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }
    curve
}
