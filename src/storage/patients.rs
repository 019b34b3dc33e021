//! Patients, known by pseudonym only.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Row, query};
use super::{Access, OrganisationId, Page, PageRequest, PatientId, StorageError, Store, row};
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use utoipa::ToSchema;

/// Sex, as reference values distinguish it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sex {
    /// Female.
    Female,
    /// Male.
    Male,
    /// Neither of the two, or not to be said.
    Other,
}

impl Sex {
    /// The word in the database and at the API.
    pub fn name(self) -> &'static str {
        match self {
            Sex::Female => "female",
            Sex::Male => "male",
            Sex::Other => "other",
        }
    }
}

/// A patient to be made.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NewPatient {
    /// Pseudonym, unique in the organisation.
    pub pseudonym: String,
    /// Year of birth.
    pub birth_year: Option<u16>,
    /// Sex.
    pub sex: Option<Sex>,
    /// Stature, metres.
    pub height_m: Option<f64>,
    /// Whether the patient walks with an aid.
    pub uses_walking_aid: Option<bool>,
}

/// A patient.
#[derive(Debug, Clone, PartialEq)]
pub struct Patient {
    /// Identity.
    pub id: PatientId,
    /// Pseudonym, unique in the organisation.
    pub pseudonym: String,
    /// Year of birth.
    pub birth_year: Option<u16>,
    /// Sex.
    pub sex: Option<Sex>,
    /// Stature, metres.
    pub height_m: Option<f64>,
    /// Whether the patient walks with an aid.
    pub uses_walking_aid: Option<bool>,
    /// When the row was made.
    pub created_at: OffsetDateTime,
}

/// Which patients are wanted; the default is all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PatientFilter {
    /// How the pseudonym begins; upper and lower case differ.
    pub pseudonym_prefix: Option<String>,
    /// A piece of the pseudonym; upper and lower case are the same.
    pub pseudonym_part: Option<String>,
}

fn patient_from_row(row: &Row) -> Result<Patient, StorageError> {
    let sex: Option<&str> = row.try_get("sex")?;
    Ok(Patient {
        id: row.try_get("id")?,
        pseudonym: row.try_get("pseudonym")?,
        birth_year: row::optional_small(row, "birth_year")?,
        sex: sex.map(|_| row::word(row, "sex")).transpose()?,
        height_m: row.try_get("height_m")?,
        uses_walking_aid: row.try_get("uses_walking_aid")?,
        created_at: row::time(row, "created_at")?,
    })
}

impl Store {
    /// Makes a patient in the caller's organisation.
    ///
    /// # Errors
    /// `Conflict` with code `pseudonym_taken`.
    pub async fn create_patient(&self, access: &Access, new: &NewPatient) -> Result<Patient, StorageError> {
        let mut transaction = self.begin().await?;
        let row = query(
            "INSERT INTO patients (id, organisation_id, pseudonym, birth_year, sex, height_m, uses_walking_aid, created_at)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8) RETURNING *",
        )
        .bind(PatientId::new())
        .bind(access.organisation)
        .bind(&new.pseudonym)
        .bind(new.birth_year)
        .bind(new.sex.map(Sex::name))
        .bind(new.height_m)
        .bind(new.uses_walking_aid)
        .bind(ms_from_time(self.now()))
        .fetch_one(&mut transaction)
        .await
        .map_err(|error| {
            StorageError::conflict_if_not_unique(error, "pseudonym_taken", || {
                format!("there is already a patient with the pseudonym `{}`", new.pseudonym)
            })
        })?;
        transaction.commit().await?;
        patient_from_row(&row)
    }

    /// Changes a patient of the organisation: reads it, lets `change` alter it, and writes it, all in one transaction.
    /// What identifies it (`id`, `created_at`) stays whatever `change` does.
    ///
    /// # Errors
    /// `NotFound` when there is none; `Conflict` with code `pseudonym_taken`.
    pub async fn update_patient(
        &self,
        access: &Access,
        id: PatientId,
        change: impl FnOnce(&mut Patient) + Send,
    ) -> Result<Patient, StorageError> {
        let mut transaction = self.begin().await?;
        let row = query("SELECT * FROM patients WHERE organisation_id = $1 AND id = $2")
            .bind(access.organisation)
            .bind(id)
            .fetch_optional(&mut transaction)
            .await?
            .ok_or(StorageError::not_found("patient"))?;
        let mut patient = patient_from_row(&row)?;
        change(&mut patient);
        let row = query(
            "UPDATE patients SET pseudonym = $3, birth_year = $4, sex = $5, height_m = $6, uses_walking_aid = $7
             WHERE organisation_id = $1 AND id = $2 RETURNING *",
        )
        .bind(access.organisation)
        .bind(id)
        .bind(&patient.pseudonym)
        .bind(patient.birth_year)
        .bind(patient.sex.map(Sex::name))
        .bind(patient.height_m)
        .bind(patient.uses_walking_aid)
        .fetch_one(&mut transaction)
        .await
        .map_err(|error| {
            StorageError::conflict_if_not_unique(error, "pseudonym_taken", || {
                format!("there is already a patient with the pseudonym `{}`", patient.pseudonym)
            })
        })?;
        transaction.commit().await?;
        patient_from_row(&row)
    }

    /// One patient of the organisation, or one that is shared with the caller.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn patient(&self, access: &Access, id: PatientId) -> Result<Patient, StorageError> {
        let row = query(concat!(
            "SELECT * FROM patients WHERE id = $2 AND (organisation_id = $1 OR ",
            shared_with!("id", "$3", "$4"),
            ")"
        ))
        .bind(access.organisation)
        .bind(id)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("patient"))?;
        patient_from_row(&row)
    }

    /// The organisation of a patient, for the operator at the machine.
    ///
    /// # Errors
    /// `NotFound` when there is no such patient.
    pub async fn organisation_of_patient(&self, id: PatientId) -> Result<OrganisationId, StorageError> {
        let found = query("SELECT organisation_id FROM patients WHERE id = $1").bind(id);
        found.fetch_optional_value(self.reader()).await?.ok_or(StorageError::not_found("patient"))
    }

    /// The patients of the organisation, newest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn patients(
        &self,
        access: &Access,
        filter: &PatientFilter,
        page: &PageRequest<PatientId>,
    ) -> Result<Page<Patient, PatientId>, StorageError> {
        // A text holds another when it changes as that is taken out.
        let rows = query(
            "SELECT * FROM patients
             WHERE organisation_id = $1
               AND id < $2
               AND ($3 IS NULL OR substr(pseudonym, 1, length($3)) = $3)
               AND ($4 IS NULL OR replace(lower(pseudonym), lower($4), '') <> lower(pseudonym))
             ORDER BY id DESC LIMIT $5",
        )
        .bind(access.organisation)
        .bind(page.cursor())
        .bind(&filter.pseudonym_prefix)
        .bind(&filter.pseudonym_part)
        .bind(page.rows())
        .fetch_all(self.reader())
        .await?;
        let patients = rows.iter().map(patient_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(patients, page, |patient| patient.id))
    }
}
