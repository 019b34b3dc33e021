//! Several processes on PostgreSQL, NATS and a bucket, each of which goes away in between.

use crate::servers::{Bucket, Nats, Postgres, holds_no_blob};
use crate::support::{App, PATIENCE, Process, Service, number, recording, surefoot};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sqlx::{Connection, Executor, Row};
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

    fn several_workers(&self, n: u64) -> Vec<Process> {
        (0..n).map(|_| self.worker(&[])).collect()
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

/// `SUREFOOT_JOBS` sets how many, `SUREFOOT_PROCESSES` how many workers; with `SUREFOOT_CALM=1` nothing goes away.
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
    // A calm run measures how fast workers are; then all jobs wait for them.
    let mut workers = if is_calm { Vec::new() } else { installation.several_workers(n_workers) };

    let content = recording(2, 0);
    let begun = Instant::now();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut n_killed = 0;
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
        for round in 0.. {
            if round >= 8 && round % 8 == 0 && uploading.is_finished() {
                break;
            }
            // Thick and fast at first; in a long run now and then, so that it gets on.
            let pause_ms = random.random_range(if round < 8 { 100..600 } else { 1000..5000 });
            tokio::time::sleep(Duration::from_millis(pause_ms)).await;
            let victim = random.random_range(0..workers.len());
            workers[victim] = installation.worker(&[]);
            match round % 8 {
                2 => tokio::task::block_in_place(|| installation.nats.crash(Duration::from_millis(500))),
                5 => tokio::task::block_in_place(|| installation.postgres.crash()),
                _ => {}
            }
            n_killed += 1;
        }
    }
    uploading.await.unwrap();
    let uploaded = begun.elapsed();
    if is_calm {
        workers = installation.several_workers(n_workers);
    }
    app.until_all_jobs_are_over().await;
    let took = begun.elapsed();
    drop(workers);

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
        "{n_jobs} jobs over {n_workers} workers (seed {seed}): uploaded in {:.1} s, all done after {:.1} s, {n_killed} workers \
         killed, {attempts} attempts, 0 lost, 0 doubled",
        uploaded.as_secs_f64(),
        took.as_secs_f64()
    );
    if is_calm {
        println!("worked off at {:.1} jobs/s", n_jobs as f64 / (took - uploaded).as_secs_f64());
    }
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

#[tokio::test(flavor = "multi_thread")]
async fn old_processes_work_beside_new_ones_and_leave_them_what_they_do_not_understand() {
    let Some(installation) = Installation::start() else { return };
    let service = installation.service(&[]);
    let key = service.admin_key.clone().unwrap();
    let app = App::new(&service, &key);
    let session = app.session("P-1").await;
    let upload = async |name: &str| {
        let (status, answer) = app.try_upload(&session, name, recording(2, 0)).await.unwrap();
        assert_eq!(status, 202, "{answer:#}");
        answer["job"]["id"].as_str().unwrap().to_owned()
    };
    let (first, second) = (upload("first").await, upload("second").await);
    // Every connection of the service keeps this question prepared.
    let ask_often = async || {
        for _ in 0..40 {
            app.get(&format!("/v1/jobs/{second}")).await;
            app.get("/v1/jobs").await;
        }
    };
    ask_often().await;
    // What a newer version leaves behind: more columns, a migration that this one does not know, a job that it cannot read.
    let mut connection = sqlx::PgConnection::connect(&installation.postgres.url()).await.unwrap();
    for statement in [
        "ALTER TABLE jobs ADD COLUMN colour TEXT NOT NULL DEFAULT 'none'",
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'later', TRUE, decode(repeat('00', 48), 'hex'), 0)",
    ] {
        connection.execute(statement).await.unwrap();
    }
    ask_often().await;
    let set_first = async |connection: &mut sqlx::PgConnection, change: &str| {
        let statement = format!("UPDATE jobs SET {change} WHERE id = '{first}'");
        connection.execute(sqlx::AssertSqlSafe(statement)).await.unwrap();
    };
    set_first(&mut connection, "format = 9999, settings = '{\"pipeline\": \"unheard_of\"}'").await;

    let _worker = installation.worker(&[]);
    let is_done = async |app: &App, id: &str| {
        let begun = Instant::now();
        while app.get(&format!("/v1/jobs/{id}")).await["state"] != "done" {
            assert!(begun.elapsed() < PATIENCE, "{id} is stuck");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    is_done(&app, &second).await;
    let row =
        sqlx::query("SELECT state, attempt FROM jobs WHERE format = 9999").fetch_one(&mut connection).await.unwrap();
    assert_eq!((row.get::<&str, _>(0), row.get::<i64, _>(1)), ("queued", 0), "left to a newer worker");

    // A process of this version that starts again, and one that understands the job.
    drop(service);
    let service = installation.service(&[]);
    set_first(&mut connection, "format = 1, settings = (SELECT settings FROM jobs ORDER BY id DESC LIMIT 1)").await;
    is_done(&App::new(&service, &key), &first).await;
}
