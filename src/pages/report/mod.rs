//! The report of a patient.

mod finding;
mod history;

use super::access::{PageId, Visitor};
use super::error::PageError;
use super::frame::{Frame, page};
use super::patients::yes_no;
use super::words;
use crate::api::AppState;
use crate::api::report::report_of;
use crate::fall_risk::{Status, change_rule_of, rules_of_measure};
use crate::report::{MeasureRecord, PatientReport, StatusCounts};
use crate::storage::consents::state_of_scope;
use crate::storage::{ConsentScope, ConsentState, PatientId};
use askama::Template;
use axum::extract::{Query, State};
use axum::response::Html;
use finding::{FindingView, Group, OpenView, groups, open_questions};
use history::{AdherenceView, MeasureRow, SessionView, TrendView};
use serde::Deserialize;
use time::format_description::well_known::Rfc3339;
use time::macros::{format_description, time};
use time::{Date, OffsetDateTime};

/// As of when the report is wanted: a day, which counts to its end, or a time as the API takes it.
#[derive(Debug, Deserialize)]
pub(super) struct AsOfQuery {
    #[serde(default)]
    as_of: String,
}

#[derive(Template)]
#[template(path = "report.html")]
struct ReportPage {
    frame: Frame,
    id: PatientId,
    pseudonym: String,
    person: Vec<(&'static str, String)>,
    population: &'static str,
    as_of: String,
    /// The day for the form; empty when the report is of now.
    as_of_day: String,
    summary: Vec<Count>,
    positive: Vec<FindingView>,
    n_rules: usize,
    groups: Vec<Group>,
    open: Vec<OpenView>,
    trends: Vec<TrendView>,
    /// Measures that a rule or a limit of change looks at.
    measures: Vec<MeasureRow>,
    /// All others.
    further: Vec<MeasureRow>,
    adherence: Option<AdherenceView>,
    sessions: Vec<SessionView>,
    caution: &'static str,
    version: &'static str,
}

/// How many rules found one thing.
struct Count {
    status: &'static str,
    class: &'static str,
    sentence: String,
}

/// The page.
pub(super) async fn show(
    State(state): State<AppState>,
    Visitor(caller): Visitor,
    PageId(id): PageId<PatientId>,
    Query(query): Query<AsOfQuery>,
) -> Result<Html<String>, PageError> {
    let as_of = time_of(query.as_of.trim())?;
    let report = report_of(&state.store, &caller, id, as_of).await?;
    let frame = Frame::of(&caller, format!("Report of {}", report.patient.pseudonym));
    let consents = state.store.consents_of_patient(&caller.access, id).await?;
    let consent = state_of_scope(&consents, ConsentScope::Assessment, state.store.now());
    Ok(page(&ReportPage::of(frame, id, report, consent, as_of.is_some()))?)
}

fn time_of(text: &str) -> Result<Option<OffsetDateTime>, PageError> {
    if text.is_empty() {
        return Ok(None);
    }
    let day = Date::parse(text, format_description!("[year]-[month]-[day]"))
        .map(|day| day.with_time(time!(23:59:59.999)).assume_utc());
    let time = day.or_else(|_| OffsetDateTime::parse(text, &Rfc3339));
    let in_calendar = time.ok().filter(|time| {
        let utc = time.checked_to_offset(time::UtcOffset::UTC);
        utc.is_some_and(|utc| (0..=9999).contains(&utc.year()))
    });
    in_calendar.map(Some).ok_or_else(|| PageError::Unclear("`as_of` must be a day such as 2026-03-15.".to_owned()))
}

impl ReportPage {
    fn of(frame: Frame, id: PatientId, report: PatientReport, consent: ConsentState, is_earlier: bool) -> Self {
        let patient = &report.patient;
        let known = |value: Option<String>| value.unwrap_or_else(|| "not known".to_owned());
        let consent = match consent {
            ConsentState::Valid => "given",
            ConsentState::Missing => "not recorded: nothing can be uploaded",
            ConsentState::Expired => "at its end: nothing can be uploaded",
            ConsentState::Withdrawn => "withdrawn: nothing is uploaded or computed",
        };
        let person = vec![
            ("Age", known(patient.age_years.map(|age| format!("{age} years")))),
            ("Sex for norms", known(patient.sex.map(|sex| format!("{sex:?}").to_lowercase()))),
            ("Height", known(patient.height_m.map(|height| words::quantity(height, "m")))),
            ("Walking aid", yes_no(patient.uses_walking_aid).to_owned()),
            ("Consent to assessment", consent.to_owned()),
        ];
        let positive = report.findings.iter().filter(|finding| finding.status == Some(Status::Positive));
        let (looked_at, further): (Vec<&MeasureRecord>, Vec<_>) = report.measures.iter().partition(|m| is_looked_at(m));
        let as_of_day = if is_earlier { report.as_of.date().to_string() } else { String::new() };
        Self {
            frame,
            id,
            pseudonym: patient.pseudonym.clone(),
            person,
            population: population(patient.matches_population),
            as_of: words::moment(report.as_of),
            as_of_day,
            summary: summary(&report.counts),
            positive: positive.map(FindingView::of).collect(),
            n_rules: report.findings.len(),
            groups: groups(&report.findings),
            open: open_questions(&report.findings, &report.needed),
            trends: report.trends.iter().map(TrendView::of).collect(),
            measures: looked_at.into_iter().map(MeasureRow::of).collect(),
            further: further.into_iter().map(MeasureRow::of).collect(),
            adherence: report.adherence.as_ref().map(AdherenceView::of),
            sessions: report.recent_sessions.iter().map(SessionView::of).collect(),
            caution: report.caution,
            version: report.software_version,
        }
    }
}

/// Whether a rule or a limit of change looks at a measure.
fn is_looked_at(measure: &MeasureRecord) -> bool {
    let name = &measure.name;
    measure.side.is_none() && (!rules_of_measure(name).is_empty() || change_rule_of(name).is_some())
}

fn population(matches: Option<bool>) -> &'static str {
    match matches {
        Some(true) => {
            "of the population that most rules were developed on (65 years or more, at home, without a walking aid)"
        }
        Some(false) => {
            "not of the population that most rules were developed on (65 years or more, at home, without a walking aid): \
             their accuracy is not known for this person"
        }
        None => {
            "not known to be of the population that most rules were developed on, until age, walking aid and place of living \
             are known"
        }
    }
}

