//! One patient, readable to one clinician of another organisation until a time. The condition by which a question reaches what is
//! shared is `access::shared_with`.

use super::clock::ms_from_time;
use super::database::{Row, query};
use super::{Access, ClientId, PatientId, ShareId, StorageError, Store, row};
use time::OffsetDateTime;

/// Shares of a patient that a list shows, the newest.
const MOST_LISTED: i64 = 500;

/// A patient that is, or was, shared.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Share {
    /// Identity.
    pub id: ShareId,
    /// Who can be read.
    pub patient_id: PatientId,
    /// Pseudonym of the patient.
    pub pseudonym: String,
    /// Who reads.
    pub receiver_id: ClientId,
    /// Who reads, for people.
    pub receiver_label: String,
    /// Name of the receiver's organisation.
    pub receiver_organisation: String,
    /// Who shared.
    pub created_by: ClientId,
    /// Name of the organisation whose patient it is.
    pub organisation: String,
    /// Since when.
    pub created_at: OffsetDateTime,
    /// Until when, unless it is revoked.
    pub expires_at: OffsetDateTime,
    /// When it was revoked.
    pub revoked_at: Option<OffsetDateTime>,
}

/// Shares with the words that people need, under a condition.
macro_rules! shares_where {
    ($condition:expr) => {
        concat!(
            "SELECT h.*, p.pseudonym, c.label AS receiver_label, co.name AS receiver_organisation, o.name AS organisation
             FROM shares h JOIN patients p ON p.id = h.patient_id JOIN clients c ON c.id = h.receiver_id
                  JOIN organisations co ON co.id = c.organisation_id JOIN organisations o ON o.id = h.organisation_id
             WHERE ",
            $condition,
            " ORDER BY h.id DESC LIMIT $3"
        )
    };
}

fn share_from_row(row: &Row) -> Result<Share, StorageError> {
    Ok(Share {
        id: row.try_get("id")?,
        patient_id: row.try_get("patient_id")?,
        pseudonym: row.try_get("pseudonym")?,
        receiver_id: row.try_get("receiver_id")?,
        receiver_label: row.try_get("receiver_label")?,
        receiver_organisation: row.try_get("receiver_organisation")?,
        created_by: row.try_get("created_by")?,
        organisation: row.try_get("organisation")?,
        created_at: row::time(row, "created_at")?,
        expires_at: row::time(row, "expires_at")?,
        revoked_at: row::optional_time(row, "revoked_at")?,
    })
}

impl Store {
    /// Shares a patient of the organisation with a clinician or an administrator of another one.
    ///
    /// # Errors
    /// `NotFound` (`patient`, `clinician`); `Conflict` with code `own_clinician` for one of the organisation itself.
    pub async fn share_patient(
        &self,
        access: &Access,
        patient: PatientId,
        receiver: ClientId,
        expires_at: OffsetDateTime,
    ) -> Result<Share, StorageError> {
        let mut transaction = self.begin().await?;
        let own: i64 = query("SELECT count(*) FROM patients WHERE organisation_id = $1 AND id = $2")
            .bind(access.organisation)
            .bind(patient)
            .fetch_value(&mut transaction)
            .await?;
        if own == 0 {
            return Err(StorageError::not_found("patient"));
        }
        let found = query(
            "SELECT organisation_id FROM clients
             WHERE id = $1 AND role IN ('clinician', 'admin') AND revoked_at IS NULL
               AND (expires_at IS NULL OR expires_at > $2)",
        )
        .bind(receiver)
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut transaction)
        .await?
        .ok_or(StorageError::not_found("clinician"))?;
        if found.try_get::<super::OrganisationId>("organisation_id")? == access.organisation {
            let sentence = "This clinician belongs to your organisation and sees its patients anyway.".to_owned();
            return Err(StorageError::Conflict { code: "own_clinician", sentence });
        }
        let id = ShareId::new();
        query(
            "INSERT INTO shares (id, organisation_id, patient_id, receiver_id, created_by, created_at, expires_at)
             VALUES ($1, $2, $3, $4, $5, $6, $7)",
        )
        .bind(id)
        .bind(access.organisation)
        .bind(patient)
        .bind(receiver)
        .bind(access.client)
        .bind(ms_from_time(self.now()))
        .bind(ms_from_time(expires_at))
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        tracing::info!(event = "patient_shared", share = %id, by = %access.client, "a patient was shared");
        self.share(access, id).await
    }

    async fn share(&self, access: &Access, id: ShareId) -> Result<Share, StorageError> {
        let row = query(shares_where!("h.organisation_id = $1 AND h.id = $2"))
            .bind(access.organisation)
            .bind(id)
            .bind(1_i64)
            .fetch_optional(self.reader())
            .await?
            .ok_or(StorageError::not_found("share"))?;
        share_from_row(&row)
    }

    /// With whom a patient of the organisation is shared, or was, the newest first.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn shares_of_patient(&self, access: &Access, patient: PatientId) -> Result<Vec<Share>, StorageError> {
        self.patient(&access.own(), patient).await?;
        let rows = query(shares_where!("h.organisation_id = $1 AND h.patient_id = $2"))
            .bind(access.organisation)
            .bind(patient)
            .bind(MOST_LISTED)
            .fetch_all(self.reader())
            .await?;
        rows.iter().map(share_from_row).collect()
    }

    /// What is shared with the caller now, the newest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn shares_received(&self, access: &Access) -> Result<Vec<Share>, StorageError> {
        let question = shares_where!("h.receiver_id = $1 AND h.revoked_at IS NULL AND h.expires_at > $2");
        let rows = query(question)
            .bind(access.receiver())
            .bind(ms_from_time(self.now()))
            .bind(MOST_LISTED)
            .fetch_all(self.reader())
            .await?;
        rows.iter().map(share_from_row).collect()
    }

    /// Ends a share, at once. Doing it again changes nothing.
    ///
    /// # Errors
    /// `NotFound` when the organisation has made no such share.
    pub async fn revoke_share(&self, access: &Access, id: ShareId) -> Result<Share, StorageError> {
        let mut transaction = self.begin().await?;
        query("UPDATE shares SET revoked_at = coalesce(revoked_at, $3) WHERE organisation_id = $1 AND id = $2")
            .bind(access.organisation)
            .bind(id)
            .bind(ms_from_time(self.now()))
            .execute(&mut transaction)
            .await?;
        transaction.commit().await?;
        let share = self.share(access, id).await?;
        tracing::info!(event = "share_revoked", share = %id, by = %access.client, "a share was revoked");
        Ok(share)
    }
}
