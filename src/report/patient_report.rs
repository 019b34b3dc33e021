//! The report of one patient.

use super::adherence::Adherence;
use super::measure::MeasureRecord;
use super::needed::Needed;
use super::trend::Trend;
use crate::assessment::{PerformanceStatus, Warning};
use crate::fall_risk::{Finding, Sex, Status};
use serde::Serialize;
use time::OffsetDateTime;
use utoipa::ToSchema;
use uuid::Uuid;

/// What is known of a patient at a time, for a clinician.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PatientReport {
    /// Who it is of.
    pub patient: PatientSummary,
    /// As of when; what was added later does not count.
    #[serde(with = "time::serde::rfc3339")]
    pub as_of: OffsetDateTime,
    /// Version of the software that made the report.
    pub software_version: &'static str,
    /// How many rules found what.
    pub counts: StatusCounts,
    /// One finding for each rule, in the order of a report; no score blends them.
    pub findings: Vec<Finding>,
    /// What the findings without an answer need.
    pub needed: Vec<Needed>,
    /// The newest value of each measure.
    pub measures: Vec<MeasureRecord>,
    /// How measures of rules and of gait changed, over their latest values.
    pub trends: Vec<Trend>,
    /// How much of the newest training plan was done; null without a plan.
    pub adherence: Option<Adherence>,
    /// The latest sessions, the newest first.
    pub recent_sessions: Vec<RecentSession>,
    /// What must be read with it.
    pub caution: &'static str,
}

/// Who a report is of; nothing that identifies a person.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PatientSummary {
    /// The patient.
    pub id: Uuid,
    /// Pseudonym.
    pub pseudonym: String,
    /// Age, by the calendar years, years.
    pub age_years: Option<i32>,
    /// Sex, where norms differ by it.
    pub sex: Option<Sex>,
    /// Stature, metres.
    pub height_m: Option<f64>,
    /// Whether a walking aid is used.
    pub uses_walking_aid: Option<bool>,
    /// Whether the patient is of the population that the rules were developed on: 65 years or more, at home, without a walking
    /// aid; null while one of these is not known.
    pub matches_population: Option<bool>,
}

/// How many rules found what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, ToSchema)]
pub struct StatusCounts {
    /// The limit is passed.
    pub positive: u64,
    /// It is not.
    pub negative: u64,
    /// The measurement does not tell.
    pub indeterminate: u64,
    /// Something is not known.
    pub unknown: u64,
    /// The rule cannot be applied.
    pub not_assessable: u64,
    /// Rules that inform and have no limit.
    pub information: u64,
}

impl StatusCounts {
    /// Counts findings by their status.
    pub fn of(findings: &[Finding]) -> Self {
        let mut counts = Self::default();
        for finding in findings {
            let count = match finding.status {
                Some(Status::Positive) => &mut counts.positive,
                Some(Status::Negative) => &mut counts.negative,
                Some(Status::Indeterminate) => &mut counts.indeterminate,
                Some(Status::Unknown) => &mut counts.unknown,
                Some(Status::NotAssessable) => &mut counts.not_assessable,
                None => &mut counts.information,
            };
            *count += 1;
        }
        counts
    }
}

/// One session and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RecentSession {
    /// The session.
    pub id: Uuid,
    /// When it began.
    #[serde(with = "time::serde::rfc3339")]
    pub started_at: OffsetDateTime,
    /// The exercise programme or test.
    pub protocol: Option<String>,
    /// Its recordings, the earliest first.
    pub recordings: Vec<RecentRecording>,
}

/// One recording and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RecentRecording {
    /// The recording.
    pub id: Uuid,
    /// What was done in it, as the recording or the session says.
    pub protocol: Option<String>,
    /// State of its newest job: `queued`, `running`, `done`, `failed` or `cancelled`.
    pub job_state: Option<String>,
    /// Why its newest job failed.
    pub job_error: Option<String>,
    /// The newest assessment.
    pub assessment_id: Option<Uuid>,
    /// Its pipeline.
    pub pipeline: Option<String>,
    /// Share of frames in which everything was seen, 0 to 1.
    pub coverage: Option<f64>,
    /// Whether the exercise or test could be measured.
    pub performance: Option<PerformanceStatus>,
    /// Why it was not, and what to record next; empty when it was.
    pub performance_reason: String,
    /// Repetitions that were found.
    pub n_repetitions: u64,
    /// What the reader should know of the assessment.
    pub warnings: Vec<Warning>,
}
