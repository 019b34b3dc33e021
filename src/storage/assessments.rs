//! Assessments: what one pipeline found in one recording. Written once, together with the end of its job, and never
//! changed.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Row, Transaction, dialects, query};
use super::joint_tracks::{self, EncodedTrack};
use super::measures;
use super::series::{self, EncodedSeries};
use super::{
    Access, AssessmentId, JobId, Page, PageRequest, PatientId, RecordingId, SessionId, StorageError, Store, row,
};
use crate::assessment::quality::CalibrationQuality;
use crate::assessment::{Assessment, ChannelSummary, Gait, Performance, Provenance, Quality};
use time::OffsetDateTime;

/// An assessment without its series; [`Store::series_of_assessment`] brings those.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredAssessment {
    /// Identity.
    pub id: AssessmentId,
    /// The recording that was assessed.
    pub recording_id: RecordingId,
    /// The recording's session.
    pub session_id: SessionId,
    /// The session's patient.
    pub patient_id: PatientId,
    /// The job that made it.
    pub job_id: JobId,
    /// The pipeline.
    pub pipeline: String,
    /// The method within the pipeline.
    pub method: String,
    /// Names of the series.
    pub channels: Vec<String>,
    /// One line per series.
    pub summary: Vec<ChannelSummary>,
    /// Steps, when the pipeline finds steps.
    pub gait: Option<Gait>,
    /// How the exercise or test was performed; none in assessments from before it was measured.
    pub performance: Option<Performance>,
    /// How far the result can be trusted.
    pub quality: Quality,
    /// What is needed to compute the same bytes again; the settings are in it.
    pub provenance: Provenance,
    /// Samples of each series.
    pub n_samples: u64,
    /// Time of the first sample, nanoseconds on the recording's clock; `None` without samples.
    pub start_time_ns: Option<i64>,
    /// Time of the last sample.
    pub end_time_ns: Option<i64>,
    /// When it was stored.
    pub created_at: OffsetDateTime,
}

/// Which assessments are wanted; the default is all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AssessmentFilter {
    /// Of this recording.
    pub recording_id: Option<RecordingId>,
    /// Of this session.
    pub session_id: Option<SessionId>,
    /// Of this patient.
    pub patient_id: Option<PatientId>,
    /// By this pipeline.
    pub pipeline: Option<String>,
    /// By this method.
    pub method: Option<String>,
}

fn assessment_from_row(row: &Row) -> Result<StoredAssessment, StorageError> {
    Ok(StoredAssessment {
        id: row.try_get("id")?,
        recording_id: row.try_get("recording_id")?,
        session_id: row.try_get("session_id")?,
        patient_id: row.try_get("patient_id")?,
        job_id: row.try_get("job_id")?,
        pipeline: row.try_get("pipeline")?,
        method: row.try_get("method")?,
        channels: row::json(row, "channels")?,
        summary: row::json(row, "summary")?,
        gait: row::optional_json(row, "gait")?,
        performance: row::optional_json(row, "performance")?,
        quality: row::json(row, "quality")?,
        provenance: row::json(row, "provenance")?,
        n_samples: row::count(row, "n_samples")?,
        start_time_ns: row.try_get("start_time_ns")?,
        end_time_ns: row.try_get("end_time_ns")?,
        created_at: row::time(row, "created_at")?,
    })
}

/// An assessment in the form in which it is inserted.
#[derive(Debug)]
pub(crate) struct EncodedAssessment {
    pipeline: &'static str,
    method: String,
    channels: String,
    summary: String,
    gait: Option<String>,
    performance: Option<(String, Performance)>,
    joints: Option<EncodedTrack>,
    quality: String,
    provenance: String,
    n_samples: i64,
    start_time_ns: Option<i64>,
    end_time_ns: Option<i64>,
    series: EncodedSeries,
}

