//! Claims, leases and fences, without a worker.

use crate::support::{Bench, assessment, open, rows_are_elsewhere, side_door};
use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;
use surefoot::assessment::Settings;
use surefoot::progress::{Progress, Step};
use surefoot::queue::{Failure, Finish, Job, JobError, JobFilter, JobState, Renewal, Submission, WORKER_LOST};
use surefoot::storage::{
    Access, AssessmentFilter, PageRequest, Role, SeriesQuery, StorageError, StoredRecording, StoredResponse,
};
use time::Duration;

const PROGRESS: Progress = Progress { step: Step::Estimating, done: 7, total: 10 };

async fn assessments(bench: &Bench) -> usize {
    let store = bench.queue.store();
    let page = PageRequest::first(200);
    store.assessments(&bench.access, &AssessmentFilter::default(), &page).await.unwrap().items.len()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn ten_thousand_jobs_are_each_claimed_once_by_many_workers_of_two_processes() {
    if rows_are_elsewhere() {
        return;
    }
    const JOBS: usize = 10_000;
    let bench = Bench::new().await;
    bench.submit(b"abc").await;
    // Nine thousand and more copies of the job, in one go.
    sqlx::query(
        "WITH RECURSIVE copies (n) AS (SELECT 2 UNION ALL SELECT n + 1 FROM copies WHERE n < ?1)
         INSERT INTO jobs (id, organisation_id, recording_id, state, max_attempts, due_at, settings, queued_at)
         SELECT randomblob(16), organisation_id, recording_id, state, max_attempts, due_at, settings, queued_at
         FROM jobs, copies",
    )
    .bind(JOBS as i64)
    .execute(&side_door(bench.dir.path()).await)
    .await
    .unwrap();
    // Two stores share nothing but the file, as two processes do.
    let processes = [bench.queue.clone(), open(bench.dir.path(), &bench.clock).await];
    let mut workers = tokio::task::JoinSet::new();
    for number in 0..8 {
        let queue = processes[number % 2].clone();
        workers.spawn(async move {
            let mut claimed = Vec::new();
            while let Some(job) = queue.claim(&format!("worker {number}")).await.unwrap() {
                assert_eq!(job.attempt, 1);
                assert!(matches!(queue.finish(job.id, 1, assessment(b"abc")).await.unwrap(), Finish::Saved(_)));
                claimed.push(job.id);
            }
            claimed
        });
    }
    let claimed: Vec<_> = workers.join_all().await.into_iter().flatten().collect();
    assert_eq!(claimed.len(), JOBS);
    assert_eq!(claimed.iter().collect::<HashSet<_>>().len(), JOBS);
    assert_eq!(bench.counts().await, [(JobState::Done, JOBS as u64)]);
}

#[tokio::test]
async fn jobs_are_claimed_in_the_order_in_which_they_came() {
    let bench = Bench::new().await;
    let recording = bench.submit(b"abc").await.recording_id;
    let mut ids: Vec<_> = Vec::new();
    for _ in 0..5 {
        ids.push(bench.enqueue(recording).await.id);
    }
    bench.queue.claim("w").await.unwrap().unwrap();
    for id in ids {
        assert_eq!(bench.queue.claim("w").await.unwrap().unwrap().id, id);
    }
    assert_eq!(bench.queue.claim("w").await.unwrap(), None);
}

#[tokio::test]
async fn a_recording_and_its_job_are_stored_together_or_not_at_all() {
    if rows_are_elsewhere() {
        return;
    }
    let bench = Bench::new().await;
    let rows = side_door(bench.dir.path()).await;
    sqlx::raw_sql("CREATE TRIGGER fault BEFORE INSERT ON jobs BEGIN SELECT RAISE(ABORT, 'injected'); END")
        .execute(&rows)
        .await
        .unwrap();
    let new = bench.new_recording(b"abc").await;
    let failed = bench.queue.submit(&bench.access, &new, &Default::default()).await;
    assert!(matches!(failed, Err(StorageError::Database(_))), "{failed:?}");
    let recordings: i64 = sqlx::query_scalar("SELECT count(*) FROM recordings").fetch_one(&rows).await.unwrap();
    assert_eq!(recordings, 0);
}

#[tokio::test]
async fn a_held_lease_keeps_others_away_and_an_expired_one_lets_them_in() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    let first = bench.queue.claim("first").await.unwrap().unwrap();
    assert_eq!((first.id, first.attempt, first.state), (job.id, 1, JobState::Running));
    bench.clock.advance(bench.queue.settings().lease - Duration::MILLISECOND);
    assert_eq!(bench.queue.claim("second").await.unwrap(), None);
    assert_eq!(bench.queue.renew(job.id, 1, PROGRESS).await.unwrap(), Renewal::Held);
    assert_eq!(bench.job(job.id).await.progress, PROGRESS);
    bench.clock.advance(Duration::MILLISECOND);
    assert_eq!(bench.queue.claim("second").await.unwrap(), None);
    bench.clock.advance(bench.queue.settings().lease);
    let second = bench.queue.claim("second").await.unwrap().unwrap();
    assert_eq!((second.id, second.attempt, second.worker.as_deref()), (job.id, 2, Some("second")));
}

