//! Measures, their trends, training, and the latest sessions, in the words of a page.

use crate::assessment::PerformanceStatus;
use crate::body::Side;
use crate::fall_risk::{ChangeInfo, Evidence};
use crate::pages::sparkline::sparkline;
use crate::pages::words;
use crate::report::patient_report::RecentRecording;
use crate::report::{Adherence, Change, ChangeVerdict, MeasureRecord, MeasureSource, RecentSession, Trend};
use uuid::Uuid;

/// A measure over time.
pub(super) struct TrendView {
    pub title: String,
    /// The drawing; built here from numbers only.
    pub svg: String,
    pub course: String,
    pub changes: Vec<ChangeView>,
    /// The published limits that the changes were held against.
    pub limits: Vec<LimitView>,
    pub left_out: String,
}

/// A difference and what it means.
pub(super) struct ChangeView {
    /// From when, and by how much.
    pub since: String,
    pub verdict: &'static str,
    pub class: &'static str,
    pub reason: String,
}

/// A published limit of change.
pub(super) struct LimitView {
    pub source: String,
    pub is_unconfirmed: bool,
}

impl TrendView {
    pub(super) fn of(trend: &Trend) -> Self {
        let newest = trend.points.last();
        let course = newest.map_or_else(String::new, |newest| {
            let value = words::quantity(newest.value, &trend.unit);
            let n = trend.points.len();
            match trend.points.first() {
                Some(first) if n > 1 => {
                    let (from, to) = (words::day(first.measured_at), words::day(newest.measured_at));
                    format!("{value} on {to}; {n} values since {from}")
                }
                _ => format!("{value} on {}; the only value", words::day(newest.measured_at)),
            }
        });
        let both = [&trend.since_previous, &trend.since_first].into_iter().flatten();
        let mut rules: Vec<ChangeInfo> = both.filter_map(|change| change.rule).collect();
        rules.dedup();
        let left_out = match trend.n_other_definitions {
            0 => String::new(),
            n => format!("{} of another definition left out: not comparable", words::count(n)),
        };
        Self {
            title: with_side(&trend.title, trend.side),
            svg: sparkline(trend),
            course,
            changes: changes(trend),
            limits: rules.iter().map(LimitView::of).collect(),
            left_out,
        }
    }
}

/// The changes of a trend; one sentence for both where the same is to be said of them.
fn changes(trend: &Trend) -> Vec<ChangeView> {
    let previous = trend.since_previous.as_ref().map(|change| ChangeView::of("the value before", change, &trend.unit));
    let first = trend.since_first.as_ref().map(|change| ChangeView::of("the first value shown", change, &trend.unit));
    match (previous, first) {
        (Some(previous), Some(first)) if previous.reason == first.reason => {
            vec![ChangeView { since: format!("{} and {}", previous.since, first.since), ..previous }]
        }
        (previous, first) => previous.into_iter().chain(first).collect(),
    }
}

impl ChangeView {
    fn of(since: &str, change: &Change, unit: &str) -> Self {
        const LIMIT: &str = "minimal detectable change";
        let (verdict, class) = match change.verdict {
            ChangeVerdict::Changed => ("Changed", "changed"),
            ChangeVerdict::WithinError => ("No change shown", "steady"),
            ChangeVerdict::Unknown => ("Not known", "unknown"),
        };
        let limit = change.minimal_detectable_change.map(|mdc| words::quantity(mdc, unit));
        let reason = match limit {
            Some(limit) if change.reason.contains(LIMIT) => {
                change.reason.replace(LIMIT, &format!("{LIMIT} of {limit}"))
            }
            Some(limit) => format!("{} ({LIMIT} {limit})", change.reason),
            None => change.reason.clone(),
        };
        let difference = words::difference(change.difference, unit);
        Self { since: format!("{since} on {} ({difference})", words::day(change.from)), verdict, class, reason }
    }
}

impl LimitView {
    fn of(rule: &ChangeInfo) -> Self {
        let evidence = words::evidence(rule.evidence);
        Self {
            source: format!("{}/{}: {}; {}; {evidence}", rule.id, rule.version, rule.citation, rule.population),
            is_unconfirmed: rule.evidence == Evidence::Unconfirmed,
        }
    }
}

/// The newest value of a measure.
pub(super) struct MeasureRow {
    pub title: String,
    pub value: String,
    pub interval: String,
    pub n_observations: String,
    pub definition: String,
    pub measured: String,
    /// The assessment that it is from; none when somebody entered it.
    pub assessment: Option<Uuid>,
    pub reason: String,
}

impl MeasureRow {
    pub(super) fn of(measure: &MeasureRecord) -> Self {
        let interval = words::interval(measure.value, measure.standard_error, &measure.unit);
        Self {
            title: with_side(&measure.title, measure.side),
            value: words::quantity(measure.value, &measure.unit),
            interval: interval.unwrap_or_else(|| "not known".to_owned()),
            n_observations: measure.n_observations.map_or_else(|| "–".to_owned(), |n| n.to_string()),
            definition: measure.definition.clone().unwrap_or_default(),
            measured: words::day(measure.measured_at),
            assessment: match measure.source {
                MeasureSource::Assessment { assessment_id, .. } => Some(assessment_id),
                MeasureSource::Entered { .. } => None,
            },
            reason: measure.reason.clone(),
        }
    }
}

