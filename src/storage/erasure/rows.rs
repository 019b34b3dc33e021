//! The rows of a patient: what they are, and in which order they can go.

use super::ErasedBlob;
use crate::assessment::Settings;
use crate::storage::database::{Row, Transaction, query};
use crate::storage::{JobId, OrganisationId, PatientId, RecordingId, ResumableUploadId, StorageError, row};
use std::collections::{BTreeMap, HashSet};

/// What was removed.
#[derive(Debug, Default)]
pub(super) struct Removed {
    /// Rows by table.
    pub(super) counts: BTreeMap<String, u64>,
    /// Bytes of the recordings, the same ones once.
    pub(super) blobs: Vec<ErasedBlob>,
    /// Jobs that are no more.
    pub(super) jobs: Vec<JobId>,
    /// Uploads that may have a file.
    pub(super) uploads: Vec<ResumableUploadId>,
}

/// A piece of SQL: the recordings of a patient.
macro_rules! recordings {
    () => {
        "SELECT r.id FROM recordings r JOIN sessions s ON s.id = r.session_id WHERE s.patient_id = $1"
    };
}

/// A piece of SQL: the assessments of a patient.
macro_rules! assessments {
    () => {
        "SELECT a.id FROM assessments a JOIN recordings r ON r.id = a.recording_id
              JOIN sessions s ON s.id = r.session_id WHERE s.patient_id = $1"
    };
}

/// A piece of SQL: the uploads that resume, or are over, of a patient.
macro_rules! uploads {
    () => {
        "SELECT u.id FROM resumable_uploads u JOIN sessions s ON s.id = u.session_id WHERE s.patient_id = $1"
    };
}

/// Everything that hangs on a patient: what refers to something comes before it.
const TABLES: [(&str, &str); 15] = [
    ("shares", "DELETE FROM shares WHERE patient_id = $1"),
    ("resumable_uploads", concat!("DELETE FROM resumable_uploads WHERE id IN (", uploads!(), ")")),
    ("measures", "DELETE FROM measures WHERE patient_id = $1"),
    ("joint_tracks", concat!("DELETE FROM joint_tracks WHERE assessment_id IN (", assessments!(), ")")),
    ("time_chunks", concat!("DELETE FROM time_chunks WHERE assessment_id IN (", assessments!(), ")")),
    ("series_chunks", concat!("DELETE FROM series_chunks WHERE assessment_id IN (", assessments!(), ")")),
    ("assessments", concat!("DELETE FROM assessments WHERE recording_id IN (", recordings!(), ")")),
    ("jobs", concat!("DELETE FROM jobs WHERE recording_id IN (", recordings!(), ")")),
    ("recordings", "DELETE FROM recordings WHERE session_id IN (SELECT id FROM sessions WHERE patient_id = $1)"),
    ("sessions", "DELETE FROM sessions WHERE patient_id = $1"),
    ("questionnaires", "DELETE FROM questionnaires WHERE patient_id = $1"),
    ("measurements", "DELETE FROM measurements WHERE patient_id = $1"),
    ("training_plans", "DELETE FROM training_plans WHERE patient_id = $1"),
    ("consents", "DELETE FROM consents WHERE patient_id = $1"),
    // Whatever refers to the patient and is not named here makes this one fail, and the erasure with it.
    ("patients", "DELETE FROM patients WHERE id = $1"),
];

/// Removes the rows of a patient, inside the caller's transaction.
pub(super) async fn remove(connection: &mut Transaction, patient: PatientId) -> Result<Removed, StorageError> {
    let organisation: OrganisationId =
        query("SELECT organisation_id FROM patients WHERE id = $1").bind(patient).fetch_value(&mut *connection).await?;
    let mut removed = Removed {
        blobs: blobs(&mut *connection, patient).await?,
        jobs: query(concat!("SELECT id FROM jobs WHERE recording_id IN (", recordings!(), ")"))
            .bind(patient)
            .fetch_values(&mut *connection)
            .await?,
        uploads: query(uploads!())
            .bind(patient)
            .fetch_values::<String>(&mut *connection)
            .await?
            .iter()
            .filter_map(|id| id.parse().ok())
            .collect(),
        ..Removed::default()
    };
    let models = remove_trainings(&mut *connection, organisation, patient, &mut removed.jobs).await?;
    removed.counts.insert("noise_models".to_owned(), models);
    let answers = remove_kept_answers(&mut *connection, organisation, patient).await?;
    removed.counts.insert("idempotency_keys".to_owned(), answers);
    for (table, statement) in TABLES {
        let done = query(statement).bind(patient).execute(&mut *connection).await?;
        removed.counts.insert(table.to_owned(), done);
    }
    Ok(removed)
}