#[tokio::test]
async fn a_stale_worker_that_finishes_late_writes_nothing() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    bench.queue.claim("stale").await.unwrap().unwrap();
    bench.pass_time();
    bench.queue.claim("fresh").await.unwrap().unwrap();

    let error = JobError::new("late", "too late");
    assert_eq!(bench.queue.renew(job.id, 1, PROGRESS).await.unwrap(), Renewal::Lost);
    assert_eq!(bench.queue.finish(job.id, 1, assessment(b"stale")).await.unwrap(), Finish::Lost);
    assert_eq!(bench.queue.fail(job.id, 1, &error, true).await.unwrap(), Failure::Lost);
    assert!(!bench.queue.end_cancelled(job.id, 1).await.unwrap());
    bench.queue.release(job.id, 1).await.unwrap();
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.attempt, seen.worker.as_deref()), (JobState::Running, 2, Some("fresh")));
    assert_eq!((assessments(&bench).await, seen.error), (0, None));

    let Finish::Saved(id) = bench.queue.finish(job.id, 2, assessment(b"fresh")).await.unwrap() else { panic!() };
    assert_eq!(bench.queue.finish(job.id, 1, assessment(b"stale")).await.unwrap(), Finish::Lost);
    assert_eq!(bench.queue.finish(job.id, 2, assessment(b"again")).await.unwrap(), Finish::Lost);
    let slice = bench.queue.store().series_of_assessment(&bench.access, id, &SeriesQuery::default()).await.unwrap();
    assert_eq!(slice.series[0].value, b"fresh".map(f32::from));
    assert_eq!((assessments(&bench).await, bench.job(job.id).await.assessment_id), (1, Some(id)));
}

#[tokio::test]
async fn a_job_whose_workers_fall_silent_is_given_up_after_its_last_attempt_with_the_reason() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    for attempt in 1..=job.max_attempts {
        assert_eq!(bench.queue.claim("silent").await.unwrap().unwrap().attempt, attempt);
        bench.pass_time();
    }
    assert_eq!(bench.queue.claim("next").await.unwrap(), None);
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.due_at), (JobState::Failed, None));
    assert_eq!(seen.error.unwrap().code, WORKER_LOST);
    assert!(seen.finished_at.is_some());
}

#[tokio::test]
async fn a_result_and_the_end_of_its_job_are_one_transaction() {
    if rows_are_elsewhere() {
        return;
    }
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    bench.queue.claim("w").await.unwrap().unwrap();
    let rows = side_door(bench.dir.path()).await;
    for table in ["assessments", "time_chunks", "series_chunks"] {
        let fault = format!("CREATE TRIGGER fault BEFORE INSERT ON {table} BEGIN SELECT RAISE(ABORT, 'injected'); END");
        sqlx::raw_sql(sqlx::AssertSqlSafe(fault)).execute(&rows).await.unwrap();
        let failed = bench.queue.finish(job.id, 1, assessment(b"abc")).await;
        assert!(matches!(failed, Err(StorageError::Database(_))), "{table}: {failed:?}");
        assert_eq!(bench.job(job.id).await.state, JobState::Running, "{table}");
        assert_eq!(assessments(&bench).await, 0, "{table}");
        sqlx::raw_sql("DROP TRIGGER fault").execute(&rows).await.unwrap();
    }
    assert!(matches!(bench.queue.finish(job.id, 1, assessment(b"abc")).await.unwrap(), Finish::Saved(_)));
    assert_eq!((bench.job(job.id).await.state, assessments(&bench).await), (JobState::Done, 1));
}

