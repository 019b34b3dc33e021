//! A withdrawal meets jobs in every state.

use crate::support::{Bench, EAGER, assessment, computation, endless, plain, until};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use surefoot::assessment::{NoiseModelSettings, Settings};
use surefoot::queue::{Finish, JobState};
use surefoot::storage::{ConsentScope, ConsentState, NewPatient, NewSession, StorageError};
use surefoot::worker::Ran;

#[tokio::test]
async fn a_result_that_comes_after_the_withdrawal_is_not_stored() {
    let bench = Bench::new().await;
    let job = bench.submit(&[1, 2]).await;
    let claimed = bench.queue.claim("worker").await.unwrap().unwrap();
    let withdrawn = bench.queue.withdraw_consent(&bench.access, bench.patient, ConsentScope::Assessment).await.unwrap();
    assert_eq!((withdrawn.jobs_cancelled, withdrawn.jobs_stopped), (0, 1));
    let late = bench.queue.finish(claimed.id, claimed.attempt, assessment(&[1, 2])).await.unwrap();
    assert_eq!(late, Finish::Lost);
    let job = bench.job(job.id).await;
    assert_eq!((job.state, job.assessment_id), (JobState::Cancelled, None));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_computation_under_way_is_stopped_by_the_withdrawal() {
    let bench = Bench::new().await;
    bench.submit(&[1]).await;
    let begun = Arc::new(AtomicBool::new(false));
    let worker = bench.worker(endless(&begun)).with_heartbeat(EAGER);
    let running = tokio::spawn(async move { worker.run_next().await });
    until(&begun).await;
    bench.queue.withdraw_consent(&bench.access, bench.patient, ConsentScope::Assessment).await.unwrap();
    assert!(matches!(running.await.unwrap().unwrap(), Ran::Job(_)));
}

#[tokio::test]
async fn a_withdrawal_from_research_stops_nothing() {
    let bench = Bench::new().await;
    let job = bench.submit(&[1]).await;
    bench.queue.withdraw_consent(&bench.access, bench.patient, ConsentScope::Research).await.unwrap();
    bench.worker(plain()).run_next().await.unwrap();
    assert_eq!(bench.job(job.id).await.state, JobState::Done);
}

#[tokio::test]
async fn a_training_needs_the_consent_of_everybody_in_it_and_ends_with_the_first_withdrawal() {
    let bench = Bench::new().await;
    let store = bench.queue.store();
    let own = bench.submit(&[1]).await;
    bench.worker(computation(|_, _, _| Ok(assessment(&[1])))).run_next().await.unwrap();
    let other = NewPatient { pseudonym: "P-2".into(), ..NewPatient::default() };
    let other = store.create_patient(&bench.access, &other).await.unwrap().id;
    let session =
        NewSession { patient_id: other, started_at: store.now(), protocol: None, notes: None, noise_model: None };
    let session = store.create_session(&bench.access, &session).await.unwrap().id;
    let mut new = bench.new_recording(&[2]).await;
    new.session_id = session;
    let refused = bench.queue.submit(&bench.access, &new, &Settings::default()).await;
    assert!(matches!(refused, Err(StorageError::NoConsent(ConsentState::Missing))));

    let consents = store.consents_of_patient(&bench.access, bench.patient).await.unwrap();
    let given = surefoot::storage::NewConsent {
        scope: ConsentScope::Assessment,
        text_version: "test".into(),
        given_at: consents[0].given_at,
        expires_at: None,
    };
    store.record_consent(&bench.access, other, &given).await.unwrap();
    let (theirs, _) = bench.queue.submit(&bench.access, &new, &Settings::default()).await.unwrap();
    bench.worker(plain()).run_next().await.unwrap();
    let training = Settings::NoiseModel(NoiseModelSettings {
        name: "ward".into(),
        description: String::new(),
        static_recordings: vec![own.recording_id.0, theirs.id.0],
        movement_recordings: Vec::new(),
    });
    let job = bench.queue.enqueue(&bench.access, own.recording_id, &training).await.unwrap();
    bench.queue.withdraw_consent(&bench.access, other, ConsentScope::Assessment).await.unwrap();
    assert_eq!(bench.job(job.id).await.state, JobState::Cancelled);
    let again = bench.queue.enqueue(&bench.access, own.recording_id, &training).await;
    assert!(matches!(again, Err(StorageError::NoConsent(ConsentState::Withdrawn))));
}
