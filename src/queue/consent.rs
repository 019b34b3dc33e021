//! Consent and work: none without it, and an end to it when it is withdrawn or the patient is erased.

use super::{JobState, Queue};
use crate::assessment::Settings;
use crate::storage::clock::ms_from_time;
use crate::storage::database::{Transaction, query};
use crate::storage::erasure::ErasureOrder;
use crate::storage::{
    Access, Consent, ConsentScope, Erasure, JobId, PatientId, RecordingId, StorageError, consents, row,
};
use time::OffsetDateTime;

/// What a withdrawal came to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Withdrawal {
    /// The consents that it ended.
    pub consents: Vec<Consent>,
    /// Jobs that waited and will not run.
    pub jobs_cancelled: u64,
    /// Jobs that ran: their workers stop at the next look, and a result that comes meanwhile is not stored.
    pub jobs_stopped: u64,
}

impl Queue {
    /// Ends every consent of a patient to a scope. Without one to assessment, jobs on the patient's recordings end at once,
    /// those that run too. Asking again changes nothing.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn withdraw_consent(
        &self,
        access: &Access,
        patient: PatientId,
        scope: ConsentScope,
    ) -> Result<Withdrawal, StorageError> {
        let now = self.store.now();
        self.store.patient(access, patient).await?;
        let mut transaction = self.store.begin().await?;
        let consents = consents::withdraw(&mut transaction, access, patient, scope, now).await?;
        let stops_work = scope == ConsentScope::Assessment && self.settings.require_consent;
        let ended = match stops_work {
            true => end_jobs_of_patient(&mut transaction, patient, now).await?,
            false => Vec::new(),
        };
        transaction.commit().await?;
        if stops_work {
            self.store.uploads().stop(patient);
        }
        let count = |state| ended.iter().filter(|(_, was)| *was == state).count() as u64;
        let (jobs_cancelled, jobs_stopped) = (count(JobState::Queued), count(JobState::Running));
        ended.into_iter().for_each(|(id, _)| self.announce(id));
        Ok(Withdrawal { consents, jobs_cancelled, jobs_stopped })
    }

    /// Erases a patient; whoever watches one of the jobs that end with it hears of that.
    ///
    /// # Errors
    /// See [`Store::erase_patient`](crate::storage::Store::erase_patient).
    pub async fn erase_patient(&self, order: &ErasureOrder<'_>) -> Result<Erasure, StorageError> {
        let (erasure, jobs) = self.store.erase_patient(order).await?;
        jobs.into_iter().for_each(|id| self.announce(id));
        Ok(erasure)
    }

    /// Refuses a job on recordings of a patient without consent; a training is a job on all of its recordings.
    pub(super) async fn check_consent(
        &self,
        connection: &mut Transaction,
        recording: RecordingId,
        settings: &Settings,
    ) -> Result<(), StorageError> {
        if !self.settings.require_consent {
            return Ok(());
        }
        let now = self.store.now();
        consents::require_for_recording(&mut *connection, recording, now).await?;
        for other in settings.training_recordings().map(RecordingId) {
            consents::require_for_recording(&mut *connection, other, now).await?;
        }
        Ok(())
    }
}

/// Ends the jobs that read a patient's recordings, also those of other patients' that train a model with them. One that runs is
/// over from here on: whatever its worker writes finds no running job, and its next heartbeat tells it so.
async fn end_jobs_of_patient(
    connection: &mut Transaction,
    patient: PatientId,
    now: OffsetDateTime,
) -> Result<Vec<(JobId, JobState)>, StorageError> {
    let rows = query(
        "SELECT j.id, j.state, j.settings, s.patient_id FROM jobs j JOIN recordings r ON r.id = j.recording_id
              JOIN sessions s ON s.id = r.session_id
         WHERE j.due_at IS NOT NULL
           AND j.organisation_id = (SELECT organisation_id FROM patients WHERE id = $1)",
    )
    .bind(patient)
    .fetch_all(&mut *connection)
    .await?;
    let mut ended = Vec::new();
    for job in &rows {
        let (id, state): (JobId, JobState) = (job.try_get("id")?, row::word(job, "state")?);
        let mut reads_patient = job.try_get::<PatientId>("patient_id")? == patient;
        let settings: Settings = row::json(job, "settings")?;
        for recording in settings.training_recordings().map(RecordingId) {
            reads_patient = reads_patient || is_of_patient(&mut *connection, recording, patient).await?;
        }
        if !reads_patient {
            continue;
        }
        query(
            "UPDATE jobs SET state = 'cancelled', cancel_requested = TRUE, due_at = NULL, finished_at = $2 WHERE id = $1",
        )
        .bind(id)
        .bind(ms_from_time(now))
        .execute(&mut *connection)
        .await?;
        ended.push((id, state));
    }
    Ok(ended)
}

async fn is_of_patient(
    connection: &mut Transaction,
    recording: RecordingId,
    patient: PatientId,
) -> Result<bool, StorageError> {
    let found: Option<PatientId> =
        query("SELECT s.patient_id FROM recordings r JOIN sessions s ON s.id = r.session_id WHERE r.id = $1")
            .bind(recording)
            .fetch_optional_value(connection)
            .await?;
    Ok(found == Some(patient))
}
