//! What rules about falls rest on: answers and results of tests. Rows are added and never changed.

use super::clock::ms_from_time;
use super::{Access, MeasurementId, Page, PageRequest, PatientId, QuestionnaireId, StorageError, Store, row};
use crate::fall_risk::{Answers, Measures};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;
use time::OffsetDateTime;

/// One set of answers.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredAnswers {
    /// Identity.
    pub id: QuestionnaireId,
    /// What was answered.
    pub answers: Answers,
    /// When it was added.
    pub created_at: OffsetDateTime,
}

/// Results of tests on one occasion.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredMeasures {
    /// Identity.
    pub id: MeasurementId,
    /// When the tests were done.
    pub measured_at: OffsetDateTime,
    /// What was measured.
    pub measures: Measures,
    /// When it was added.
    pub created_at: OffsetDateTime,
}

fn answers_from_row(row: &SqliteRow) -> Result<StoredAnswers, StorageError> {
    Ok(StoredAnswers {
        id: row.try_get("id")?,
        answers: row::json(row, "answers")?,
        created_at: row::time(row, "created_at")?,
    })
}

fn measures_from_row(row: &SqliteRow) -> Result<StoredMeasures, StorageError> {
    Ok(StoredMeasures {
        id: row.try_get("id")?,
        measured_at: row::time(row, "measured_at")?,
        measures: row::json(row, "measures")?,
        created_at: row::time(row, "created_at")?,
    })
}

impl Store {
    /// Adds answers of a patient of the organisation.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn add_answers(
        &self,
        access: &Access,
        patient: PatientId,
        answers: &Answers,
    ) -> Result<StoredAnswers, StorageError> {
        let mut transaction = self.begin().await?;
        let row = sqlx::query(
            "INSERT INTO questionnaires (id, organisation_id, patient_id, created_by, answers, created_at)
             SELECT ?1, p.organisation_id, p.id, ?4, ?5, ?6 FROM patients p
             WHERE p.organisation_id = ?2 AND p.id = ?3 RETURNING *",
        )
        .bind(QuestionnaireId::new())
        .bind(access.organisation)
        .bind(patient)
        .bind(access.client)
        .bind(row::readable_json("answers", answers)?)
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut *transaction)
        .await?
        .ok_or(StorageError::not_found("patient"))?;
        transaction.commit().await?;
        answers_from_row(&row)
    }

    /// Adds results of tests of a patient of the organisation.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn add_measures(
        &self,
        access: &Access,
        patient: PatientId,
        measured_at: OffsetDateTime,
        measures: &Measures,
    ) -> Result<StoredMeasures, StorageError> {
        let mut transaction = self.begin().await?;
        let row = sqlx::query(
            "INSERT INTO measurements (id, organisation_id, patient_id, created_by, measured_at, measures, created_at)
             SELECT ?1, p.organisation_id, p.id, ?4, ?5, ?6, ?7 FROM patients p
             WHERE p.organisation_id = ?2 AND p.id = ?3 RETURNING *",
        )
        .bind(MeasurementId::new())
        .bind(access.organisation)
        .bind(patient)
        .bind(access.client)
        .bind(ms_from_time(measured_at))
        .bind(row::readable_json("measures", measures)?)
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut *transaction)
        .await?
        .ok_or(StorageError::not_found("patient"))?;
        transaction.commit().await?;
        measures_from_row(&row)
    }

    /// The answers of a patient, newest first.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn answers_of_patient(
        &self,
        access: &Access,
        patient: PatientId,
        page: &PageRequest<QuestionnaireId>,
    ) -> Result<Page<StoredAnswers, QuestionnaireId>, StorageError> {
        self.patient(access, patient).await?;
        let rows = sqlx::query(
            "SELECT * FROM questionnaires WHERE organisation_id = ?1 AND patient_id = ?2 AND id < ?3
             ORDER BY id DESC LIMIT ?4",
        )
        .bind(access.organisation)
        .bind(patient)
        .bind(page.cursor())
        .bind(page.rows())
        .fetch_all(self.reader())
        .await?;
        let answers = rows.iter().map(answers_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(answers, page, |answers| answers.id))
    }

    /// The results of tests of a patient, those added last first.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn measures_of_patient(
        &self,
        access: &Access,
        patient: PatientId,
        page: &PageRequest<MeasurementId>,
    ) -> Result<Page<StoredMeasures, MeasurementId>, StorageError> {
        self.patient(access, patient).await?;
        let rows = sqlx::query(
            "SELECT * FROM measurements WHERE organisation_id = ?1 AND patient_id = ?2 AND id < ?3
             ORDER BY id DESC LIMIT ?4",
        )
        .bind(access.organisation)
        .bind(patient)
        .bind(page.cursor())
        .bind(page.rows())
        .fetch_all(self.reader())
        .await?;
        let measures = rows.iter().map(measures_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(measures, page, |measures| measures.id))
    }

    /// The newest answers of a patient that had been added by a time.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn newest_answers(
        &self,
        access: &Access,
        patient: PatientId,
        by: OffsetDateTime,
    ) -> Result<Option<StoredAnswers>, StorageError> {
        let row = sqlx::query(
            "SELECT * FROM questionnaires WHERE organisation_id = ?1 AND patient_id = ?2 AND created_at <= ?3
             ORDER BY id DESC LIMIT 1",
        )
        .bind(access.organisation)
        .bind(patient)
        .bind(ms_from_time(by))
        .fetch_optional(self.reader())
        .await?;
        row.as_ref().map(answers_from_row).transpose()
    }

    /// The latest results of a patient's tests that had been added by a time, those measured last first, at most `most`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn latest_measures(
        &self,
        access: &Access,
        patient: PatientId,
        by: OffsetDateTime,
        most: u32,
    ) -> Result<Vec<StoredMeasures>, StorageError> {
        let rows = sqlx::query(
            "SELECT * FROM measurements WHERE organisation_id = ?1 AND patient_id = ?2 AND created_at <= ?3
             ORDER BY measured_at DESC, id DESC LIMIT ?4",
        )
        .bind(access.organisation)
        .bind(patient)
        .bind(ms_from_time(by))
        .bind(most)
        .fetch_all(self.reader())
        .await?;
        rows.iter().map(measures_from_row).collect()
    }
}
