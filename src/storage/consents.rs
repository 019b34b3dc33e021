//! Consents: what a patient has agreed to, in which words, until when, and whether it was withdrawn.
//!
//! A consent is valid from the time it was given to its end, if it has one, and until it is withdrawn. Rows are added and
//! stay; a withdrawal is written into the rows that it ends, and a later consent is a row of its own. Withdrawing stops
//! work too, so it is a question of the queue.

use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::{Access, ClientId, ConsentId, PatientId, RecordingId, StorageError, Store, row};
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::ToSchema;

/// What a consent is to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConsentScope {
    /// That recordings are stored and assessed for the patient's own care; without it nothing is uploaded or computed.
    Assessment,
    /// That results may be used for research; kept for whoever exports them, the service itself does nothing with it.
    Research,
}

impl ConsentScope {
    /// The word in the database and at the API.
    pub fn name(self) -> &'static str {
        match self {
            ConsentScope::Assessment => "assessment",
            ConsentScope::Research => "research",
        }
    }
}

/// A consent to be recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewConsent {
    /// What it is to.
    pub scope: ConsentScope,
    /// Which version of the text the patient has agreed to.
    pub text_version: String,
    /// When the patient agreed.
    pub given_at: OffsetDateTime,
    /// When it ends by itself.
    pub expires_at: Option<OffsetDateTime>,
}

/// A consent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consent {
    /// Identity.
    pub id: ConsentId,
    /// What it is to.
    pub scope: ConsentScope,
    /// Which version of the text the patient has agreed to.
    pub text_version: String,
    /// The client that recorded it.
    pub created_by: ClientId,
    /// When the patient agreed.
    pub given_at: OffsetDateTime,
    /// When it ends by itself.
    pub expires_at: Option<OffsetDateTime>,
    /// When it was withdrawn.
    pub withdrawn_at: Option<OffsetDateTime>,
    /// The client that recorded the withdrawal.
    pub withdrawn_by: Option<ClientId>,
    /// When it was recorded.
    pub created_at: OffsetDateTime,
}

/// Whether something may be done with a patient's data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConsentState {
    /// A consent is valid.
    Valid,
    /// None was ever recorded, or none has begun yet.
    Missing,
    /// The latest one has come to its end.
    Expired,
    /// The latest one was withdrawn.
    Withdrawn,
}

impl Consent {
    /// How it stands at a time.
    pub fn state_at(&self, now: OffsetDateTime) -> ConsentState {
        if self.withdrawn_at.is_some() {
            ConsentState::Withdrawn
        } else if self.expires_at.is_some_and(|end| end <= now) {
            ConsentState::Expired
        } else if self.given_at > now {
            ConsentState::Missing
        } else {
            ConsentState::Valid
        }
    }
}

/// How a patient's consent to one scope stands, given all of the patient's consents with the newest first.
pub fn state_of_scope(consents: &[Consent], scope: ConsentScope, now: OffsetDateTime) -> ConsentState {
    let states = || consents.iter().filter(|c| c.scope == scope).map(|c| c.state_at(now));
    let newest = states().find(|state| *state != ConsentState::Missing).unwrap_or(ConsentState::Missing);
    if states().any(|state| state == ConsentState::Valid) { ConsentState::Valid } else { newest }
}

fn consent_from_row(row: &Row) -> Result<Consent, StorageError> {
    Ok(Consent {
        id: row.try_get("id")?,
        scope: row::word(row, "scope")?,
        text_version: row.try_get("text_version")?,
        created_by: row.try_get("created_by")?,
        given_at: row::time(row, "given_at")?,
        expires_at: row::optional_time(row, "expires_at")?,
        withdrawn_at: row::optional_time(row, "withdrawn_at")?,
        withdrawn_by: row.try_get("withdrawn_by")?,
        created_at: row::time(row, "created_at")?,
    })
}

const OF_PATIENT: &str = "SELECT * FROM consents WHERE patient_id = $1 ORDER BY id DESC";

/// Refuses what needs a patient's consent to assessment when there is none. Inside the caller's transaction, so that a
/// withdrawal comes either before it or after it.
pub(crate) async fn require(
    connection: &mut Transaction,
    patient: PatientId,
    now: OffsetDateTime,
) -> Result<(), StorageError> {
    connection.exclusively(&format!("consent {patient}")).await?;
    let rows = query(OF_PATIENT).bind(patient).fetch_all(connection).await?;
    refuse_without(&rows, now)
}

fn refuse_without(rows: &[Row], now: OffsetDateTime) -> Result<(), StorageError> {
    let consents = rows.iter().map(consent_from_row).collect::<Result<Vec<_>, _>>()?;
    match state_of_scope(&consents, ConsentScope::Assessment, now) {
        ConsentState::Valid => Ok(()),
        state => Err(StorageError::NoConsent(state)),
    }
}

/// Like [`require`], for the patient of a recording.
pub(crate) async fn require_for_recording(
    connection: &mut Transaction,
    recording: RecordingId,
    now: OffsetDateTime,
) -> Result<(), StorageError> {
    let patient: Option<PatientId> =
        query("SELECT s.patient_id FROM recordings r JOIN sessions s ON s.id = r.session_id WHERE r.id = $1")
            .bind(recording)
            .fetch_optional_value(&mut *connection)
            .await?;
    require(connection, patient.ok_or(StorageError::not_found("recording"))?, now).await
}