fn with_side(title: &str, side: Option<Side>) -> String {
    side.map_or_else(|| title.to_owned(), |side| format!("{title}, {}", side.name()))
}

/// How much of the plan was done.
pub(super) struct AdherenceView {
    pub sentence: String,
    pub exercises: Vec<ExerciseRow>,
}

/// How much of one exercise.
pub(super) struct ExerciseRow {
    pub protocol: String,
    pub done: u64,
    pub complete: String,
    pub uncounted: u64,
}

impl AdherenceView {
    pub(super) fn of(adherence: &Adherence) -> Self {
        let since = words::day(adherence.from);
        let sentence = match adherence.done_pct {
            Some(done) => format!(
                "{} of about {} planned sessions since {since} ({done:.0}\u{a0}%).",
                adherence.done_sessions,
                adherence.planned_sessions.round()
            ),
            None => format!("{} sessions since {since}; the plan is too new for a share.", adherence.done_sessions),
        };
        let row = |exercise: &crate::report::adherence::ExerciseAdherence| ExerciseRow {
            protocol: words::spoken(&exercise.protocol),
            done: exercise.done_sessions,
            complete: exercise.complete_sessions.map_or_else(|| "no number planned".to_owned(), |n| n.to_string()),
            uncounted: exercise.uncounted_sessions,
        };
        Self { sentence, exercises: adherence.exercises.iter().map(row).collect() }
    }
}

/// A session.
pub(super) struct SessionView {
    pub id: Uuid,
    pub started: String,
    pub protocol: String,
    pub recordings: Vec<RecordingView>,
}

/// A recording and what came of it.
pub(super) struct RecordingView {
    pub id: Uuid,
    pub protocol: String,
    pub state: String,
    /// True while the job may still change.
    pub is_open: bool,
    pub error: String,
    pub assessment: Option<Uuid>,
    pub coverage: String,
    pub performance: String,
    pub warnings: Vec<String>,
}

impl SessionView {
    pub(super) fn of(session: &RecentSession) -> Self {
        Self {
            id: session.id,
            started: words::moment(session.started_at),
            protocol: named(session.protocol.as_deref()),
            recordings: session.recordings.iter().map(RecordingView::of).collect(),
        }
    }
}

impl RecordingView {
    fn of(recording: &RecentRecording) -> Self {
        let state = recording.job_state.clone().unwrap_or_else(|| "no job".to_owned());
        let performance = match recording.performance {
            Some(PerformanceStatus::Measured) if recording.n_repetitions == 0 => "measured".to_owned(),
            Some(PerformanceStatus::Measured) => format!("measured, {} repetitions", recording.n_repetitions),
            Some(PerformanceStatus::OtherMovement) => format!("another movement: {}", recording.performance_reason),
            Some(PerformanceStatus::NotMeasured) => format!("not measured: {}", recording.performance_reason),
            None => String::new(),
        };
        Self {
            id: recording.id,
            protocol: named(recording.protocol.as_deref()),
            is_open: ["queued", "running"].contains(&state.as_str()),
            state,
            error: recording.job_error.clone().unwrap_or_default(),
            assessment: recording.assessment_id,
            coverage: recording.coverage.map_or_else(String::new, words::percent),
            performance,
            warnings: recording.warnings.iter().map(|warning| words::sentence(&warning.message)).collect(),
        }
    }
}

fn named(protocol: Option<&str>) -> String {
    protocol.map_or_else(|| "No protocol named".to_owned(), words::spoken)
}

#[cfg(test)]
mod tests {
    use super::*;
    use time::{Duration, OffsetDateTime};

    fn record(day: i64, value: f64) -> MeasureRecord {
        let at = OffsetDateTime::UNIX_EPOCH + Duration::days(day);
        MeasureRecord {
            id: Uuid::nil(),
            name: "usual_speed_mps".to_owned(),
            title: "Walking speed, usual".to_owned(),
            side: None,
            value,
            unit: "m/s".to_owned(),
            standard_error: Some(0.02),
            n_observations: None,
            error_sd: None,
            definition: None,
            protocol: None,
            reason: String::new(),
            source: MeasureSource::Entered { measurement_id: Uuid::nil() },
            measured_at: at,
            created_at: at,
        }
    }

    #[test]
    fn what_holds_of_both_changes_is_said_once_with_both_differences() {
        let trend = Trend::of(&[record(0, 1.0), record(7, 1.02), record(14, 1.01)]).unwrap();
        let view = TrendView::of(&trend);
        assert_eq!((view.changes.len(), view.limits.len(), view.changes[0].verdict), (1, 1, "No change shown"));
        assert!(view.changes[0].since.contains("\u{2212}0.010") && view.changes[0].since.contains("+0.010"));
        assert!(view.changes[0].reason.contains("minimal detectable change of 0.180"), "{}", view.changes[0].reason);
    }

    #[test]
    fn a_change_since_the_first_value_alone_is_not_hidden_behind_a_steady_one() {
        let trend = Trend::of(&[record(0, 1.5), record(7, 1.02), record(14, 1.01)]).unwrap();
        let verdicts: Vec<&str> = TrendView::of(&trend).changes.iter().map(|change| change.verdict).collect();
        assert_eq!(verdicts, ["No change shown", "Changed"]);
    }
}
