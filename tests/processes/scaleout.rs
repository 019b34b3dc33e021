//! Several processes on PostgreSQL, NATS and a bucket, each of which goes away in between.

use crate::servers::{Bucket, Nats, Postgres, holds_no_blob};
use crate::support::{App, PATIENCE, Process, Service, number, recording, surefoot};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The servers, and the settings that lead to them.
struct Installation {
    folder: TempDir,
    postgres: Postgres,
    nats: Nats,
    _bucket: Option<Bucket>,
    settings: Vec<(String, String)>,
}

impl Installation {
    fn start() -> Option<Self> {
        let Some(postgres) = Postgres::start() else {
            println!("skipped: PostgreSQL is not installed, or may not be started here");
            return None;
        };
        let Some(nats) = Nats::start() else {
            println!("skipped: nats-server is not installed");
            return None;
        };
        let bucket = Bucket::start();
        if bucket.is_none() {
            println!("without an S3 store: Python has no `moto` with its server; blobs are in a shared folder");
        }
        let mut settings =
            vec![("SUREFOOT_DATABASE_URL".to_owned(), postgres.url()), ("SUREFOOT_NATS_URL".to_owned(), nats.url())];
        settings.extend(bucket.iter().flat_map(Bucket::settings));
        Some(Self { folder: tempfile::tempdir().unwrap(), postgres, nats, _bucket: bucket, settings })
    }

    fn data(&self) -> std::path::PathBuf {
        self.folder.path().join("data")
    }

    fn service(&self, more: &[(&str, &str)]) -> Service {
        let mut settings: Vec<(&str, &str)> =
            self.settings.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect();
        settings.push(("SUREFOOT_WORKERS", "0"));
        settings.extend(more);
        Service::start(&self.data(), &settings)
    }

    fn worker(&self, more: &[(&str, &str)]) -> Process {
        worker(&self.data(), &self.settings, more)
    }
}

fn worker(data: &Path, settings: &[(String, String)], more: &[(&str, &str)]) -> Process {
    let mut command = surefoot(&["worker", "--workers", "1", "--data-dir"]);
    command.arg(data).envs(settings.iter().cloned()).envs(more.iter().copied()).stdout(Stdio::null());
    Process(command.spawn().unwrap())
}

/// `SUREFOOT_JOBS` sets how many, `SUREFOOT_PROCESSES` how many workers.
#[tokio::test(flavor = "multi_thread")]
async fn every_job_has_one_result_whatever_goes_away_meanwhile() {
    let (n_jobs, n_workers, seed) =
        (number("SUREFOOT_JOBS", 30), number("SUREFOOT_PROCESSES", 4), number("SUREFOOT_SEED", 1));
    let is_calm = number("SUREFOOT_CALM", 0) == 1;
    let Some(mut installation) = Installation::start() else { return };
    let service = installation.service(&[]);
    let key = service.admin_key.clone().expect("the first start");
    let app = App::new(&service, &key);
    let session = app.session("P-1").await;
    let mut workers: Vec<Process> = (0..n_workers).map(|_| installation.worker(&[])).collect();

    let content = recording(2, 0);
    let begun = Instant::now();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let uploading = {
        let (app, session) = (app.clone(), session.clone());
        tokio::spawn(async move {
            for number in 0..n_jobs {
                let name = format!("upload-{number}");
                // A home app sends again what was not acknowledged.
                while !matches!(app.try_upload(&session, &name, content.clone()).await, Some((202, _))) {
                    tokio::time::sleep(Duration::from_millis(100)).await;
                }
            }
        })
    };
    if !is_calm {
        for round in 0..8 {
            tokio::time::sleep(Duration::from_millis(random.random_range(100..600))).await;
            let victim = random.random_range(0..workers.len());
            workers[victim] = installation.worker(&[]);
            match round {
                2 => tokio::task::block_in_place(|| installation.nats.crash(Duration::from_millis(500))),
                5 => tokio::task::block_in_place(|| installation.postgres.crash()),
                _ => {}
            }
        }
    }
    uploading.await.unwrap();
    let uploaded = begun.elapsed();
    app.until_all_jobs_are_over().await;
    let took = begun.elapsed();

    let jobs = app.list("/v1/jobs").await;
    assert_eq!(jobs.len() as u64, n_jobs, "jobs");
    let done = jobs.iter().filter(|job| job["state"] == "done").count() as u64;
    assert_eq!(done, n_jobs, "jobs that are done");
    let assessments = app.list("/v1/assessments").await;
    let mut recordings: Vec<&str> = assessments.iter().map(|one| one["recording_id"].as_str().unwrap()).collect();
    recordings.sort_unstable();
    recordings.dedup();
    assert_eq!((assessments.len() as u64, recordings.len() as u64), (n_jobs, n_jobs), "one result each");
    if installation.settings.iter().any(|(name, _)| name == "SUREFOOT_BLOB_URL") {
        assert!(holds_no_blob(&installation.data()), "recordings are in the bucket");
    }
    let attempts: u64 = jobs.iter().map(|job| job["attempt"].as_u64().unwrap()).sum();
    println!(
        "{n_jobs} jobs over {n_workers} workers (seed {seed}, calm {is_calm}): uploaded in {:.1} s, all done after {:.1} s \
         ({:.1} jobs/s), {attempts} attempts, 0 lost, 0 doubled",
        uploaded.as_secs_f64(),
        took.as_secs_f64(),
        n_jobs as f64 / took.as_secs_f64()
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_kills_its_workers_is_given_up_after_the_last_attempt() {
    let Some(installation) = Installation::start() else { return };
    let twice = [("SUREFOOT_MAX_ATTEMPTS", "2")];
    let service = installation.service(&twice);
    let app = App::new(&service, &service.admin_key.clone().unwrap());
    let session = app.session("P-1").await;
    let (status, answer) = app.try_upload(&session, "poison", recording(300, 0)).await.unwrap();
    assert_eq!(status, 202, "{answer:#}");
    let path = format!("/v1/jobs/{}", answer["job"]["id"].as_str().unwrap());
    for attempt in 1..=2 {
        let worker = installation.worker(&twice);
        let begun = Instant::now();
        loop {
            let job = app.get(&path).await;
            if job["state"] == "running" && job["attempt"] == attempt {
                break;
            }
            assert!(begun.elapsed() < PATIENCE, "{job:#}");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        drop(worker);
    }
    let _worker = installation.worker(&twice);
    let begun = Instant::now();
    loop {
        let job = app.get(&path).await;
        if job["state"] == "failed" {
            assert_eq!(
                (job["error"]["code"].as_str(), job["attempt"].as_u64()),
                (Some("worker_lost"), Some(2)),
                "{job:#}"
            );
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "{job:#}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(app.list("/v1/jobs?state=failed").await.len(), 1);
}
