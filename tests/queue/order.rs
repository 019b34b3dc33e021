//! Whose turn it is: short before long, nobody crowded out, and clocks that are set.

use crate::support::{Bench, consent};
use surefoot::assessment::Settings;
use surefoot::queue::{Job, JobState, Queue, QueueSettings};
use surefoot::storage::{Access, NewPatient, NewSession, Role, SessionId};
use time::Duration;
use time::macros::datetime;

/// A job on a recording that claims to be this large.
async fn submit(bench: &Bench, access: &Access, session: SessionId, megabytes: u64) -> Job {
    let mut new = bench.new_recording(b"recording").await;
    (new.session_id, new.blob.size_bytes) = (session, megabytes * 1_000_000);
    bench.queue.submit(access, &new, &Settings::default()).await.unwrap().1
}

/// Somebody of another organisation, and a session there.
async fn stranger(bench: &Bench) -> (Access, SessionId) {
    let store = bench.queue.store();
    let organisation = store.create_organisation("elsewhere").await.unwrap();
    let access = store.create_client(organisation.id, Role::Admin, "stranger").await.unwrap().0.access();
    let patient = NewPatient { pseudonym: "P-1".into(), ..NewPatient::default() };
    let patient_id = store.create_patient(&access, &patient).await.unwrap().id;
    let started_at = datetime!(2026-11-22 07:00 UTC);
    let session = NewSession { patient_id, started_at, protocol: None, notes: None, noise_model: None };
    let session = store.create_session(&access, &session).await.unwrap().id;
    store.record_consent(&access, patient_id, &consent()).await.unwrap();
    (access, session)
}

async fn claim(queue: &Queue) -> Job {
    queue.claim("worker").await.unwrap().expect("a job")
}

#[tokio::test]
async fn a_short_recording_is_not_stuck_behind_long_ones() {
    let bench = Bench::new().await;
    for _ in 0..3 {
        submit(&bench, &bench.access, bench.session, 500).await;
    }
    let short = submit(&bench, &bench.access, bench.session, 1).await;
    assert_eq!(bench.job(short.id).await.n_ahead, Some(0));
    assert_eq!(claim(&bench.queue).await.id, short.id);
}

#[tokio::test]
async fn an_organisation_that_brings_many_delays_another_by_one_and_a_long_one_does_not_wait_for_ever() {
    let bench = Bench::new().await;
    let (stranger, session) = stranger(&bench).await;
    let long = submit(&bench, &bench.access, bench.session, 100).await;
    for _ in 0..50 {
        submit(&bench, &bench.access, bench.session, 5).await;
    }
    let theirs = submit(&bench, &stranger, session, 5).await;
    let first: Vec<_> = [claim(&bench.queue).await.id, claim(&bench.queue).await.id].into();
    assert!(first.contains(&theirs.id), "the other organisation's job is among the first two");
    // Its turn comes when the short ones that were there have had as much time as it takes.
    let ahead = bench.job(long.id).await.n_ahead.unwrap();
    assert!((5..30).contains(&ahead), "{ahead} have their turn before it");
    bench.clock.advance(Duration::minutes(3));
    for _ in 0..5 {
        submit(&bench, &bench.access, bench.session, 5).await;
    }
    let mut claimed = 0;
    while claim(&bench.queue).await.id != long.id {
        claimed += 1;
    }
    assert!(claimed <= 50, "{claimed} jobs went first");
}

#[tokio::test]
async fn a_clock_that_is_set_back_leaves_no_job_waiting() {
    let bench = Bench::new().await;
    let waiting = bench.submit(b"one").await;
    bench.clock.advance(-Duration::hours(6));
    assert_eq!(claim(&bench.queue).await.id, waiting.id);
    // Its worker falls silent, and the clock is set back once more.
    bench.clock.advance(-Duration::hours(6));
    let again = claim(&bench.queue).await;
    assert_eq!((again.id, again.attempt), (waiting.id, 2));
    // A lease that is not over is no leftover of another time.
    assert_eq!(bench.queue.claim("other").await.unwrap(), None);
}

#[tokio::test]
async fn a_clock_that_is_set_forward_makes_no_second_result() {
    let bench = Bench::new().await;
    bench.submit(b"one").await;
    let slow = claim(&bench.queue).await;
    bench.clock.advance(Duration::days(400));
    let fast = claim(&bench.queue).await;
    assert_eq!((fast.id, fast.attempt), (slow.id, 2));
    let result = || crate::support::assessment(b"one");
    bench.queue.finish(fast.id, fast.attempt, result()).await.unwrap();
    let late = bench.queue.finish(slow.id, slow.attempt, result()).await.unwrap();
    assert!(matches!(late, surefoot::queue::Finish::Lost));
    assert_eq!(bench.job(slow.id).await.state, JobState::Done);
}

#[tokio::test]
async fn too_many_waiting_jobs_leave_no_room_for_their_organisation_first() {
    let bench = Bench::new().await;
    let (stranger, _) = stranger(&bench).await;
    let settings = QueueSettings { most_waiting: 3, most_waiting_of_organisation: 2, ..QueueSettings::default() };
    let queue = Queue::new(bench.queue.store().clone(), settings);
    assert!(queue.room(&bench.access).await.unwrap().is_ok());
    bench.submit(b"one").await;
    bench.submit(b"two").await;
    let crowded = queue.room(&bench.access).await.unwrap().unwrap_err();
    assert_eq!((crowded.is_own, crowded.waiting), (true, 2));
    assert!(queue.room(&stranger).await.unwrap().is_ok());
    bench.submit(b"three").await;
    assert!(!queue.room(&stranger).await.unwrap().unwrap_err().is_own);
    claim(&bench.queue).await;
    assert!(queue.room(&stranger).await.unwrap().is_ok());
}
