//! What a patient did lately: sessions, their recordings, and what came of each.

use super::access::shared_with;
use super::clock::ms_from_time;
use super::database::{Row, dialects, query};
use super::id::list_of_ids;
use super::{Access, AssessmentId, PatientId, StorageError, Store, row};
use crate::assessment::{Performance, Warning};
use crate::report::TrainedSession;
use crate::report::fhir::AssessmentOrigin;
use crate::report::patient_report::{RecentRecording, RecentSession};
use time::OffsetDateTime;
use uuid::Uuid;

fn recording_from_row(row: &Row) -> Result<RecentRecording, StorageError> {
    let performance: Option<Performance> = row::optional_json(row, "performance")?;
    let warnings: Option<Vec<Warning>> = row::optional_json(row, "warnings")?;
    Ok(RecentRecording {
        id: row.try_get("recording_id")?,
        protocol: row.try_get("recording_protocol")?,
        job_state: row.try_get("state")?,
        job_error: row.try_get("error")?,
        assessment_id: row.try_get("assessment_id")?,
        pipeline: row.try_get("pipeline")?,
        coverage: row.try_get("coverage")?,
        performance: performance.as_ref().map(|performance| performance.status),
        n_repetitions: performance.as_ref().map_or(0, |performance| performance.repetitions.len() as u64),
        performance_reason: performance.map_or_else(String::new, |performance| performance.reason),
        warnings: warnings.unwrap_or_default(),
    })
}

