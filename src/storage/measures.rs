//! Every value that was measured of a patient, by an assessment or entered by a person. Rows are added and never changed.
//!
//! Of the assessments of one recording the newest counts: what an earlier one measured stays, and is seen again when one
//! asks for what was known at an earlier time.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Row, Transaction, query};
use super::{
    Access, AssessmentId, MeasureId, MeasurementId, Page, PageRequest, PatientId, SessionId, StorageError, Store, row,
};
use crate::assessment::{Performance, PerformanceMeasure, PerformanceStatus};
use crate::body::Side;
use crate::fall_risk::Measures;
use crate::report::measure::{title_of, unit_of};
use crate::report::{MeasureRecord, MeasureSource};
use time::OffsetDateTime;
use uuid::Uuid;

/// Which values are wanted; the default is all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MeasureFilter {
    /// Of this name.
    pub name: Option<String>,
    /// By an assessment of this session.
    pub session_id: Option<SessionId>,
    /// Measured from this time on, and before that one; none is open.
    pub measured: [Option<OffsetDateTime>; 2],
}

/// Values that an assessment of the same recording that came later, but by `$3`, has replaced are left out.
macro_rules! not_replaced {
    () => {
        "NOT EXISTS (SELECT 1 FROM assessments later WHERE later.recording_id = m.recording_id
                     AND later.id > m.assessment_id AND later.performance IS NOT NULL AND later.created_at <= $3)"
    };
}

fn measure_from_row(row: &Row) -> Result<MeasureRecord, StorageError> {
    let entered: Option<Uuid> = row.try_get("measurement_id")?;
    let source = match entered {
        Some(measurement_id) => MeasureSource::Entered { measurement_id },
        None => MeasureSource::Assessment {
            assessment_id: row.try_get("assessment_id")?,
            recording_id: row.try_get("recording_id")?,
            session_id: row.try_get("session_id")?,
        },
    };
    let (name, side): (String, &str) = (row.try_get("name")?, row.try_get("side")?);
    let definition: String = row.try_get("definition")?;
    Ok(MeasureRecord {
        id: row.try_get("id")?,
        title: title_of(&name),
        unit: unit_of(&name).to_owned(),
        name,
        side: Side::BOTH.into_iter().find(|known| known.name() == side),
        value: row.try_get("value")?,
        standard_error: row.try_get("standard_error")?,
        n_observations: row::optional_small(row, "n_observations")?,
        error_sd: row.try_get("error_sd")?,
        definition: Some(definition).filter(|definition| !definition.is_empty()),
        protocol: row.try_get("protocol")?,
        reason: row.try_get("reason")?,
        source,
        measured_at: row::time(row, "measured_at")?,
        created_at: row::time(row, "created_at")?,
    })
}

