//! The list of patients, with search.

use super::access::{HOME, Visitor, escaped};
use super::error::PageError;
use super::frame::{Frame, page};
use super::words;
use crate::api::AppState;
use crate::api::page::{cursor_from_id, id_from_cursor};
use crate::storage::{PageRequest, Patient, PatientFilter, PatientId, Share};
use askama::Template;
use axum::extract::{Query, State};
use axum::response::Html;
use serde::Deserialize;

/// Patients of a page.
const PATIENTS: u32 = 25;
/// Longest piece of a pseudonym that can be searched for, characters.
const LONGEST_SEARCH: usize = 64;

/// What is searched for, and where the page begins.
#[derive(Debug, Deserialize)]
pub(super) struct SearchQuery {
    /// A piece of the pseudonym.
    #[serde(default)]
    q: String,
    cursor: Option<String>,
}

#[derive(Template)]
#[template(path = "patients.html")]
struct PatientsPage {
    frame: Frame,
    search: String,
    patients: Vec<PatientRow>,
    /// Address of the next page.
    next: Option<String>,
    is_first: bool,
    shared: Vec<SharedRow>,
}

/// A patient of another organisation.
struct SharedRow {
    id: PatientId,
    pseudonym: String,
    organisation: String,
    until: String,
}

struct PatientRow {
    id: PatientId,
    pseudonym: String,
    born: String,
    sex: &'static str,
    walking_aid: &'static str,
    since: String,
    last_session: String,
}

/// The list.
pub(super) async fn show(
    State(state): State<AppState>,
    Visitor(caller): Visitor,
    Query(query): Query<SearchQuery>,
) -> Result<Html<String>, PageError> {
    let search = query.q.trim().to_owned();
    if search.chars().count() > LONGEST_SEARCH {
        return Err(PageError::Unclear(format!("Search for at most {LONGEST_SEARCH} characters.")));
    }
    let after = id_from_cursor(query.cursor.as_deref())?.map(PatientId);
    let filter =
        PatientFilter { pseudonym_part: (!search.is_empty()).then(|| search.clone()), ..PatientFilter::default() };
    let found = state.store.patients(&caller.access, &filter, &PageRequest { after, limit: PATIENTS }).await?;
    let next = found.next.map(|last| format!("{HOME}?q={}&cursor={}", escaped(&search), cursor_from_id(last.0)));
    let ids: Vec<PatientId> = found.items.iter().map(|patient| patient.id).collect();
    let last = state.store.last_sessions_of(&caller.access, &ids).await?;
    let row = |patient: Patient| {
        let last = last.get(&patient.id).map_or_else(|| "none yet".to_owned(), |time| words::day(*time));
        PatientRow::of(patient, last)
    };
    let patients = found.items.into_iter().map(row).collect();
    let shared = match after {
        None => state.store.shares_received(&caller.access).await?,
        Some(_) => Vec::new(),
    };
    Ok(page(&PatientsPage {
        frame: Frame::of(&caller, "Patients"),
        search,
        patients,
        next,
        is_first: after.is_none(),
        shared: shared.into_iter().map(SharedRow::from).collect(),
    })?)
}

impl From<Share> for SharedRow {
    fn from(share: Share) -> Self {
        Self {
            id: share.patient_id,
            pseudonym: share.pseudonym,
            organisation: share.organisation,
            until: words::moment(share.expires_at),
        }
    }
}

impl PatientRow {
    fn of(patient: Patient, last_session: String) -> Self {
        Self {
            id: patient.id,
            pseudonym: patient.pseudonym,
            born: patient.birth_year.map_or_else(|| "not known".to_owned(), |year| year.to_string()),
            sex: patient.sex.map_or("not known", |sex| sex.name()),
            walking_aid: yes_no(patient.uses_walking_aid),
            since: words::day(patient.created_at),
            last_session,
        }
    }
}

/// Yes, no, or that nobody has said.
pub(super) fn yes_no(answer: Option<bool>) -> &'static str {
    match answer {
        Some(true) => "yes",
        Some(false) => "no",
        None => "not known",
    }
}