async fn blobs(connection: &mut Transaction, patient: PatientId) -> Result<Vec<ErasedBlob>, StorageError> {
    let rows = query(
        "SELECT DISTINCT r.sha256, r.size_bytes,
                CAST(CASE WHEN EXISTS (SELECT 1 FROM recordings o JOIN sessions t ON t.id = o.session_id
                                  WHERE o.blob_key = r.blob_key AND o.content_removed_at IS NULL AND t.patient_id <> $1)
                     THEN 1 ELSE 0 END AS BIGINT) AS is_shared
         FROM recordings r JOIN sessions s ON s.id = r.session_id
         WHERE s.patient_id = $1 AND r.content_removed_at IS NULL ORDER BY r.sha256",
    )
    .bind(patient)
    .fetch_all(connection)
    .await?;
    let blob = |row: &Row| {
        let is_shared: i64 = row.try_get("is_shared")?;
        Ok(ErasedBlob {
            sha256: row.try_get("sha256")?,
            size_bytes: row::count(row, "size_bytes")?,
            is_shared: is_shared != 0,
        })
    };
    rows.iter().map(blob).collect()
}

/// Removes trainings that read recordings of the patient, also those that began with another patient's, and the models that came
/// of them: they name the recordings, and were learnt from them.
async fn remove_trainings(
    connection: &mut Transaction,
    organisation: OrganisationId,
    patient: PatientId,
    jobs: &mut Vec<JobId>,
) -> Result<u64, StorageError> {
    let own: Vec<RecordingId> = query(recordings!()).bind(patient).fetch_values(&mut *connection).await?;
    let own: HashSet<RecordingId> = own.into_iter().collect();
    let rows = query(
        "SELECT id, settings FROM jobs WHERE organisation_id = $1 AND settings LIKE '%\"pipeline\":\"noise_model\"%'",
    )
    .bind(organisation)
    .fetch_all(&mut *connection)
    .await?;
    let mut models = 0;
    for row in &rows {
        let id: JobId = row.try_get("id")?;
        let settings: Settings = row::json(row, "settings")?;
        if !settings.training_recordings().any(|recording| own.contains(&RecordingId(recording))) {
            continue;
        }
        let done = query("DELETE FROM noise_models WHERE job_id = $1").bind(id).execute(&mut *connection).await?;
        models += done;
        query("DELETE FROM jobs WHERE id = $1").bind(id).execute(&mut *connection).await?;
        if !jobs.contains(&id) {
            jobs.push(id);
        }
    }
    Ok(models)
}

/// Removes the answers to uploads that are kept for a repeated request.
async fn remove_kept_answers(
    connection: &mut Transaction,
    organisation: OrganisationId,
    patient: PatientId,
) -> Result<u64, StorageError> {
    let rows = query(
        "SELECT k.client_id, k.key, k.body FROM idempotency_keys k JOIN clients c ON c.id = k.client_id
         WHERE c.organisation_id = $1",
    )
    .bind(organisation)
    .fetch_all(&mut *connection)
    .await?;
    let id = patient.to_string();
    let mut removed = 0;
    for row in &rows {
        let body: &[u8] = row.try_get("body")?;
        if !body.windows(id.len()).any(|part| part == id.as_bytes()) {
            continue;
        }
        let (client, key): (crate::storage::ClientId, &str) = (row.try_get("client_id")?, row.try_get("key")?);
        let done = query("DELETE FROM idempotency_keys WHERE client_id = $1 AND key = $2")
            .bind(client)
            .bind(key)
            .execute(&mut *connection)
            .await?;
        removed += done;
    }
    Ok(removed)
}