/// Inserts what an assessment measured, inside the transaction that stores it. Measures without a value are told by the
/// assessment alone.
pub(super) async fn insert_performance(
    connection: &mut Transaction,
    assessment: AssessmentId,
    performance: &Performance,
    now: OffsetDateTime,
) -> Result<(), StorageError> {
    if performance.status != PerformanceStatus::Measured {
        return Ok(());
    }
    for PerformanceMeasure { name, side, value, standard_error, error_sd, n_observations, definition, reason } in
        &performance.measures
    {
        let Some(value) = value.filter(|value| value.is_finite()) else { continue };
        query(
            "INSERT INTO measures (id, organisation_id, patient_id, name, side, value, standard_error, n_observations,
                                   error_sd, definition, protocol, reason, assessment_id, recording_id, session_id,
                                   measured_at, created_at)
             SELECT $1, a.organisation_id, s.patient_id, $3, $4, $5, $6, $7, $8, $9, $10, $11, a.id, r.id, s.id,
                    s.started_at, $12
             FROM assessments a JOIN recordings r ON r.id = a.recording_id JOIN sessions s ON s.id = r.session_id
             WHERE a.id = $2",
        )
        .bind(MeasureId::new())
        .bind(assessment)
        .bind(name)
        .bind(side.map_or("", Side::name))
        .bind(value)
        .bind(*standard_error)
        .bind(n_observations.map(|n| u32::try_from(n).unwrap_or(u32::MAX)))
        .bind(*error_sd)
        .bind(definition.as_deref().unwrap_or_default())
        .bind(&performance.protocol)
        .bind(reason)
        .bind(ms_from_time(now))
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

/// Inserts what a person entered, inside the transaction that stores the measurement.
pub(super) async fn insert_entered(
    connection: &mut Transaction,
    measurement: MeasurementId,
    measures: &Measures,
) -> Result<(), StorageError> {
    for (name, measured) in measures.entered() {
        query(
            "INSERT INTO measures (id, organisation_id, patient_id, name, value, standard_error, n_observations, error_sd,
                                   measurement_id, measured_at, created_at)
             SELECT $1, m.organisation_id, m.patient_id, $3, $4, $5, $6, $7, m.id, m.measured_at, m.created_at
             FROM measurements m WHERE m.id = $2",
        )
        .bind(MeasureId::new())
        .bind(measurement)
        .bind(name)
        .bind(measured.value)
        .bind(measured.standard_error)
        .bind(measured.n_observations)
        .bind(measured.error_sd)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

impl Store {
    /// One measure of a patient of the organisation, and the patient.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn measure(&self, access: &Access, id: MeasureId) -> Result<(MeasureRecord, PatientId), StorageError> {
        let row = query(concat!(
            "SELECT * FROM measures WHERE id = $2 AND (organisation_id = $1 OR ",
            shared_with!("patient_id", "$3", "$4"),
            ")"
        ))
        .bind(access.organisation)
        .bind(id)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("measure"))?;
        Ok((measure_from_row(&row)?, row.try_get("patient_id")?))
    }

    /// The value of each measure, side and definition that was measured last, of what had been stored by a time.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn newest_measures(
        &self,
        access: &Access,
        patient: PatientId,
        by: OffsetDateTime,
    ) -> Result<Vec<MeasureRecord>, StorageError> {
        let rows = query(concat!(
            "SELECT found.* FROM measures found WHERE (found.organisation_id = $1 OR ",
            shared_with!("found.patient_id", "$4", "$5"),
            ") AND found.id IN (
                 SELECT (SELECT m.id FROM measures m
                         WHERE m.patient_id = $2 AND m.name = known.name AND m.side = known.side
                           AND m.definition = known.definition AND m.created_at <= $3
                           AND ",
            not_replaced!(),
            "            ORDER BY m.measured_at DESC, m.id DESC LIMIT 1)
                 FROM (SELECT DISTINCT name, side, definition FROM measures WHERE patient_id = $2) known)
             ORDER BY found.name, found.side, found.definition"
        ))
        .bind(access.organisation)
        .bind(patient)
        .bind(ms_from_time(by))
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        rows.iter().map(measure_from_row).collect()
    }

    /// The latest values of the measure, side and definition of `like` that had been stored by a time, at most `most`, the
    /// earliest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn course_of_measure(
        &self,
        access: &Access,
        patient: PatientId,
        like: &MeasureRecord,
        by: OffsetDateTime,
        most: u32,
    ) -> Result<Vec<MeasureRecord>, StorageError> {
        let rows = query(concat!(
            "SELECT m.* FROM measures m
             WHERE m.patient_id = $2 AND m.created_at <= $3 AND m.name = $4 AND m.side = $5 AND m.definition = $7
               AND (m.organisation_id = $1 OR ",
            shared_with!("m.patient_id", "$8", "$9"),
            ") AND ",
            not_replaced!(),
            " ORDER BY m.measured_at DESC, m.id DESC LIMIT $6"
        ))
        .bind(access.organisation)
        .bind(patient)
        .bind(ms_from_time(by))
        .bind(&like.name)
        .bind(like.side.map_or("", Side::name))
        .bind(most)
        .bind(like.definition.as_deref().unwrap_or_default())
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        rows.iter().rev().map(measure_from_row).collect()
    }

    /// The values of a patient, those stored last first, also those that were replaced.
    ///
    /// # Errors
    /// `NotFound` when the organisation has no such patient.
    pub async fn measures_of_patient(
        &self,
        access: &Access,
        patient: PatientId,
        filter: &MeasureFilter,
        page: &PageRequest<MeasureId>,
    ) -> Result<Page<MeasureRecord, MeasureId>, StorageError> {
        self.patient(access, patient).await?;
        let rows = query(concat!(
            "SELECT m.* FROM measures m
             WHERE (m.organisation_id = $1 OR ",
            shared_with!("m.patient_id", "$9", "$10"),
            ") AND m.patient_id = $2 AND m.id < $3 AND ($4 IS NULL OR m.name = $4)
               AND ($5 IS NULL OR m.session_id = $5)
               AND ($7 IS NULL OR m.measured_at >= $7) AND ($8 IS NULL OR m.measured_at < $8)
             ORDER BY m.id DESC LIMIT $6"
        ))
        .bind(access.organisation)
        .bind(patient)
        .bind(page.cursor())
        .bind(&filter.name)
        .bind(filter.session_id)
        .bind(page.rows())
        .bind(filter.measured[0].map(ms_from_time))
        .bind(filter.measured[1].map(ms_from_time))
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        let measures = rows.iter().map(measure_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(measures, page, |measure| MeasureId(measure.id)))
    }
}
