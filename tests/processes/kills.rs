//! Service and worker are killed at random, again and again: nothing that was acknowledged is lost, doubled or stuck.

use crate::support::{App, Process, Service, number, recording, surefoot};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Recordings of different content; those of the same content must come to the same bytes.
const VERSIONS: usize = 3;

/// `SUREFOOT_ROUNDS` sets how often, `SUREFOOT_SEED` when.
#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_lost_doubled_or_stuck_however_often_processes_are_killed() {
    let (rounds, seed) = (number("SUREFOOT_ROUNDS", 8), number("SUREFOOT_SEED", 1));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let contents: Vec<Vec<u8>> = (0..VERSIONS).map(|version| recording(2, version)).collect();

    let service = Service::start(&data, &[("SUREFOOT_WORKERS", "1")]);
    let key = service.admin_key.clone().expect("the first start");
    let session = App::new(&service, &key).session("P-1").await;
    drop(service);

    // By key: what was acknowledged as which recording, and what has to be sent again.
    let mut acknowledged: BTreeMap<String, (usize, String)> = BTreeMap::new();
    let mut pending: BTreeMap<String, usize> = BTreeMap::new();
    let mut n_sent = 0;
    for _ in 0..rounds {
        let service = Service::start(&data, &[("SUREFOOT_WORKERS", "1")]);
        let app = App::new(&service, &key);
        let mut worker = surefoot(&["worker", "--workers", "1", "--data-dir"]);
        let worker = Process(worker.arg(&data).stdout(std::process::Stdio::null()).spawn().unwrap());
        for _ in 0..random.random_range(1..4) {
            pending.insert(format!("upload-{n_sent}"), n_sent % VERSIONS);
            n_sent += 1;
        }
        let uploads: Vec<_> = pending
            .iter()
            .map(|(name, version)| {
                let (app, session, name, version) = (app.clone(), session.clone(), name.clone(), *version);
                let content = contents[version].clone();
                tokio::spawn(async move {
                    let answer = app.try_upload(&session, &name, content).await;
                    (name, version, answer)
                })
            })
            .collect();
        tokio::time::sleep(Duration::from_millis(random.random_range(1..700))).await;
        if random.random_bool(0.5) {
            drop(worker);
            tokio::time::sleep(Duration::from_millis(random.random_range(1..200))).await;
            drop(service);
        } else {
            drop(service);
            drop(worker);
        }
        for upload in uploads {
            let (name, version, answer) = upload.await.unwrap();
            if let Some((status, answer)) = answer {
                assert_eq!(status, 202, "{answer:#}");
                let id = answer["recording"]["id"].as_str().unwrap().to_owned();
                let before = acknowledged.insert(name.clone(), (version, id.clone()));
                assert!(before.is_none_or(|(_, before)| before == id), "one upload became two recordings");
                pending.remove(&name);
            }
        }
    }

    let service = Service::start(&data, &[("SUREFOOT_WORKERS", "2")]);
    let app = App::new(&service, &key);
    for (name, version) in &pending {
        let (status, answer) = app.try_upload(&session, name, contents[*version].clone()).await.expect("an answer");
        assert_eq!(status, 202, "{answer:#}");
        let id = answer["recording"]["id"].as_str().unwrap().to_owned();
        acknowledged.insert(name.clone(), (*version, id));
    }
    app.until_all_jobs_are_over().await;

    let recordings = app.list(&format!("/v1/sessions/{session}/recordings")).await;
    let stored: BTreeSet<&str> = recordings.iter().map(|one| one["id"].as_str().unwrap()).collect();
    let promised: BTreeSet<&str> = acknowledged.values().map(|(_, id)| id.as_str()).collect();
    assert_eq!(stored, promised, "recordings that are stored, and those that were acknowledged");
    let mut results: Vec<BTreeSet<Vec<u8>>> = vec![BTreeSet::new(); VERSIONS];
    let mut attempts = 0;
    for (version, id) in acknowledged.values() {
        let jobs = app.list(&format!("/v1/jobs?recording_id={id}")).await;
        assert_eq!((jobs.len(), jobs[0]["state"].as_str().unwrap()), (1, "done"), "{jobs:#?}");
        attempts += jobs[0]["attempt"].as_u64().unwrap();
        let assessments = app.list(&format!("/v1/assessments?recording_id={id}")).await;
        assert_eq!(assessments.len(), 1, "{id}: one job, one result");
        let path = format!("/v1/assessments/{}/series", assessments[0]["id"].as_str().unwrap());
        let mut series: serde_json::Value = serde_json::from_slice(&app.get_bytes(&path).await).unwrap();
        series.as_object_mut().unwrap().remove("assessment_id");
        results[*version].insert(serde_json::to_vec(&series).unwrap());
    }
    let n_results: Vec<usize> = results.iter().map(BTreeSet::len).collect();
    assert!(n_results.iter().all(|n| *n <= 1), "results of the same bytes: {n_results:?}");
    drop(service);
    assert_eq!(std::fs::read_dir(data.join("parts")).unwrap().count(), 0, "parts of uploads that ended early");

    let doctor = surefoot(&["doctor", "--data-dir"]).arg(&data).output().unwrap();
    assert!(doctor.status.success(), "{}", String::from_utf8_lossy(&doctor.stdout));
    println!(
        "{rounds} rounds of kills (seed {seed}): {} recordings acknowledged, {} jobs done in {attempts} attempts, 0 lost, 0 doubled",
        acknowledged.len(),
        acknowledged.len()
    );
}
