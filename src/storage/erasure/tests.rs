//! A patient with a marker in everything that can hold one, and files that are searched for it.

use super::*;
use crate::fall_risk::Answers;
use crate::storage::database::query;
use crate::storage::tests::Clinic;
use crate::storage::{Access, ConsentScope, NewConsent, NewPatient, NewSession, SessionId, restore};
use sqlx::{ConnectOptions, Connection};
use std::path::Path;

/// Files of a folder that hold one of the marks.
fn files_with(folder: &Path, marks: &[Vec<u8>]) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(files_with(&entry, marks));
            continue;
        }
        let bytes = std::fs::read(&entry).unwrap();
        if marks.iter().any(|mark| bytes.windows(mark.len()).any(|part| part == mark)) {
            found.push(entry.file_name().unwrap().to_string_lossy().into_owned());
        }
    }
    found.sort();
    found
}

/// A patient whose rows and blob hold a marker; the marks are the marker and the patient's id in both forms.
async fn marked(clinic: &Clinic, marker: &str) -> (PatientId, SessionId, Vec<Vec<u8>>) {
    let store = &clinic.store;
    let new = NewPatient { pseudonym: format!("P-{marker}"), ..NewPatient::default() };
    let patient = store.create_patient(&clinic.admin, &new).await.unwrap().id;
    let session = NewSession {
        patient_id: patient,
        started_at: store.now(),
        protocol: Some("back_knee".into()),
        notes: Some(format!("note {marker} ").repeat(400)),
        noise_model: None,
    };
    let session = store.create_session(&clinic.admin, &session).await.unwrap().id;
    let consent = NewConsent {
        scope: ConsentScope::Assessment,
        text_version: format!("text {marker}"),
        given_at: store.now(),
        expires_at: None,
    };
    store.record_consent(&clinic.admin, patient, &consent).await.unwrap();
    store.add_answers(&clinic.admin, patient, &Answers::default()).await.unwrap();
    let bytes = format!("recording of {marker}").into_bytes();
    let mut writer = store.blobs().writer().await.unwrap();
    writer.write(bytes.into()).await.unwrap();
    let blob = writer.seal().await.unwrap().keep().await.unwrap();
    let mut recording = crate::storage::tests::new_recording(store, session).await;
    recording.blob = blob;
    recording.inspection.header.protocol = Some(format!("header {marker}"));
    let mut transaction = store.begin().await.unwrap();
    crate::storage::recordings::insert(&mut transaction, &clinic.admin, &recording, store.now()).await.unwrap();
    transaction.commit().await.unwrap();
    let marks = vec![marker.as_bytes().to_vec(), patient.to_string().into_bytes(), patient.0.as_bytes().to_vec()];
    (patient, session, marks)
}

fn order<'a>(access: &Access, patient: PatientId, confirmation: Option<&'a str>) -> ErasureOrder<'a> {
    ErasureOrder {
        organisation: access.organisation,
        patient,
        reason: ErasureReason::Request,
        actor: Actor::operator(Some(access.organisation)),
        request_id: "",
        confirmation,
    }
}