/// What was found, in words; the first sentence first.
fn summary(counts: &StatusCounts) -> Vec<Count> {
    let line = |n: u64, status, class, one: &str, many: &str| {
        let tail = if n == 1 { one } else { many };
        (n > 0).then(|| Count { status, class, sentence: format!("{} {tail}", words::sentence(&words::count(n))) })
    };
    let lines = [
        line(counts.positive, "Positive", "positive", "rule: its limit is passed.", "rules: their limits are passed."),
        line(
            counts.indeterminate,
            "Indeterminate",
            "indeterminate",
            "rule: the value lies too near to the limit for the measurement to tell.",
            "rules: the values lie too near to the limits for the measurements to tell.",
        ),
        line(
            counts.negative,
            "Negative",
            "negative",
            "rule: its limit is not passed.",
            "rules: their limits are not passed.",
        ),
        line(
            counts.unknown,
            "Unknown",
            "unknown",
            "rule: something it needs is not known. That is not a sign of low risk.",
            "rules: something they need is not known. That is not a sign of low risk.",
        ),
        line(counts.not_assessable, "Not assessable", "unknown", "rule cannot be applied.", "rules cannot be applied."),
        line(
            counts.information,
            "Information",
            "information",
            "rule informs and has no limit here.",
            "rules inform and have no limit here.",
        ),
    ];
    lines.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use time::macros::datetime;

    #[test]
    fn a_day_counts_to_its_end_and_nonsense_is_refused() {
        assert_eq!(time_of("").unwrap(), None);
        assert_eq!(time_of("2026-03-15").unwrap(), Some(datetime!(2026-03-15 23:59:59.999 UTC)));
        assert_eq!(time_of("2026-03-15T10:00:00Z").unwrap(), Some(datetime!(2026-03-15 10:00 UTC)));
        for nonsense in ["yesterday", "2026-02-30", "2026-03-15T10:00:00"] {
            assert!(time_of(nonsense).is_err(), "{nonsense}");
        }
    }

    #[test]
    fn the_summary_never_takes_unknown_for_low() {
        let counts = StatusCounts { positive: 1, unknown: 14, ..StatusCounts::default() };
        let sentences: Vec<String> = summary(&counts).into_iter().map(|count| count.sentence).collect();
        assert_eq!(sentences.len(), 2);
        assert_eq!(sentences[0], "One rule: its limit is passed.");
        assert!(sentences[1].starts_with("14 rules") && sentences[1].contains("not a sign of low risk"));
    }
}