#[tokio::test]
async fn an_assessment_that_could_not_be_read_back_is_refused_before_anything_is_written() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    bench.queue.claim("w").await.unwrap().unwrap();
    let mut with_nan = assessment(b"abc");
    with_nan.quality.coverage = f64::NAN;
    let mut too_short = assessment(b"abc");
    too_short.series[0].flags.pop();
    let mut backwards = assessment(b"abc");
    backwards.time_ns.reverse();
    for damaged in [with_nan, too_short, backwards] {
        assert!(matches!(bench.queue.finish(job.id, 1, damaged).await, Err(StorageError::Corrupt(_))));
    }
    assert_eq!((bench.job(job.id).await.state, assessments(&bench).await), (JobState::Running, 0));
}

#[tokio::test]
async fn a_queued_job_is_cancelled_at_once_and_never_claimed() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    assert_eq!(bench.queue.cancel(&bench.access, job.id).await.unwrap().state, JobState::Cancelled);
    assert_eq!(bench.queue.cancel(&bench.access, job.id).await.unwrap().state, JobState::Cancelled);
    assert_eq!(bench.queue.claim("w").await.unwrap(), None);
}

#[tokio::test]
async fn a_job_that_is_over_cannot_be_cancelled() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    bench.queue.claim("w").await.unwrap().unwrap();
    bench.queue.finish(job.id, 1, assessment(b"abc")).await.unwrap();
    let refused = bench.queue.cancel(&bench.access, job.id).await;
    assert!(matches!(refused, Err(StorageError::Conflict { code: "job_over", .. })), "{refused:?}");
}

#[tokio::test]
async fn a_running_job_hears_of_the_cancellation_and_is_cancelled_even_if_its_worker_is_lost() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    bench.queue.claim("w").await.unwrap().unwrap();
    let asked = bench.queue.cancel(&bench.access, job.id).await.unwrap();
    assert_eq!((asked.state, asked.cancel_requested), (JobState::Running, true));
    assert_eq!(bench.queue.renew(job.id, 1, PROGRESS).await.unwrap(), Renewal::CancelRequested);
    bench.pass_time();
    assert_eq!(bench.queue.claim("other").await.unwrap(), None);
    assert_eq!(bench.job(job.id).await.state, JobState::Cancelled);
}

#[tokio::test]
async fn a_released_job_is_due_at_once_under_a_new_number_and_loses_no_attempt() {
    let bench = Bench::new().await;
    let job = bench.submit(b"abc").await;
    bench.queue.claim("leaving").await.unwrap().unwrap();
    bench.queue.release(job.id, 1).await.unwrap();
    let again = bench.queue.claim("staying").await.unwrap().unwrap();
    assert_eq!((again.id, again.attempt, again.max_attempts), (job.id, 2, job.max_attempts + 1));
}

#[tokio::test]
async fn a_waiting_worker_is_woken_by_an_upload_and_a_watcher_hears_each_change() {
    use futures::FutureExt;
    let bench = Bench::new().await;
    let mut changes = bench.queue.changes();
    let mut woken = Box::pin(bench.queue.woken());
    woken.as_mut().enable();
    assert!(woken.as_mut().now_or_never().is_none());
    let job = bench.submit(b"abc").await;
    assert!(woken.now_or_never().is_some());
    bench.queue.claim("w").await.unwrap();
    bench.queue.renew(job.id, 1, PROGRESS).await.unwrap();
    bench.queue.finish(job.id, 1, assessment(b"abc")).await.unwrap();
    let heard: Vec<_> = std::iter::from_fn(|| changes.try_recv().ok()).collect();
    assert_eq!(heard, [job.id; 4]);
}

