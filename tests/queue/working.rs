//! Workers: what becomes of a job whatever its computation does.

use crate::support::{
    Bench, EAGER, assessment, computation, endless, open, plain, rows_are_elsewhere, side_door, until,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use surefoot::queue::{JobError, JobState};
use surefoot::recording::decode::Limits;
use surefoot::storage::SeriesQuery;
use surefoot::worker::{AttemptError, Ran, Worker};
use tokio_util::sync::CancellationToken;

#[tokio::test]
async fn a_job_is_run_and_its_assessment_names_the_digest_of_the_recording() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let worker = bench.worker(plain());
    assert_eq!(worker.run_next().await.unwrap(), Ran::Job(job.id));
    assert_eq!(worker.run_next().await.unwrap(), Ran::QueueEmpty);
    let seen = bench.job(job.id).await;
    assert_eq!(seen.state, JobState::Done);
    let store = bench.queue.store();
    let found = store.assessment(&bench.access, seen.assessment_id.unwrap()).await.unwrap();
    assert_eq!(found.provenance.recording_sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    assert_eq!((found.recording_id, found.session_id, found.n_samples), (job.recording_id, bench.session, 3));
}

#[tokio::test]
async fn a_panic_is_a_failed_attempt_and_the_worker_goes_on() {
    let bench = Bench::new().await;
    let bad = bench.submit(b"bad").await;
    let good = bench.submit(b"good").await;
    let worker = bench.worker(computation(|_, recording, _| {
        assert!(recording.blob.size_bytes != 3, "injected");
        Ok(assessment(b"good"))
    }));
    for _ in 0..bad.max_attempts {
        while worker.run_next().await.unwrap() != Ran::QueueEmpty {}
        bench.pass_time();
    }
    assert_eq!(bench.job(good.id).await.state, JobState::Done);
    let seen = bench.job(bad.id).await;
    assert_eq!((seen.state, seen.attempt), (JobState::Failed, bad.max_attempts));
    assert_eq!(seen.error.unwrap().code, "internal_panic");
}

#[tokio::test]
async fn a_failure_of_the_server_is_tried_again_after_growing_pauses_and_then_given_up_with_the_reason() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let tried = Arc::new(AtomicU32::new(0));
    let counted = tried.clone();
    let worker = bench.worker(computation(move |_, _, _| {
        counted.fetch_add(1, Ordering::SeqCst);
        Err(AttemptError::Failed(JobError::new("disk_full", "the disk is full")))
    }));
    for pause_s in [2, 4] {
        assert_eq!(worker.run_next().await.unwrap(), Ran::Job(job.id));
        assert_eq!(bench.job(job.id).await.state, JobState::Queued);
        bench.clock.advance(time::Duration::milliseconds(pause_s * 1000 - 1));
        assert_eq!(worker.run_next().await.unwrap(), Ran::QueueEmpty);
        bench.clock.advance(time::Duration::MILLISECOND);
    }
    worker.run_next().await.unwrap();
    bench.pass_time();
    assert_eq!(worker.run_next().await.unwrap(), Ran::QueueEmpty);
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, tried.load(Ordering::SeqCst)), (JobState::Failed, 3));
    assert_eq!(seen.error, Some(JobError::new("disk_full", "the disk is full")));
}

#[tokio::test]
async fn a_recording_that_cannot_be_assessed_fails_at_once_with_code_place_and_sentence() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let reason = JobError { place: Some("frames[17]".into()), ..JobError::new("no_skeleton", "there is none") };
    let refused = reason.clone();
    bench.worker(computation(move |_, _, _| Err(AttemptError::Refused(refused.clone())))).run_next().await.unwrap();
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.attempt, seen.error), (JobState::Failed, 1, Some(reason)));
}

#[tokio::test]
async fn bytes_that_are_no_recording_fail_with_the_code_of_the_decoder() {
    let bench = Bench::new().await;
    let job = bench.submit(b"these bytes are no MCAP file").await;
    let worker = Worker::new(bench.queue.clone(), "real", Limits::default(), CancellationToken::new());
    worker.run_next().await.unwrap();
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.attempt), (JobState::Failed, 1));
    let error = seen.error.unwrap();
    assert!(!["internal_panic", "storage_failed"].contains(&error.code.as_str()), "{error:?}");
}