#[tokio::test]
async fn nothing_of_an_erased_patient_is_left_in_any_file() {
    let clinic = Clinic::open().await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    // Others around, so that pages are shared and split.
    for i in 0..50 {
        marked(&clinic, &format!("other{i:03}")).await;
    }
    let (patient, session, marks) = marked(&clinic, "zq7-marker-x9").await;
    clinic
        .store
        .update_patient(&clinic.admin, patient, |patient| patient.pseudonym = "Q-zq7-marker-x9-renamed".into())
        .await
        .unwrap();
    for i in 50..100 {
        marked(&clinic, &format!("other{i:03}")).await;
    }
    let event = AuditEvent::of_command(
        clinic.store.now(),
        Actor::operator(Some(clinic.admin.organisation)),
        "GET /v1/sessions/{id}",
        Some(super::super::audit::Thing { kind: super::super::audit::ThingKind::Session, id: session.0 }),
        String::new(),
    );
    clinic.store.audit(&[event]).await.unwrap();
    assert!(files_with(clinic.dir.path(), &marks).len() >= 3, "database, log and blob");

    let wrong = clinic.store.erase_patient(&order(&clinic.admin, patient, Some("P-1"))).await;
    assert!(matches!(wrong, Err(StorageError::Conflict { code: "confirmation_mismatch", .. })));
    let right = order(&clinic.admin, patient, Some("Q-zq7-marker-x9-renamed"));
    let (erasure, _) = clinic.store.erase_patient(&right).await.unwrap();
    assert!(erasure.done_at.is_some());
    assert_eq!((erasure.removed["patients"], erasure.removed["recordings"], erasure.removed["consents"]), (1, 1, 1));
    assert!(!erasure.blobs[0].is_shared);
    assert_eq!(files_with(clinic.dir.path(), &marks), [""; 0]);
    // The service goes on, and a further write brings nothing back.
    marked(&clinic, "afterwards").await;
    assert_eq!(files_with(clinic.dir.path(), &marks), [""; 0]);
    assert!(clinic.store.ailments(true).await.unwrap().iter().all(|ailment| !ailment.is_damage));

    let (again, _) = clinic.store.erase_patient(&order(&clinic.admin, patient, Some("anything"))).await.unwrap();
    assert_eq!(again, erasure);
    let stranger = Access { organisation: OrganisationId::new(), ..clinic.admin };
    let unknown = clinic.store.erase_patient(&order(&stranger, patient, None)).await;
    assert!(matches!(unknown, Err(StorageError::NotFound { what: "patient" })));
    assert_eq!(clinic.store.verify_audit(None).await.unwrap().broken, None);
    let filter = crate::storage::audit::AuditFilter { patient: Some(patient), ..Default::default() };
    let about = clinic.store.audit_entries(clinic.admin.organisation, &filter, None, 50).await.unwrap();
    assert_eq!(
        about.iter().map(|entry| entry.action.as_str()).collect::<Vec<_>>(),
        ["erasure", "GET /v1/sessions/{id}"]
    );
    assert!(about.iter().all(|entry| entry.thing.as_ref().is_some_and(|thing| thing.id.is_none())));
}

#[tokio::test]
async fn bytes_that_another_patient_has_too_stay() {
    let clinic = Clinic::open().await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    let other = NewPatient { pseudonym: "P-2".into(), ..NewPatient::default() };
    let other = clinic.store.create_patient(&clinic.admin, &other).await.unwrap().id;
    let session = NewSession {
        patient_id: other,
        started_at: clinic.store.now(),
        protocol: None,
        notes: None,
        noise_model: None,
    };
    let session = clinic.store.create_session(&clinic.admin, &session).await.unwrap().id;
    clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
    clinic.insert_recording(&clinic.admin, session).await.unwrap();
    let (erasure, _) = clinic.store.erase_patient(&order(&clinic.admin, clinic.patient, None)).await.unwrap();
    assert!(erasure.blobs[0].is_shared);
    assert_eq!(clinic.store.ailments(true).await.unwrap(), []);
    let (erasure, _) = clinic.store.erase_patient(&order(&clinic.admin, other, None)).await.unwrap();
    assert!(!erasure.blobs[0].is_shared);
    assert_eq!(clinic.store.blobs().keys().await.unwrap(), [""; 0]);
}

#[tokio::test]
async fn an_erasure_that_a_crash_has_cut_off_is_taken_up_by_the_next_start() {
    let clinic = Clinic::open().await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    let (patient, _, marks) = marked(&clinic, "zq8-marker").await;
    // As far as a process comes that is killed after the first commit.
    let mut transaction = clinic.store.begin().await.unwrap();
    let removed = rows::remove(&mut transaction, patient).await.unwrap();
    clinic.store.forget_audited_things(&mut transaction, patient).await.unwrap();
    clinic.store.record(&mut transaction, &order(&clinic.admin, patient, None), &removed).await.unwrap();
    transaction.commit().await.unwrap();
    std::fs::write(clinic.dir.path().join(LIST_FILE), b"{\"patient\": \"cut o").unwrap();
    clinic.store.close().await;
    assert!(!files_with(clinic.dir.path(), &marks).is_empty(), "the blob at least");

    let store = clinic.reopen().await;
    assert_eq!(store.resume_erasures().await.unwrap(), 1);
    assert_eq!(files_with(clinic.dir.path(), &marks), [""; 0]);
    assert_eq!(store.resume_erasures().await.unwrap(), 0);
}

