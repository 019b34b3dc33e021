//! Retention: what is removed because it is old. Each rule is off until the operator sets it, because the law decides how long
//! something must and may be kept. Every removal leaves an entry in the audit log.

use super::audit::{Actor, AuditEvent, Thing, ThingKind};
use super::clock::ms_from_time;
use super::database::{Row, query};
use super::erasure::ErasureOrder;
use super::{ErasureReason, OrganisationId, PatientId, RecordingId, StorageError, Store};
use crate::config::Config;
use serde::Serialize;
use serde_json::json;
use time::{Duration, OffsetDateTime};

/// How long things are kept; none keeps them for ever.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RetentionRules {
    /// Bytes of recordings that have been assessed, from their upload on.
    pub recordings: Option<Duration>,
    /// Patients, from their last session on.
    pub patients: Option<Duration>,
    /// Entries of the audit log.
    pub audit: Option<Duration>,
}

impl From<&Config> for RetentionRules {
    fn from(config: &Config) -> Self {
        let days = |days: u32| (days > 0).then(|| Duration::days(i64::from(days)));
        Self {
            recordings: days(config.retain_recordings_days),
            patients: days(config.retain_patients_days),
            audit: days(config.retain_audit_days),
        }
    }
}

/// A recording whose bytes are due.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DueRecording {
    /// The recording.
    pub id: RecordingId,
    /// Its organisation.
    pub organisation_id: OrganisationId,
    #[serde(skip)]
    blob_key: String,
}

/// A patient who is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct DuePatient {
    /// The patient.
    pub id: PatientId,
    /// The patient's organisation.
    pub organisation_id: OrganisationId,
}

/// What the rules take away at a time.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct RetentionPlan {
    /// Recordings whose bytes go, and whose results stay.
    pub recordings: Vec<DueRecording>,
    /// Patients who are erased.
    pub patients: Vec<DuePatient>,
    /// Entries of the audit log.
    pub audit_entries: u64,
    /// Answers kept for repeated requests that are over.
    pub kept_answers: u64,
}

/// What was taken away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Retained {
    /// Recordings whose bytes went.
    pub recordings: u64,
    /// Patients who were erased.
    pub patients: u64,
    /// Entries of the audit log.
    pub audit_entries: u64,
    /// Answers kept for repeated requests.
    pub kept_answers: u64,
}