#[tokio::test]
async fn a_lost_blob_is_a_failure_of_the_server_and_no_panic() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    std::fs::remove_dir_all(bench.dir.path().join("blobs/ba")).unwrap();
    bench.worker(plain()).run_next().await.unwrap();
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.error.unwrap().code.as_str()), (JobState::Queued, "storage_failed"));
}

#[tokio::test]
async fn a_running_job_is_cancelled_while_it_computes() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let begun = Arc::new(AtomicBool::new(false));
    let worker = bench.worker(endless(&begun)).with_heartbeat(EAGER);
    let (ran, _) = tokio::join!(worker.run_next(), async {
        until(&begun).await;
        bench.queue.cancel(&bench.access, job.id).await.unwrap();
    });
    assert_eq!(ran.unwrap(), Ran::Job(job.id));
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.error, seen.assessment_id), (JobState::Cancelled, None, None));
}

#[tokio::test]
async fn a_worker_that_lost_its_lease_stops_computing_and_writes_nothing() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let begun = Arc::new(AtomicBool::new(false));
    let worker = bench.worker(endless(&begun)).with_heartbeat(EAGER);
    let (ran, second) = tokio::join!(worker.run_next(), async {
        until(&begun).await;
        bench.queue.release(job.id, 1).await.unwrap();
        bench.queue.claim("second").await.unwrap().unwrap()
    });
    assert_eq!(ran.unwrap(), Ran::Job(job.id));
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.attempt, seen.worker), (JobState::Running, second.attempt, Some("second".into())));
}

#[tokio::test]
async fn a_shutdown_gives_the_job_back_to_the_queue() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let begun = Arc::new(AtomicBool::new(false));
    let shutdown = CancellationToken::new();
    let worker = bench.worker_until(endless(&begun), shutdown.clone());
    tokio::join!(worker.run(), async {
        until(&begun).await;
        shutdown.cancel();
    });
    assert_eq!(bench.job(job.id).await.state, JobState::Queued);
    bench.worker(plain()).run_next().await.unwrap();
    assert_eq!(bench.job(job.id).await.state, JobState::Done);
}

#[tokio::test]
async fn a_job_runs_again_after_a_restart_to_the_same_bytes() {
    if rows_are_elsewhere() {
        return;
    }
    let bench = Bench::new().await;
    let undisturbed = bench.submit(b"the same recording").await;
    bench.worker(plain()).run_next().await.unwrap();
    let disturbed = bench.enqueue(undisturbed.recording_id).await;
    // The process ends in the middle of the job: nobody says goodbye to the queue.
    bench.queue.claim("killed").await.unwrap().unwrap();
    bench.queue.store().close().await;
    let queue = open(bench.dir.path(), &bench.clock).await;
    let worker = Worker::new(queue.clone(), "next", Limits::default(), CancellationToken::new()).with_assess(plain());
    assert_eq!(worker.run_next().await.unwrap(), Ran::QueueEmpty);
    bench.pass_time();
    assert_eq!(worker.run_next().await.unwrap(), Ran::Job(disturbed.id));

    let mut stored = Vec::new();
    let rows = side_door(bench.dir.path()).await;
    for job in [undisturbed.id, disturbed.id] {
        let id = queue.job(&bench.access, job).await.unwrap().assessment_id.unwrap();
        let found = queue.store().assessment(&bench.access, id).await.unwrap();
        let slice = queue.store().series_of_assessment(&bench.access, id, &SeriesQuery::default()).await.unwrap();
        let chunks: Vec<String> = sqlx::query_scalar(
            "SELECT hex(value) || '/' || hex(low) || '/' || hex(high) || '/' || hex(flags)
             FROM series_chunks WHERE assessment_id = ?1 ORDER BY channel, chunk",
        )
        .bind(id)
        .fetch_all(&rows)
        .await
        .unwrap();
        assert!(!chunks.is_empty());
        stored.push((found.summary, found.provenance, slice.time_ns, chunks));
    }
    assert_eq!(stored[0], stored[1]);
}
