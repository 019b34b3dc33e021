//! Trainings: their model and the end of their job are one.

use crate::support::{Bench, rows_are_elsewhere, side_door};
use surefoot::assessment::noise_model::nite_table1;
use surefoot::assessment::{NoiseModel, NoiseModelSettings, Settings};
use surefoot::queue::{Job, JobState, Trained};
use surefoot::storage::{PageRequest, StorageError};

/// A queued training of a name.
async fn enqueue(bench: &Bench, name: &str) -> Job {
    let recording = bench.submit(b"abc").await.recording_id;
    // The job that came with the recording is out of the way.
    let assessing = bench.queue.claim("other").await.unwrap().unwrap();
    bench.queue.end_cancelled(assessing.id, assessing.attempt).await.unwrap();
    let settings = Settings::NoiseModel(NoiseModelSettings {
        name: name.into(),
        description: String::new(),
        static_recordings: vec![recording.0, recording.0],
        movement_recordings: Vec::new(),
    });
    bench.queue.enqueue(&bench.access, recording, &settings).await.unwrap()
}

fn model(name: &str) -> NoiseModel {
    let mut document = nite_table1().document().clone();
    document.name = name.into();
    NoiseModel::try_from(document).unwrap()
}

async fn names(bench: &Bench) -> Vec<String> {
    let page = bench.queue.store().noise_models(&bench.access, &PageRequest::first(200)).await.unwrap();
    page.items.iter().map(|stored| stored.model.name().to_string()).collect()
}

#[tokio::test]
async fn a_training_that_runs_twice_makes_one_model() {
    let bench = Bench::new().await;
    let job = enqueue(&bench, "ward-3").await;
    bench.queue.claim("killed").await.unwrap().unwrap();
    bench.pass_time();
    let second = bench.queue.claim("next").await.unwrap().unwrap();
    assert_eq!((second.id, second.attempt), (job.id, 2));
    let Trained::Saved(id) = bench.queue.finish_training(job.id, 2, model("ward-3")).await.unwrap() else { panic!() };
    assert_eq!(bench.queue.finish_training(job.id, 1, model("ward-3")).await.unwrap(), Trained::Lost);
    assert_eq!(bench.queue.finish_training(job.id, 2, model("ward-3")).await.unwrap(), Trained::Lost);
    assert_eq!(names(&bench).await, ["ward-3@1"]);
    let seen = bench.job(job.id).await;
    assert_eq!((seen.state, seen.noise_model_id, seen.assessment_id), (JobState::Done, Some(id), None));
}

#[tokio::test]
async fn every_training_of_a_name_is_a_further_version_and_the_digest_is_that_of_the_stored_document() {
    let bench = Bench::new().await;
    for name in ["ward-3", "ward-3", "ward-4"] {
        let job = enqueue(&bench, name).await;
        bench.queue.claim("w").await.unwrap().unwrap();
        bench.queue.finish_training(job.id, 1, model(name)).await.unwrap();
    }
    assert_eq!(names(&bench).await, ["ward-4@1", "ward-3@2", "ward-3@1"]);
    let store = bench.queue.store();
    let newest = store.noise_model_named(&bench.access, &"ward-3".parse().unwrap()).await.unwrap();
    assert_eq!(newest.model.name().to_string(), "ward-3@2");
    assert_eq!(newest.sha256, newest.model.sha256());
    let older = store.noise_model_named(&bench.access, &"ward-3@1".parse().unwrap()).await.unwrap();
    assert_ne!(older.sha256, newest.sha256);
    let absent = store.noise_model_named(&bench.access, &"ward-3@3".parse().unwrap()).await;
    assert!(matches!(absent, Err(StorageError::NotFound { what: "noise model" })));
}

#[tokio::test]
async fn a_model_that_cannot_be_stored_leaves_its_job_running() {
    if rows_are_elsewhere() {
        return;
    }
    let bench = Bench::new().await;
    let job = enqueue(&bench, "ward-3").await;
    bench.queue.claim("w").await.unwrap().unwrap();
    sqlx::raw_sql("CREATE TRIGGER fault BEFORE INSERT ON noise_models BEGIN SELECT RAISE(ABORT, 'injected'); END")
        .execute(&side_door(bench.dir.path()).await)
        .await
        .unwrap();
    let failed = bench.queue.finish_training(job.id, 1, model("ward-3")).await;
    assert!(matches!(failed, Err(StorageError::Database(_))), "{failed:?}");
    assert_eq!((bench.job(job.id).await.state, names(&bench).await), (JobState::Running, Vec::new()));
}