#[tokio::test]
async fn a_restored_backup_is_rid_of_whom_the_list_names() {
    let clinic = Clinic::open().await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    let at = |name: &str| clinic.dir.path().join(name);
    let (patient, _, marks) = marked(&clinic, "zq9-marker").await;
    let outside = tempfile::tempdir().unwrap();
    let backup = outside.path().join("backup");
    clinic.store.back_up(&backup).await.unwrap();
    clinic.store.erase_patient(&order(&clinic.admin, patient, None)).await.unwrap();
    assert!(!files_with(&backup, &marks).is_empty(), "an erasure does not reach backups");

    let restored = outside.path().join("restored");
    restore(&backup, &restored).await.unwrap();
    let store = Store::open(&restored).await.unwrap();
    assert!(store.erase_listed(&at("mistyped.jsonl")).await.is_err());
    assert_eq!(store.erase_listed(&at(LIST_FILE)).await.unwrap(), 1);
    assert_eq!(files_with(&restored, &marks), [""; 0]);
    assert!(store.patient(&clinic.admin, clinic.patient).await.is_ok(), "others stay");
    assert_eq!(store.erase_listed(&at(LIST_FILE)).await.unwrap(), 0);
    assert_eq!(store.verify_audit(None).await.unwrap().broken, None);
}

#[tokio::test]
async fn free_pages_of_an_older_version_are_cleaned_by_the_first_start() {
    let clinic = Clinic::open().await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    marked(&clinic, "zq1-marker").await;
    clinic.store.close().await;
    let file = clinic.dir.path().join("surefoot.sqlite");
    let mut connection = sqlx::sqlite::SqliteConnectOptions::new().filename(file).connect().await.unwrap();
    for statement in ["PRAGMA secure_delete = OFF", "UPDATE sessions SET notes = NULL", "PRAGMA user_version = 0"] {
        sqlx::query(statement).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
    let marks = [b"note zq1-marker".to_vec()];
    assert!(files_with(clinic.dir.path(), &marks).contains(&"surefoot.sqlite".to_owned()));
    let store = clinic.reopen().await;
    store.close().await;
    assert_eq!(files_with(clinic.dir.path(), &marks), [""; 0]);
}

#[tokio::test]
async fn a_training_with_a_recording_of_the_patient_goes_with_its_model_and_others_stay() {
    let clinic = Clinic::open().await;
    let other = NewPatient { pseudonym: "P-2".into(), ..NewPatient::default() };
    let other = clinic.store.create_patient(&clinic.admin, &other).await.unwrap().id;
    let session = NewSession {
        patient_id: other,
        started_at: clinic.store.now(),
        protocol: None,
        notes: None,
        noise_model: None,
    };
    let session = clinic.store.create_session(&clinic.admin, &session).await.unwrap().id;
    let own = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap().id;
    let theirs = clinic.insert_recording(&clinic.admin, session).await.unwrap().id;
    let mut transaction = clinic.store.begin().await.unwrap();
    for (number, read) in [vec![theirs.0], vec![theirs.0, own.0]].into_iter().enumerate() {
        let settings = crate::assessment::Settings::NoiseModel(crate::assessment::NoiseModelSettings {
            name: "ward".into(),
            description: String::new(),
            static_recordings: read,
            movement_recordings: Vec::new(),
        });
        let job = JobId::new();
        query(
            "INSERT INTO jobs (id, organisation_id, recording_id, state, max_attempts, settings, queued_at)
             VALUES ($1, $2, $3, 'done', 3, $4, 0)",
        )
        .bind(job)
        .bind(clinic.admin.organisation)
        .bind(theirs)
        .bind(serde_json::to_string(&settings).unwrap())
        .execute(&mut transaction)
        .await
        .unwrap();
        query(
            "INSERT INTO noise_models (id, organisation_id, job_id, name, version, sha256, document, created_at)
             VALUES ($1, $2, $3, 'ward', $4, $5, '{}', 0)",
        )
        .bind(crate::storage::NoiseModelId::new())
        .bind(clinic.admin.organisation)
        .bind(job)
        .bind(number as i64 + 1)
        .bind("0".repeat(64))
        .execute(&mut transaction)
        .await
        .unwrap();
    }
    transaction.commit().await.unwrap();
    let (erasure, jobs) = clinic.store.erase_patient(&order(&clinic.admin, clinic.patient, None)).await.unwrap();
    assert_eq!((erasure.removed["noise_models"], jobs.len()), (1, 1));
    let left: Vec<i64> = query("SELECT version FROM noise_models").fetch_values(clinic.store.reader()).await.unwrap();
    assert_eq!(left, [1]);
    assert!(clinic.store.recording(&clinic.admin, theirs).await.is_ok());
}
