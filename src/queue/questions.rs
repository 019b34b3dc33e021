//! Looking at jobs.

use super::job::job_from_row;
use super::{Job, JobFilter, JobState, Queue};
use crate::storage::database::query;
use crate::storage::{Access, JobId, Page, PageRequest, StorageError, row};

impl Queue {
    /// One job within the caller's reach.
    ///
    /// # Errors
    /// `NotFound` when there is none.
    pub async fn job(&self, access: &Access, id: JobId) -> Result<Job, StorageError> {
        let row = query(
            "SELECT j.*, r.session_id, a.id AS assessment_id, n.id AS noise_model_id,
                    CASE WHEN j.state = 'queued'
                         THEN (SELECT count(*) FROM jobs w
                               WHERE w.due_at IS NOT NULL AND w.state = 'queued' AND (w.turn_at, w.id) < (j.turn_at, j.id))
                         END AS n_ahead
             FROM jobs j JOIN recordings r ON r.id = j.recording_id JOIN sessions s ON s.id = r.session_id
                  LEFT JOIN assessments a ON a.job_id = j.id LEFT JOIN noise_models n ON n.job_id = j.id
             WHERE j.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2) AND j.id = $3",
        )
        .bind(access.organisation)
        .bind(access.only_sessions_of())
        .bind(id)
        .fetch_optional(self.store.reader())
        .await?
        .ok_or(StorageError::not_found("job"))?;
        job_from_row(&row)
    }

    /// The jobs within the caller's reach, newest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn jobs(
        &self,
        access: &Access,
        filter: &JobFilter,
        page: &PageRequest<JobId>,
    ) -> Result<Page<Job, JobId>, StorageError> {
        // An index can serve a condition only if it is there whatever is bound, hence one text per case.
        macro_rules! jobs_where {
            ($recording:literal) => {
                concat!(
                    "SELECT j.*, NULL AS n_ahead, r.session_id, a.id AS assessment_id, n.id AS noise_model_id
                     FROM jobs j JOIN recordings r ON r.id = j.recording_id JOIN sessions s ON s.id = r.session_id
                          LEFT JOIN assessments a ON a.job_id = j.id LEFT JOIN noise_models n ON n.job_id = j.id
                     WHERE j.organisation_id = $1 AND ($2 IS NULL OR s.created_by = $2)
                       AND j.id < $3
                       AND ($4 IS NULL OR j.state = $4)
                       AND ",
                    $recording,
                    " ORDER BY j.id DESC LIMIT $6"
                )
            };
        }
        let question = match filter.recording_id {
            Some(_) => jobs_where!("j.recording_id = $5"),
            None => jobs_where!("$5 IS NULL"),
        };
        let rows = query(question)
            .bind(access.organisation)
            .bind(access.only_sessions_of())
            .bind(page.cursor())
            .bind(filter.state.map(JobState::name))
            .bind(filter.recording_id)
            .bind(page.rows())
            .fetch_all(self.store.reader())
            .await?;
        let jobs = rows.iter().map(job_from_row).collect::<Result<_, _>>()?;
        Ok(Page::from_rows(jobs, page, |job| job.id))
    }

    /// How many jobs of all organisations are in each state, for the operator's metrics.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn counts(&self) -> Result<Vec<(JobState, u64)>, StorageError> {
        let rows =
            query("SELECT state, count(*) AS jobs FROM jobs GROUP BY state").fetch_all(self.store.reader()).await?;
        let found: Vec<(JobState, u64)> = rows
            .iter()
            .map(|row| Ok((row::word(row, "state")?, row::count(row, "jobs")?)))
            .collect::<Result<_, StorageError>>()?;
        let count = |state| found.iter().find(|(known, _)| *known == state).map_or(0, |(_, count)| *count);
        Ok(JobState::ALL.map(|state| (state, count(state))).into())
    }
}
