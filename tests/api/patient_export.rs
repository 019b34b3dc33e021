//! Everything about one patient in one archive.

use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use surefoot::storage::Role;

fn files(archive: &[u8]) -> BTreeMap<String, Vec<u8>> {
    let mut archive = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
    let mut found = BTreeMap::new();
    for i in 0..archive.len() {
        let mut file = archive.by_index(i).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        found.insert(file.name().unwrap().into_owned(), bytes);
    }
    found
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_holds_every_row_the_bytes_as_uploaded_and_a_manifest_that_is_true() {
    let app = TestApp::new().await;
    let assessment = app.assessed().await;
    let assessed = app.get(&format!("/v1/assessments/{assessment}")).send().await.expect(StatusCode::OK);
    let recording = text(&assessed["recording_id"]).to_owned();
    let patient = text(&assessed["patient_id"]).to_owned();
    let answers = json!({"falls_12_months": 1});
    app.post(&format!("/v1/patients/{patient}/questionnaires")).json(&answers).send().await.expect(StatusCode::CREATED);
    let other = app.patient("P-other").await;

    let answer = app.get(&format!("/v1/patients/{patient}/export")).send().await;
    assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, "application/zip"));
    let files = files(&answer.body);
    let json = |name: &str| serde_json::from_slice::<Value>(&files[name]).unwrap();
    assert_eq!(json("patient.json")["id"], json!(patient));
    assert_eq!(json("consents.json")[0]["scope"], "assessment");
    for (name, n) in [
        ("sessions.json", 1),
        ("recordings.json", 1),
        ("assessments.json", 1),
        ("questionnaires.json", 1),
        ("training_plans.json", 0),
    ] {
        assert_eq!(json(name).as_array().unwrap().len(), n, "{name}");
    }
    assert_eq!(json("assessments.json")[0], assessed);
    assert_eq!(files[&format!("recordings/{recording}.json")], samples::json_recording());
    assert_eq!(json(&format!("recordings/{recording}.jobs.json"))[0]["state"], "done");
    assert!(String::from_utf8_lossy(&files[&format!("series/{assessment}.csv")]).starts_with("time_s,"));
    assert!(files.contains_key(&format!("joints/{assessment}.trc")));
    assert_eq!(json("report.fhir.json")["resourceType"], "Bundle");
    let audit = json("audit.json");
    assert!(
        audit.as_array().unwrap().iter().any(|entry| entry["action"] == "POST /v1/sessions/{id}/recordings"),
        "{audit:#}"
    );
    let manifest = json("manifest.json");
    let listed = manifest["files"].as_array().unwrap();
    assert_eq!(listed.len() + 1, files.len(), "all but itself");
    for file in listed {
        let bytes = &files[text(&file["path"])];
        assert_eq!(
            (text(&file["sha256"]), file["size_bytes"].as_u64()),
            (&*hex::encode(Sha256::digest(bytes)), Some(bytes.len() as u64))
        );
    }
    let all: Vec<u8> = files.into_values().flatten().collect();
    let holds = |mark: &str| all.windows(mark.len()).any(|part| part == mark.as_bytes());
    assert!(!holds(&other) && !holds("P-other"), "nothing of anybody else");
}

#[tokio::test]
async fn an_export_is_for_administrators_of_the_organisation() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let path = format!("/v1/patients/{patient}/export");
    let clinician = app.key(Role::Clinician).await;
    app.get(&path).key(&clinician).send().await.refused(403, "forbidden");
    let stranger = app.stranger().await;
    app.get(&path).key(&stranger).send().await.refused(404, "not_found");
}
