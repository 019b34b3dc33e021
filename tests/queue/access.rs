//! Jobs and assessments end at the walls between organisations, and at a device's own sessions.

use crate::support::{Bench, assessment};
use surefoot::assessment::Settings;
use surefoot::queue::{Finish, JobFilter};
use surefoot::storage::{Access, AssessmentFilter, PageRequest, Role, SeriesQuery, StorageError};

fn is_absent<T: std::fmt::Debug>(answer: Result<T, StorageError>, what: &str) {
    assert!(matches!(&answer, Err(StorageError::NotFound { what: w }) if *w == what), "{what}: {answer:?}");
}

async fn sees_nothing(bench: &Bench, access: &Access) {
    let (queue, store, settings) = (&bench.queue, bench.queue.store(), Settings::default());
    let new = bench.new_recording(b"abc").await;
    let (recording, job) = queue.submit(&bench.access, &new, &settings).await.unwrap();
    queue.claim("w").await.unwrap().unwrap();
    let Finish::Saved(id) = queue.finish(job.id, 1, assessment(b"abc")).await.unwrap() else { panic!("lost") };
    assert_eq!(store.assessment(&bench.access, id).await.unwrap().job_id, job.id);

    is_absent(queue.submit(access, &new, &settings).await, "session");
    is_absent(queue.enqueue(access, recording.id, &settings).await, "recording");
    is_absent(queue.job(access, job.id).await, "job");
    is_absent(queue.cancel(access, job.id).await, "job");
    is_absent(store.assessment(access, id).await, "assessment");
    is_absent(store.series_of_assessment(access, id, &SeriesQuery::default()).await, "assessment");
    for filter in [JobFilter::default(), JobFilter { recording_id: Some(recording.id), state: None }] {
        assert!(queue.jobs(access, &filter, &PageRequest::first(9)).await.unwrap().items.is_empty());
    }
    let of_recording = AssessmentFilter { recording_id: Some(recording.id), ..AssessmentFilter::default() };
    for filter in [AssessmentFilter::default(), of_recording] {
        assert!(store.assessments(access, &filter, &PageRequest::first(9)).await.unwrap().items.is_empty());
    }
}

#[tokio::test]
async fn another_organisation_has_no_access_to_jobs_and_assessments() {
    let bench = Bench::new().await;
    let store = bench.queue.store();
    let elsewhere = store.create_organisation("elsewhere").await.unwrap();
    let (stranger, _) = store.create_client(elsewhere.id, Role::Admin, "stranger").await.unwrap();
    sees_nothing(&bench, &stranger.access()).await;
}

#[tokio::test]
async fn a_device_has_no_access_to_jobs_and_assessments_of_sessions_that_it_did_not_make() {
    let bench = Bench::new().await;
    let (device, _) = bench.queue.store().create_client(bench.access.organisation, Role::Device, "d").await.unwrap();
    sees_nothing(&bench, &device.access()).await;
}

#[tokio::test]
async fn assessments_are_found_by_what_they_are_of_and_how_they_were_made() {
    let bench = Bench::new().await;
    let (queue, store) = (&bench.queue, bench.queue.store());
    let mut ids = Vec::new();
    for method in ["ik", "iekf"] {
        let job = bench.submit(method.as_bytes()).await;
        queue.claim("w").await.unwrap().unwrap();
        let mut found = assessment(b"abc");
        found.provenance.method = method.into();
        let Finish::Saved(id) = queue.finish(job.id, 1, found).await.unwrap() else { panic!("lost") };
        ids.push((id, job.recording_id));
    }
    let list = async |filter: AssessmentFilter| {
        let page = store.assessments(&bench.access, &filter, &PageRequest::first(9)).await.unwrap();
        page.items.into_iter().map(|a| a.id).collect::<Vec<_>>()
    };
    let all = AssessmentFilter::default;
    let patient_id = store.assessment(&bench.access, ids[0].0).await.unwrap().patient_id;
    assert_eq!(list(all()).await, [ids[1].0, ids[0].0]);
    assert_eq!(list(AssessmentFilter { patient_id: Some(patient_id), ..all() }).await, [ids[1].0, ids[0].0]);
    assert_eq!(list(AssessmentFilter { session_id: Some(bench.session), ..all() }).await, [ids[1].0, ids[0].0]);
    assert_eq!(list(AssessmentFilter { method: Some("ik".into()), ..all() }).await, [ids[0].0]);
    assert_eq!(list(AssessmentFilter { pipeline: Some("leg_pose".into()), ..all() }).await, []);
    assert_eq!(list(AssessmentFilter { recording_id: Some(ids[1].1), ..all() }).await, [ids[1].0]);
}