impl EncodedAssessment {
    /// Codes an assessment: computation only, to be done before the transaction.
    pub(crate) fn encode(assessment: &Assessment) -> Result<Self, StorageError> {
        let channels: Vec<String> = assessment.series.iter().map(|series| series.channel.clone()).collect();
        Ok(Self {
            pipeline: assessment.pipeline,
            method: assessment.provenance.method.clone(),
            channels: row::readable_json("the channel names", &channels)?,
            summary: row::readable_json("the summary", &assessment.summary)?,
            gait: assessment.gait.as_ref().map(|gait| row::readable_json("the gait", gait)).transpose()?,
            performance: assessment.performance.as_ref().map(with_json).transpose()?,
            joints: assessment.joints.as_ref().map(EncodedTrack::encode).transpose()?,
            quality: row::readable_json("the quality", &assessment.quality)?,
            provenance: row::readable_json("the provenance", &assessment.provenance)?,
            n_samples: assessment.time_ns.len() as i64,
            start_time_ns: assessment.time_ns.first().copied(),
            end_time_ns: assessment.time_ns.last().copied(),
            series: EncodedSeries::encode(assessment)?,
        })
    }
}

fn with_json(performance: &Performance) -> Result<(String, Performance), StorageError> {
    Ok((row::readable_json("the performance", performance)?, performance.clone()))
}

/// Inserts an assessment inside the transaction that ends its job, and what it measured of the patient.
pub(crate) async fn insert(
    connection: &mut Transaction,
    recording_id: RecordingId,
    job_id: JobId,
    encoded: &EncodedAssessment,
    now: OffsetDateTime,
) -> Result<AssessmentId, StorageError> {
    let id = AssessmentId::new();
    query(
        "INSERT INTO assessments (id, organisation_id, recording_id, job_id, pipeline, method, channels, summary, quality, provenance,
                                  n_samples, start_time_ns, end_time_ns, created_at, gait, performance)
         SELECT $1, r.organisation_id, r.id, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15
         FROM recordings r WHERE r.id = $2",
    )
    .bind(id)
    .bind(recording_id)
    .bind(job_id)
    .bind(encoded.pipeline)
    .bind(&encoded.method)
    .bind(&encoded.channels)
    .bind(&encoded.summary)
    .bind(&encoded.quality)
    .bind(&encoded.provenance)
    .bind(encoded.n_samples)
    .bind(encoded.start_time_ns)
    .bind(encoded.end_time_ns)
    .bind(ms_from_time(now))
    .bind(&encoded.gait)
    .bind(encoded.performance.as_ref().map(|(json, _)| json))
    .execute(&mut *connection)
    .await?;
    series::insert(connection, id, &encoded.series).await?;
    if let Some(track) = &encoded.joints {
        joint_tracks::insert(connection, id, track).await?;
    }
    if let Some((_, performance)) = &encoded.performance {
        measures::insert_performance(connection, id, performance, now).await?;
    }
    Ok(id)
}