impl Store {
    /// The latest sessions of a patient that had been made known by a time, at most `most`, the newest first, with their
    /// recordings.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn recent_sessions(
        &self,
        access: &Access,
        patient: PatientId,
        by: OffsetDateTime,
        most: u32,
    ) -> Result<Vec<RecentSession>, StorageError> {
        macro_rules! sessions_with {
            ($in_json:literal) => {
                concat!(
                    "SELECT s.id, s.started_at, s.protocol, r.id AS recording_id, j.state, a.id AS assessment_id, a.pipeline,
                            a.performance, ",
                    $in_json,
                    " FROM (SELECT * FROM sessions WHERE patient_id = $2 AND created_at <= $3 AND (organisation_id = $1 OR ",
                    shared_with!("patient_id", "$5", "$6"),
                    ")
                            ORDER BY started_at DESC, id DESC LIMIT $4) s
                           LEFT JOIN recordings r ON r.session_id = s.id AND r.created_at <= $3
                           LEFT JOIN jobs j ON j.id = (SELECT id FROM jobs WHERE recording_id = r.id AND queued_at <= $3
                                                       ORDER BY id DESC LIMIT 1)
                           LEFT JOIN assessments a ON a.id = (SELECT id FROM assessments
                                                              WHERE recording_id = r.id AND created_at <= $3
                                                              ORDER BY id DESC LIMIT 1)
                      ORDER BY s.started_at DESC, s.id DESC, r.id"
                )
            };
        }
        let rows = query(dialects! {
            sqlite: sessions_with!(
                "coalesce(a.performance ->> '$.protocol', r.inspection ->> '$.header.protocol', s.protocol)
                     AS recording_protocol,
                 CASE WHEN j.state = 'failed' THEN j.error ->> '$.sentence' END AS error,
                 a.quality ->> '$.coverage' AS coverage, a.quality -> '$.warnings' AS warnings"
            ),
            postgres: sessions_with!(
                "coalesce(a.performance::json ->> 'protocol', r.inspection::json #>> '{header,protocol}', s.protocol)
                     AS recording_protocol,
                 CASE WHEN j.state = 'failed' THEN j.error::json ->> 'sentence' END AS error,
                 (a.quality::json ->> 'coverage')::float8 AS coverage, a.quality::json ->> 'warnings' AS warnings"
            ),
        })
        .bind(access.organisation)
        .bind(patient)
        .bind(ms_from_time(by))
        .bind(most)
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        let mut sessions: Vec<RecentSession> = Vec::new();
        for row in &rows {
            let id: Uuid = row.try_get("id")?;
            if sessions.last().is_none_or(|last| last.id != id) {
                let (started_at, protocol) = (row::time(row, "started_at")?, row.try_get("protocol")?);
                sessions.push(RecentSession { id, started_at, protocol, recordings: Vec::new() });
            }
            if row.try_get::<Option<Uuid>>("recording_id")?.is_some()
                && let Some(session) = sessions.last_mut()
            {
                session.recordings.push(recording_from_row(row)?);
            }
        }
        Ok(sessions)
    }

    /// The sessions of a patient that began in a stretch of time, with what was done in each.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn trained_sessions(
        &self,
        access: &Access,
        patient: PatientId,
        [from, by]: [OffsetDateTime; 2],
    ) -> Result<Vec<TrainedSession>, StorageError> {
        macro_rules! trained_with {
            ($in_json:literal) => {
                concat!(
                    "SELECT s.id, s.started_at, ",
                    $in_json,
                    " FROM sessions s JOIN recordings r ON r.session_id = s.id AND r.created_at <= $4
                           LEFT JOIN assessments a ON a.id = (SELECT id FROM assessments
                                                              WHERE recording_id = r.id AND created_at <= $4
                                                              ORDER BY id DESC LIMIT 1)
                      WHERE s.patient_id = $2 AND s.started_at BETWEEN $3 AND $4 AND s.created_at <= $4
                        AND (s.organisation_id = $1 OR ",
                    shared_with!("s.patient_id", "$5", "$6"),
                    ") ORDER BY s.started_at, s.id, r.id"
                )
            };
        }
        let rows = query(dialects! {
            sqlite: trained_with!(
                "coalesce(a.performance ->> '$.protocol', r.inspection ->> '$.header.protocol', s.protocol) AS protocol,
                 CASE WHEN a.performance ->> '$.status' = 'measured'
                      THEN json_array_length(a.performance, '$.repetitions') END AS repetitions"
            ),
            postgres: trained_with!(
                "coalesce(a.performance::json ->> 'protocol', r.inspection::json #>> '{header,protocol}', s.protocol)
                     AS protocol,
                 CASE WHEN a.performance::json ->> 'status' = 'measured'
                      THEN json_array_length(a.performance::json -> 'repetitions')::bigint END AS repetitions"
            ),
        })
        .bind(access.organisation)
        .bind(patient)
        .bind(ms_from_time(from))
        .bind(ms_from_time(by))
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        let mut sessions: Vec<(Uuid, TrainedSession)> = Vec::new();
        for row in &rows {
            let id: Uuid = row.try_get("id")?;
            if sessions.last().is_none_or(|(last, _)| *last != id) {
                let session = TrainedSession { started_at: row::time(row, "started_at")?, exercises: Vec::new() };
                sessions.push((id, session));
            }
            let protocol: Option<String> = row.try_get("protocol")?;
            if let Some((_, session)) = sessions.last_mut() {
                session.exercises.push((protocol.unwrap_or_default(), row::optional_small(row, "repetitions")?));
            }
        }
        Ok(sessions.into_iter().map(|(_, session)| session).collect())
    }

    /// What assessments within the caller's reach rest on, in the order of the ids.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn origins_of_assessments(
        &self,
        access: &Access,
        ids: &[AssessmentId],
    ) -> Result<Vec<AssessmentOrigin>, StorageError> {
        macro_rules! origins {
            ($ids:literal) => {
                concat!(
                    "SELECT a.id, a.recording_id, a.created_at, a.provenance
                     FROM assessments a JOIN recordings r ON r.id = a.recording_id JOIN sessions s ON s.id = r.session_id
                     WHERE a.id IN (",
                    $ids,
                    ") AND (a.organisation_id = $1 OR ",
                    shared_with!("s.patient_id", "$3", "$4"),
                    ") ORDER BY a.id"
                )
            };
        }
        let rows = query(dialects! {
            sqlite: origins!("SELECT unhex(value) FROM json_each($2)"),
            postgres: origins!("SELECT value::uuid FROM json_array_elements_text($2::json)"),
        })
        .bind(access.organisation)
        .bind(list_of_ids(ids.iter().map(|id| id.0)))
        .bind(access.receiver())
        .bind(ms_from_time(self.now()))
        .fetch_all(self.reader())
        .await?;
        let origin = |row: &Row| {
            Ok(AssessmentOrigin {
                assessment_id: row.try_get("id")?,
                recording_id: row.try_get("recording_id")?,
                created_at: row::time(row, "created_at")?,
                provenance: row::json(row, "provenance")?,
            })
        };
        rows.iter().map(origin).collect()
    }
}
