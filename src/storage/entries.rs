//! What people enter about a patient: answers, results of tests, training plans. Rows are added and never changed; of answers
//! and plans the newest counts as a whole.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Column, Row, query};
use super::{
    Access, MeasurementId, Page, PageRequest, PatientId, QuestionnaireId, StorageError, Store, TrainingPlanId,
    measures, row,
};
use crate::fall_risk::{Answers, Measures};
use crate::report::TrainingPlan;
use time::OffsetDateTime;

/// One entry.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry<Id, T> {
    /// Identity.
    pub id: Id,
    /// What was entered.
    pub content: T,
    /// When it was added.
    pub created_at: OffsetDateTime,
}

/// Results of tests on one occasion.
#[derive(Debug, Clone, PartialEq)]
pub struct Occasion {
    /// When the tests were done.
    pub measured_at: OffsetDateTime,
    /// What was measured.
    pub measures: Measures,
}

/// Three questions about a table of entries of which the newest counts: add one, read a page, read the newest.
macro_rules! entries {
    ($table:literal, $column:literal, $id:ident, $content:ident, $add:ident, $page:ident, $newest:ident) => {
        impl Store {
            /// Adds an entry to a patient of the organisation.
            ///
            /// # Errors
            /// `NotFound` when the organisation has no such patient.
            pub async fn $add(
                &self,
                access: &Access,
                patient: PatientId,
                content: &$content,
            ) -> Result<Entry<$id, $content>, StorageError> {
                let mut transaction = self.begin().await?;
                let row = query(concat!(
                    "INSERT INTO ",
                    $table,
                    " (id, organisation_id, patient_id, created_by, ",
                    $column,
                    ", created_at)
                     SELECT $1, p.organisation_id, p.id, $4, $5, $6 FROM patients p
                     WHERE p.organisation_id = $2 AND p.id = $3 RETURNING *",
                ))
                .bind($id::new())
                .bind(access.organisation)
                .bind(patient)
                .bind(access.client)
                .bind(row::readable_json($column, content)?)
                .bind(ms_from_time(self.now()))
                .fetch_optional(&mut transaction)
                .await?
                .ok_or(StorageError::not_found("patient"))?;
                transaction.commit().await?;
                entry_from_row(&row, row::json(&row, $column)?)
            }

            /// The entries of a patient, newest first.
            ///
            /// # Errors
            /// `NotFound` when the organisation has no such patient.
            pub async fn $page(
                &self,
                access: &Access,
                patient: PatientId,
                page: &PageRequest<$id>,
            ) -> Result<Page<Entry<$id, $content>, $id>, StorageError> {
                self.patient(access, patient).await?;
                let rows = query(concat!(
                    "SELECT * FROM ",
                    $table,
                    " WHERE patient_id = $2 AND id < $3 AND (organisation_id = $1 OR ",
                    shared_with!("patient_id", "$5", "$6"),
                    ") ORDER BY id DESC LIMIT $4",
                ))
                .bind(access.organisation)
                .bind(patient)
                .bind(page.cursor())
                .bind(page.rows())
                .bind(access.receiver())
                .bind(ms_from_time(self.now()))
                .fetch_all(self.reader())
                .await?;
                let entries = rows.iter().map(|row| entry_from_row(row, row::json(row, $column)?));
                Ok(Page::from_rows(entries.collect::<Result<_, _>>()?, page, |entry| entry.id))
            }

            /// The newest entry of a patient that had been added by a time.
            ///
            /// # Errors
            /// When the database fails.
            pub async fn $newest(
                &self,
                access: &Access,
                patient: PatientId,
                by: OffsetDateTime,
            ) -> Result<Option<Entry<$id, $content>>, StorageError> {
                let row = query(concat!(
                    "SELECT * FROM ",
                    $table,
                    " WHERE patient_id = $2 AND created_at <= $3 AND (organisation_id = $1 OR ",
                    shared_with!("patient_id", "$4", "$5"),
                    ") ORDER BY id DESC LIMIT 1",
                ))
                .bind(access.organisation)
                .bind(patient)
                .bind(ms_from_time(by))
                .bind(access.receiver())
                .bind(ms_from_time(self.now()))
                .fetch_optional(self.reader())
                .await?;
                row.map(|row| entry_from_row(&row, row::json(&row, $column)?)).transpose()
            }
        }
    };
}

entries!("questionnaires", "answers", QuestionnaireId, Answers, add_answers, answers_of_patient, newest_answers);
entries!("training_plans", "plan", TrainingPlanId, TrainingPlan, add_plan, plans_of_patient, newest_plan);

fn entry_from_row<'r, Id: Column<'r>, T>(row: &'r Row, content: T) -> Result<Entry<Id, T>, StorageError> {
    Ok(Entry { id: row.try_get("id")?, content, created_at: row::time(row, "created_at")? })
}

fn occasion_from_row(row: &Row) -> Result<Entry<MeasurementId, Occasion>, StorageError> {
    let content = Occasion { measured_at: row::time(row, "measured_at")?, measures: row::json(row, "measures")? };
    entry_from_row(row, content)
}

impl Store {
    /// Adds results of tests of a patient of the organisation; each also counts as a measure of its own.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn add_occasion(
        &self,
        access: &Access,
        patient: PatientId,
        occasion: &Occasion,
    ) -> Result<Entry<MeasurementId, Occasion>, StorageError> {
        let mut transaction = self.begin().await?;
        let id = MeasurementId::new();
        let row = query(
            "INSERT INTO measurements (id, organisation_id, patient_id, created_by, measured_at, measures, created_at)
             SELECT $1, p.organisation_id, p.id, $4, $5, $6, $7 FROM patients p
             WHERE p.organisation_id = $2 AND p.id = $3 RETURNING *",
        )
        .bind(id)
        .bind(access.organisation)
        .bind(patient)
        .bind(access.client)
        .bind(ms_from_time(occasion.measured_at))
        .bind(row::readable_json("measures", &occasion.measures)?)
        .bind(ms_from_time(self.now()))
        .fetch_optional(&mut transaction)
        .await?
        .ok_or(StorageError::not_found("patient"))?;
        measures::insert_entered(&mut transaction, id, &occasion.measures).await?;
        transaction.commit().await?;
        occasion_from_row(&row)
    }

    /// The results of tests of a patient, those added last first.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn occasions_of_patient(
        &self,
        access: &Access,
        patient: PatientId,
        page: &PageRequest<MeasurementId>,
    ) -> Result<Page<Entry<MeasurementId, Occasion>, MeasurementId>, StorageError> {
        self.patient(access, patient).await?;
        let rows = query(concat!(
            "SELECT * FROM measurements WHERE patient_id = $2 AND id < $3 AND (organisation_id = $1 OR ",
            shared_with!("patient_id", "$5", "$6"),
            ") ORDER BY id DESC LIMIT $4"
        ))
        .bind(access.organisation)
        .bind(patient)
        .bind(page.cursor())
        .bind(page.rows())
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        let occasions = rows.iter().map(occasion_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(occasions, page, |occasion| occasion.id))
    }
}