impl Store {
    /// One assessment within the caller's reach.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn assessment(&self, access: &Access, id: AssessmentId) -> Result<StoredAssessment, StorageError> {
        let row = query(concat!(
            "SELECT a.*, r.session_id, s.patient_id
             FROM assessments a JOIN recordings r ON r.id = a.recording_id JOIN sessions s ON s.id = r.session_id
             WHERE a.id = $3 AND ((a.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)) OR ",
            shared_with!("s.patient_id", "$4", "$5"),
            ")"
        ))
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(id)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("assessment"))?;
        assessment_from_row(&row)
    }

    /// The assessments within the caller's reach, newest first; those of a shared patient when it, a session or a recording is
    /// asked for.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn assessments(
        &self,
        access: &Access,
        filter: &AssessmentFilter,
        page: &PageRequest<AssessmentId>,
    ) -> Result<Page<StoredAssessment, AssessmentId>, StorageError> {
        // An index can serve a condition only if it is there whatever is bound, hence one text per case.
        macro_rules! assessments_where {
            ($($indexed:expr),+) => {
                concat!(
                    "SELECT a.*, r.session_id, s.patient_id
                     FROM assessments a JOIN recordings r ON r.id = a.recording_id
                          JOIN sessions s ON s.id = r.session_id
                     WHERE a.id < $3
                       AND ($7 IS NULL OR a.pipeline = $7)
                       AND ($8 IS NULL OR a.method = $8)
                       AND ",
                    $($indexed,)+
                    " ORDER BY a.id DESC LIMIT $9"
                )
            };
        }
        macro_rules! assessments_about {
            ($indexed:literal) => {
                assessments_where!(
                    $indexed,
                    " AND ((a.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)) OR ",
                    shared_with!("s.patient_id", "$10", "$11"),
                    ")"
                )
            };
        }
        let question = match (filter.recording_id, filter.session_id, filter.patient_id) {
            (Some(_), _, _) => assessments_about!(
                "a.recording_id = $4 AND ($5 IS NULL OR r.session_id = $5) AND ($6 IS NULL OR s.patient_id = $6)"
            ),
            (None, Some(_), _) => {
                assessments_about!("$4 IS NULL AND r.session_id = $5 AND ($6 IS NULL OR s.patient_id = $6)")
            }
            (None, None, Some(_)) => assessments_about!("$4 IS NULL AND $5 IS NULL AND s.patient_id = $6"),
            (None, None, None) => assessments_where!(
                "$4 IS NULL AND $5 IS NULL AND $6 IS NULL AND a.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)"
            ),
        };
        let mut question = query(question)
            .bind(access.organisation)
            .bind(access.only_sessions_of())
            .bind(page.cursor())
            .bind(filter.recording_id)
            .bind(filter.session_id)
            .bind(filter.patient_id)
            .bind(&filter.pipeline)
            .bind(&filter.method)
            .bind(page.rows());
        if filter.recording_id.is_some() || filter.session_id.is_some() || filter.patient_id.is_some() {
            question = question.bind(access.receiver()).bind(ms_from_time(self.now()));
        }
        let rows = question.fetch_all(self.reader()).await?;
        let assessments = rows.iter().map(assessment_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(assessments, page, |assessment| assessment.id))
    }

    /// The calibration of the best other recording of a job's patient: of those assessed the newest with a static window,
    /// or else the one with the least uncertainty. For the worker, which serves every organisation; none outside the job's
    /// own, and none of the job's recording, which would count itself twice.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn patient_calibration_of_job(
        &self,
        job: JobId,
    ) -> Result<Option<(AssessmentId, CalibrationQuality)>, StorageError> {
        macro_rules! calibrations {
            ($in_json:literal) => {
                concat!(
                    "SELECT id, calibration FROM (SELECT a.id, ",
                    $in_json,
                    " FROM jobs j
                           JOIN recordings own ON own.id = j.recording_id
                           JOIN sessions own_session ON own_session.id = own.session_id
                           JOIN sessions s ON s.patient_id = own_session.patient_id
                                          AND s.organisation_id = j.organisation_id
                           JOIN recordings r ON r.session_id = s.id AND r.id <> own.id
                           JOIN assessments a ON a.recording_id = r.id AND a.organisation_id = j.organisation_id
                      WHERE j.id = $1) found
                     WHERE uncertainty IS NOT NULL
                     ORDER BY is_static DESC, CASE WHEN is_static = 1 THEN 0 ELSE uncertainty END, id DESC LIMIT 1"
                )
            };
        }
        let row = query(dialects! {
            sqlite: calibrations!(
                "a.quality -> '$.calibration' AS calibration,
                 CASE WHEN a.quality ->> '$.calibration.source' = 'static_window' THEN 1 ELSE 0 END AS is_static,
                 a.quality ->> '$.calibration.measured_uncertainty_m' AS uncertainty"
            ),
            postgres: calibrations!(
                "a.quality::json ->> 'calibration' AS calibration,
                 CASE WHEN a.quality::json #>> '{calibration,source}' = 'static_window' THEN 1 ELSE 0 END AS is_static,
                 (a.quality::json #>> '{calibration,measured_uncertainty_m}')::float8 AS uncertainty"
            ),
        })
        .bind(job)
        .fetch_optional(self.reader())
        .await?;
        row.map(|row| Ok((row.try_get("id")?, row::json(&row, "calibration")?))).transpose()
    }

    /// Names of the series of an assessment within the caller's reach.
    pub(super) async fn channels_of_assessment(
        &self,
        access: &Access,
        id: AssessmentId,
    ) -> Result<Vec<String>, StorageError> {
        let row = query(concat!(
            "SELECT a.channels
             FROM assessments a JOIN recordings r ON r.id = a.recording_id JOIN sessions s ON s.id = r.session_id
             WHERE a.id = $3 AND ((a.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)) OR ",
            shared_with!("s.patient_id", "$4", "$5"),
            ")"
        ))
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(id)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_optional(self.reader())
        .await?
        .ok_or(StorageError::not_found("assessment"))?;
        row::json(&row, "channels")
    }
}