#[tokio::test]
async fn jobs_are_listed_newest_first_in_pages_and_by_state_and_recording() {
    let bench = Bench::new().await;
    let first = bench.submit(b"one").await;
    let second = bench.submit(b"two").await;
    let third = bench.enqueue(second.recording_id).await;
    bench.queue.claim("w").await.unwrap();
    let list = async |filter: JobFilter, page: PageRequest<_>| {
        let page = bench.queue.jobs(&bench.access, &filter, &page).await.unwrap();
        (page.items.iter().map(|job| job.id).collect::<Vec<_>>(), page.next)
    };
    let all = JobFilter::default();
    assert_eq!(list(all, PageRequest::first(2)).await, (vec![third.id, second.id], Some(second.id)));
    assert_eq!(list(all, PageRequest { after: Some(second.id), limit: 2 }).await, (vec![first.id], None));
    let running = JobFilter { state: Some(JobState::Running), ..all };
    assert_eq!(list(running, PageRequest::first(9)).await.0, [first.id]);
    let of_second = JobFilter { recording_id: Some(second.recording_id), ..all };
    assert_eq!(list(of_second, PageRequest::first(9)).await.0, [third.id, second.id]);
    let states: BTreeSet<_> = bench.counts().await.into_iter().map(|(s, n)| (s.name(), n)).collect();
    assert_eq!(states, BTreeSet::from([("queued", 2), ("running", 1)]));
}

fn answer(_: StoredRecording, job: Job) -> serde_json::Result<StoredResponse> {
    Ok(StoredResponse { status: 202, headers: vec![("location".into(), job.id.to_string())], body: b"{}".to_vec() })
}

#[tokio::test]
async fn an_upload_that_is_sent_twice_is_stored_once_and_answered_twice() {
    let bench = Bench::new().await;
    let (new, settings) = (bench.new_recording(b"abc").await, Settings::default());
    let submit = async |access: &Access, fingerprint: &str| {
        bench.queue.submit_once(access, "key", fingerprint.into(), &new, &settings, answer).await.unwrap()
    };
    let Submission::Stored(first) = submit(&bench.access, "a").await else { panic!("not stored") };
    assert_eq!(submit(&bench.access, "a").await, Submission::Replayed(first));
    assert_eq!(submit(&bench.access, "b").await, Submission::KeyReused);
    assert_eq!(bench.counts().await, [(JobState::Queued, 1)]);
    let (other, _) = bench.queue.store().create_client(bench.access.organisation, Role::Admin, "other").await.unwrap();
    assert!(matches!(submit(&other.access(), "b").await, Submission::Stored(_)), "another client's key");
    bench.clock.advance(Duration::hours(24));
    assert!(matches!(submit(&bench.access, "b").await, Submission::Stored(_)), "the key is forgotten after a day");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn of_many_equal_uploads_at_the_same_time_one_is_stored() {
    let bench = Arc::new(Bench::new().await);
    let mut uploads = tokio::task::JoinSet::new();
    for _ in 0..16 {
        let bench = bench.clone();
        uploads.spawn(async move {
            let (new, settings) = (bench.new_recording(b"abc").await, Settings::default());
            bench.queue.submit_once(&bench.access, "key", "a".into(), &new, &settings, answer).await.unwrap()
        });
    }
    let outcomes = uploads.join_all().await;
    assert_eq!(outcomes.iter().filter(|o| matches!(o, Submission::Stored(_))).count(), 1);
    assert_eq!(outcomes.iter().filter(|o| matches!(o, Submission::Replayed(_))).count(), 15);
}

#[tokio::test]
async fn an_upload_whose_answer_cannot_be_kept_is_not_stored_and_its_key_is_free() {
    if rows_are_elsewhere() {
        return;
    }
    let bench = Bench::new().await;
    let (new, settings) = (bench.new_recording(b"abc").await, Settings::default());
    let rows = side_door(bench.dir.path()).await;
    let submit = async || bench.queue.submit_once(&bench.access, "key", "a".into(), &new, &settings, answer).await;
    sqlx::raw_sql("CREATE TRIGGER fault BEFORE INSERT ON idempotency_keys BEGIN SELECT RAISE(ABORT, 'injected'); END")
        .execute(&rows)
        .await
        .unwrap();
    assert!(matches!(submit().await, Err(StorageError::Database(_))));
    assert_eq!(bench.counts().await, []);
    sqlx::raw_sql("DROP TRIGGER fault").execute(&rows).await.unwrap();
    assert!(matches!(submit().await.unwrap(), Submission::Stored(_)));
}