impl Store {
    /// What the rules take away now.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn retention_plan(&self, rules: &RetentionRules) -> Result<RetentionPlan, StorageError> {
        let now = self.now();
        let mut plan = RetentionPlan { kept_answers: self.count_over_answers(now).await?, ..RetentionPlan::default() };
        if let Some(age) = rules.patients {
            plan.patients = self.due_patients(now - age).await?;
        }
        if let Some(age) = rules.recordings {
            plan.recordings = self.due_recordings(now - age).await?;
        }
        if let Some(age) = rules.audit {
            plan.audit_entries = self.count_audit_before(now - age).await?;
        }
        Ok(plan)
    }

    /// Takes away what the rules say. `of` makes the actor that entries of an organisation name.
    ///
    /// # Errors
    /// When the database or the disk fails; what was taken away until then is.
    pub async fn apply_retention(
        &self,
        rules: &RetentionRules,
        of: fn(Option<OrganisationId>) -> Actor,
    ) -> Result<Retained, StorageError> {
        let plan = self.retention_plan(rules).await?;
        let mut done = Retained::default();
        for patient in &plan.patients {
            let order = ErasureOrder {
                organisation: patient.organisation_id,
                patient: patient.id,
                reason: ErasureReason::Retention,
                actor: of(Some(patient.organisation_id)),
                request_id: "",
                confirmation: None,
            };
            done.patients += u64::from(self.erase_rows(&order).await?.is_some());
        }
        // The files are cleaned once for all of them.
        self.resume_erasures().await?;
        for recording in &plan.recordings {
            done.recordings += u64::from(self.remove_content(recording, of(Some(recording.organisation_id))).await?);
        }
        if plan.kept_answers > 0 {
            done.kept_answers = self.remove_over_answers(of(None)).await?;
        }
        if let Some(age) = rules.audit {
            done.audit_entries = self.remove_audit_before(self.now() - age, of(None)).await?;
        }
        Ok(done)
    }

    async fn due_patients(&self, before: OffsetDateTime) -> Result<Vec<DuePatient>, StorageError> {
        let rows = query(
            "SELECT p.id, p.organisation_id FROM patients p
             WHERE p.created_at < $1
               AND NOT EXISTS (SELECT 1 FROM sessions s
                               WHERE s.patient_id = p.id AND (s.started_at >= $1 OR s.created_at >= $1))
             ORDER BY p.id",
        )
        .bind(ms_from_time(before))
        .fetch_all(self.reader())
        .await?;
        rows.iter()
            .map(|row| Ok(DuePatient { id: row.try_get("id")?, organisation_id: row.try_get("organisation_id")? }))
            .collect()
    }

    /// Recordings that have been assessed and that no job needs; a training that is not over may need any.
    async fn due_recordings(&self, before: OffsetDateTime) -> Result<Vec<DueRecording>, StorageError> {
        let rows = query(
            "SELECT r.id, r.organisation_id, r.blob_key FROM recordings r
             WHERE r.content_removed_at IS NULL AND r.created_at < $1
               AND EXISTS (SELECT 1 FROM assessments a WHERE a.recording_id = r.id)
               AND NOT EXISTS (SELECT 1 FROM jobs j
                               WHERE j.organisation_id = r.organisation_id AND j.due_at IS NOT NULL
                                 AND (j.recording_id = r.id OR j.settings LIKE '%\"pipeline\":\"noise_model\"%'))
             ORDER BY r.id",
        )
        .bind(ms_from_time(before))
        .fetch_all(self.reader())
        .await?;
        let due = |row: &Row| {
            Ok(DueRecording {
                id: row.try_get("id")?,
                organisation_id: row.try_get("organisation_id")?,
                blob_key: row.try_get("blob_key")?,
            })
        };
        rows.iter().map(due).collect()
    }

    /// Removes the bytes of a recording and says so in its row; false when a job has begun to need them. The bytes go before the
    /// transaction ends: after a crash in between, the next run does the rest.
    async fn remove_content(&self, recording: &DueRecording, actor: Actor) -> Result<bool, StorageError> {
        let now = self.now();
        let mut transaction = self.begin().await?;
        let marked = query(
            "UPDATE recordings SET content_removed_at = $2
             WHERE id = $1 AND content_removed_at IS NULL
               AND NOT EXISTS (SELECT 1 FROM jobs j
                               WHERE j.organisation_id = $3 AND j.due_at IS NOT NULL
                                 AND (j.recording_id = $1 OR j.settings LIKE '%\"pipeline\":\"noise_model\"%'))",
        )
        .bind(recording.id)
        .bind(ms_from_time(now))
        .bind(recording.organisation_id)
        .execute(&mut transaction)
        .await?;
        if marked == 0 {
            return Ok(false);
        }
        let named: i64 = query("SELECT count(*) FROM recordings WHERE blob_key = $1 AND content_removed_at IS NULL")
            .bind(&recording.blob_key)
            .fetch_value(&mut transaction)
            .await?;
        if named == 0 {
            self.blobs().remove(&recording.blob_key).await?;
        }
        let thing = Thing { kind: ThingKind::Recording, id: recording.id.0 };
        let event = AuditEvent::of_command(now, actor, "retention: recording", Some(thing), String::new());
        self.audit_within(&mut transaction, event).await?;
        transaction.commit().await?;
        Ok(true)
    }

    async fn count_over_answers(&self, now: OffsetDateTime) -> Result<u64, StorageError> {
        let n: i64 = query("SELECT count(*) FROM idempotency_keys WHERE expires_at <= $1")
            .bind(ms_from_time(now))
            .fetch_value(self.reader())
            .await?;
        Ok(n.unsigned_abs())
    }

    async fn remove_over_answers(&self, actor: Actor) -> Result<u64, StorageError> {
        let now = self.now();
        let mut transaction = self.begin().await?;
        let removed = query("DELETE FROM idempotency_keys WHERE expires_at <= $1")
            .bind(ms_from_time(now))
            .execute(&mut transaction)
            .await?;
        let detail = json!({"answers": removed}).to_string();
        let event = AuditEvent::of_command(now, actor, "retention: kept answers", None, detail);
        self.audit_within(&mut transaction, event).await?;
        transaction.commit().await?;
        Ok(removed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::Clinic;

    const RULES: RetentionRules = RetentionRules {
        recordings: Some(Duration::days(30)),
        patients: Some(Duration::days(365)),
        audit: Some(Duration::days(1000)),
    };

    /// A job and an assessment of a recording, as the worker leaves them; `due` is when a worker may take the job.
    async fn assessed(clinic: &Clinic, recording: RecordingId, due: Option<i64>) {
        let mut transaction = clinic.store.begin().await.unwrap();
        let job = crate::storage::JobId::new();
        query(
            "INSERT INTO jobs (id, organisation_id, recording_id, state, max_attempts, due_at, settings, queued_at)
             VALUES ($1, $2, $3, CASE WHEN $4 IS NULL THEN 'done' ELSE 'queued' END, 3, $4, '{}', 0)",
        )
        .bind(job)
        .bind(clinic.admin.organisation)
        .bind(recording)
        .bind(due)
        .execute(&mut transaction)
        .await
        .unwrap();
        query(
            "INSERT INTO assessments (id, organisation_id, recording_id, job_id, pipeline, method, channels, summary,
                                      quality, provenance, n_samples, created_at)
             VALUES ($1, $2, $3, $4, 'joint_angles', 'iekf', '[]', '[]', '{}', '{}', 0, 0)",
        )
        .bind(crate::storage::AssessmentId::new())
        .bind(clinic.admin.organisation)
        .bind(recording)
        .bind(job)
        .execute(&mut transaction)
        .await
        .unwrap();
        transaction.commit().await.unwrap();
    }

    #[tokio::test]
    async fn without_rules_nothing_is_removed() {
        let clinic = Clinic::open().await;
        let recording = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
        assessed(&clinic, recording.id, None).await;
        clinic.clock.advance(Duration::days(10_000));
        let rules = RetentionRules::from(&Config::default());
        assert_eq!(clinic.store.apply_retention(&rules, Actor::service).await.unwrap(), Retained::default());
    }

    #[tokio::test]
    async fn the_bytes_of_an_assessed_recording_go_in_time_and_its_results_stay() {
        let clinic = Clinic::open().await;
        if clinic.rows_are_elsewhere() {
            return;
        }
        let waiting = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
        assessed(&clinic, waiting.id, Some(0)).await;
        let done = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
        assessed(&clinic, done.id, None).await;
        clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
        clinic.clock.advance(Duration::days(29));
        assert_eq!(clinic.store.retention_plan(&RULES).await.unwrap(), RetentionPlan::default());
        clinic.clock.advance(Duration::days(2));
        let plan = clinic.store.retention_plan(&RULES).await.unwrap();
        assert_eq!(plan.recordings.iter().map(|due| due.id).collect::<Vec<_>>(), [done.id]);
        assert_eq!(clinic.store.apply_retention(&RULES, Actor::service).await.unwrap().recordings, 1);
        let stored = clinic.store.recording(&clinic.admin, done.id).await.unwrap();
        assert!(stored.content_removed_at.is_some());
        assert_eq!(clinic.store.ailments(true).await.unwrap(), [], "others have the same bytes");
        assert_eq!(clinic.store.apply_retention(&RULES, Actor::service).await.unwrap(), Retained::default());
        assert_eq!(clinic.store.verify_audit(None).await.unwrap().n_entries, 1);
    }

    #[tokio::test]
    async fn the_last_recording_takes_the_bytes_with_it() {
        let clinic = Clinic::open().await;
        if clinic.rows_are_elsewhere() {
            return;
        }
        let recording = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
        assessed(&clinic, recording.id, None).await;
        clinic.clock.advance(Duration::days(31));
        clinic.store.apply_retention(&RULES, Actor::service).await.unwrap();
        assert_eq!(clinic.store.blobs().keys().await.unwrap(), [""; 0]);
        assert_eq!(clinic.store.ailments(true).await.unwrap(), []);
    }

    #[tokio::test]
    async fn a_patient_without_a_session_for_long_is_erased_and_the_audit_log_knows_why() {
        let clinic = Clinic::open().await;
        clinic.clock.advance(Duration::days(366));
        assert_eq!(clinic.store.retention_plan(&RULES).await.unwrap().patients[0].id, clinic.patient);
        let done = clinic.store.apply_retention(&RULES, Actor::service).await.unwrap();
        assert_eq!(done.patients, 1);
        assert!(clinic.store.patient(&clinic.admin, clinic.patient).await.is_err());
        let all = clinic.store.audit_entries(clinic.admin.organisation, &Default::default(), None, 10).await.unwrap();
        assert_eq!((all.len(), all[0].actor_kind.as_str()), (1, "service"));
        assert!(all[0].detail.contains("\"reason\":\"retention\""), "{}", all[0].detail);
        clinic.clock.advance(Duration::days(1001));
        let done = clinic.store.apply_retention(&RULES, Actor::service).await.unwrap();
        assert_eq!(done.audit_entries, 1);
        assert_eq!(clinic.store.verify_audit(None).await.unwrap().broken, None);
    }
}