/// Writes a withdrawal into every consent of a scope that has none, and gives back those it has ended.
pub(crate) async fn withdraw(
    connection: &mut Transaction,
    access: &Access,
    patient: PatientId,
    scope: ConsentScope,
    now: OffsetDateTime,
) -> Result<Vec<Consent>, StorageError> {
    connection.exclusively(&format!("consent {patient}")).await?;
    let rows = query(
        "UPDATE consents SET withdrawn_at = $4, withdrawn_by = $5
         WHERE organisation_id = $1 AND patient_id = $2 AND scope = $3 AND withdrawn_at IS NULL RETURNING *",
    )
    .bind(access.organisation)
    .bind(patient)
    .bind(scope.name())
    .bind(ms_from_time(now))
    .bind(access.client)
    .fetch_all(connection)
    .await?;
    rows.iter().map(consent_from_row).collect()
}

impl Store {
    /// Records a consent of a patient of the organisation.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn record_consent(
        &self,
        access: &Access,
        patient: PatientId,
        new: &NewConsent,
    ) -> Result<Consent, StorageError> {
        let mut transaction = self.begin().await?;
        let row = query(
            "INSERT INTO consents (id, organisation_id, patient_id, created_by, scope, text_version, given_at, expires_at,
                                   created_at)
             SELECT $1, p.organisation_id, p.id, $4, $5, $6, $7, $8, $9 FROM patients p
             WHERE p.organisation_id = $2 AND p.id = $3 RETURNING *",
        )
        .bind(ConsentId::new())
        .bind(access.organisation)
        .bind(patient)
        .bind(access.client)
        .bind(new.scope.name())
        .bind(&new.text_version)
        .bind(ms_from_time(new.given_at))
        .bind(new.expires_at.map(ms_from_time))
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut transaction)
        .await?
        .ok_or(StorageError::not_found("patient"))?;
        transaction.commit().await?;
        consent_from_row(&row)
    }

    /// Every consent of a patient of the organisation, newest first.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn consents_of_patient(&self, access: &Access, patient: PatientId) -> Result<Vec<Consent>, StorageError> {
        self.patient(access, patient).await?;
        let rows = query(OF_PATIENT).bind(patient).fetch_all(self.reader()).await?;
        rows.iter().map(consent_from_row).collect()
    }

    /// Refuses when a patient has no valid consent to assessment: the look before the first byte of an upload. What
    /// counts is the look in the transaction that stores it.
    ///
    /// # Errors
    /// `NoConsent`.
    pub async fn require_consent(&self, patient: PatientId) -> Result<(), StorageError> {
        let rows = query(OF_PATIENT).bind(patient).fetch_all(self.reader()).await?;
        refuse_without(&rows, self.now())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::tests::Clinic;
    use time::Duration;

    fn new(given_at: OffsetDateTime, expires_at: Option<OffsetDateTime>) -> NewConsent {
        NewConsent { scope: ConsentScope::Assessment, text_version: "2026-1".into(), given_at, expires_at }
    }

    async fn state(clinic: &Clinic) -> Option<ConsentState> {
        match clinic.store.require_consent(clinic.patient).await {
            Ok(()) => None,
            Err(StorageError::NoConsent(state)) => Some(state),
            Err(other) => panic!("{other}"),
        }
    }

    #[tokio::test]
    async fn a_consent_counts_from_when_it_was_given_to_its_end() {
        let clinic = Clinic::open().await;
        let now = clinic.store.now();
        assert_eq!(state(&clinic).await, Some(ConsentState::Missing));
        let consent = new(now + Duration::hours(1), Some(now + Duration::hours(2)));
        clinic.store.record_consent(&clinic.admin, clinic.patient, &consent).await.unwrap();
        assert_eq!(state(&clinic).await, Some(ConsentState::Missing), "it has not begun");
        clinic.clock.advance(Duration::hours(1));
        assert_eq!(state(&clinic).await, None);
        clinic.clock.advance(Duration::hours(1));
        assert_eq!(state(&clinic).await, Some(ConsentState::Expired));
    }

    #[tokio::test]
    async fn a_consent_to_research_is_none_to_assessment_and_a_stranger_reaches_neither() {
        let clinic = Clinic::open().await;
        let consent = NewConsent { scope: ConsentScope::Research, ..new(clinic.store.now(), None) };
        clinic.store.record_consent(&clinic.admin, clinic.patient, &consent).await.unwrap();
        assert_eq!(state(&clinic).await, Some(ConsentState::Missing));
        let elsewhere = Access { organisation: crate::storage::OrganisationId::new(), ..clinic.admin };
        let refused = clinic.store.record_consent(&elsewhere, clinic.patient, &consent).await;
        assert!(matches!(refused, Err(StorageError::NotFound { what: "patient" })));
        let unseen = clinic.store.consents_of_patient(&elsewhere, clinic.patient).await;
        assert!(matches!(unseen, Err(StorageError::NotFound { what: "patient" })));
    }

    #[tokio::test]
    async fn what_was_withdrawn_stays_so_until_a_new_consent() {
        let clinic = Clinic::open().await;
        let given = new(clinic.store.now(), None);
        clinic.store.record_consent(&clinic.admin, clinic.patient, &given).await.unwrap();
        let mut transaction = clinic.store.begin().await.unwrap();
        let now = clinic.store.now();
        let scope = ConsentScope::Assessment;
        let ended = withdraw(&mut transaction, &clinic.admin, clinic.patient, scope, now).await.unwrap();
        let again = withdraw(&mut transaction, &clinic.admin, clinic.patient, scope, now).await.unwrap();
        transaction.commit().await.unwrap();
        assert_eq!((ended.len(), again.len()), (1, 0));
        assert_eq!(state(&clinic).await, Some(ConsentState::Withdrawn));
        clinic.store.record_consent(&clinic.admin, clinic.patient, &given).await.unwrap();
        assert_eq!(state(&clinic).await, None);
    }
}
