//! What becomes of a request in the audit log.
//!
//! Around every handler: when somebody was recognised by a key or by the cookie of the pages, the request is entered with its
//! outcome. A request that may change something runs to its end even if its client goes away, and is answered only once its
//! entry is on the disk; entries of reads are gathered. Requests of nobody change and read nothing and are not entered, but
//! for sign-ins that fail. Method and route make the action, ids in the address the thing; queries and bodies are never entered.

use super::error::{ApiError, Problem};
use super::observe::RequestId;
use super::state::AppState;
use crate::storage::Client;
use crate::storage::audit::{Actor, AuditEvent, Thing, ThingKind};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::sync::{Arc, OnceLock};
use tracing::Instrument;
use uuid::Uuid;

/// Routes that tell nothing of anybody.
const PUBLIC: [&str; 4] = ["/v1/protocols", "/v1/fall-risk-rules", "/health/", "/app/assets/"];
/// Parameters of a query that name what is asked about.
const ASKED_ABOUT: [(&str, ThingKind); 5] = [
    ("patient_id", ThingKind::Patient),
    ("patient", ThingKind::Patient),
    ("session_id", ThingKind::Session),
    ("recording_id", ThingKind::Recording),
    ("job_id", ThingKind::Job),
];

/// Who was recognised while a request was handled; extractors say it here.
#[derive(Debug, Clone, Default)]
pub struct Recognised(Arc<OnceLock<Actor>>);

impl Recognised {
    /// Notes the holder of a key.
    pub fn set_client(&self, client: &Client) {
        // The first one counts.
        let _ = self.0.set(Actor::client(client));
    }

    /// Notes that nobody was recognised and that this is worth an entry.
    pub fn set_nobody(&self) {
        let _ = self.0.set(Actor::nobody());
    }
}

/// Notes the holder of a key on a request that is being taken apart.
pub fn recognise(extensions: &axum::http::Extensions, client: &Client) {
    if let Some(recognised) = extensions.get::<Recognised>() {
        recognised.set_client(client);
    }
}

/// Middleware around every route.
pub async fn audit(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let route = request.extensions().get::<MatchedPath>().map(|path| path.as_str().to_owned());
    let Some(route) = route.filter(|route| !PUBLIC.iter().any(|public| route.starts_with(public))) else {
        return next.run(request).await;
    };
    let recognised = Recognised::default();
    request.extensions_mut().insert(recognised.clone());
    let reads = [Method::GET, Method::HEAD, Method::OPTIONS].contains(request.method());
    let asked = Asked {
        action: format!("{} {route}", request.method()),
        thing: thing_of_path(&route, request.uri().path()).or_else(|| thing_of_query(request.uri().query())),
        request_id: request.extensions().get::<RequestId>().map_or_else(String::new, |id| id.0.clone()),
        recognised,
    };
    if reads {
        let response = next.run(request).await;
        if let Some(event) = asked.answered(&state, &response) {
            state.audit.note(event).await;
        }
        return response;
    }
    // On a task of its own: a client that goes away does not take the entry of what it has changed with it.
    let changing = async move {
        let response = next.run(request).await;
        let Some(event) = asked.answered(&state, &response) else { return response };
        if state.audit.enter(event).await {
            return response;
        }
        let reason = "a change was not acknowledged, because its audit entry could not be written";
        ApiError::internal(anyhow::anyhow!(reason)).into_response()
    };
    let done = tokio::spawn(changing.in_current_span()).await;
    done.unwrap_or_else(|_| Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR).into_response())
}

/// What is known of a request before it is handled.
struct Asked {
    action: String,
    thing: Option<Thing>,
    request_id: String,
    recognised: Recognised,
}

impl Asked {
    fn answered(self, state: &AppState, response: &Response) -> Option<AuditEvent> {
        let actor = *self.recognised.0.get()?;
        Some(AuditEvent {
            happened_at: state.store.now(),
            actor,
            action: self.action,
            thing: self.thing,
            made: made(response.headers()),
            status: response.status().as_u16(),
            request_id: self.request_id,
            detail: String::new(),
        })
    }
}

fn kind_of_segment(segment: &str) -> Option<ThingKind> {
    Some(match segment {
        "patients" | "DiagnosticReport" | "RiskAssessment" => ThingKind::Patient,
        "sessions" => ThingKind::Session,
        "recordings" => ThingKind::Recording,
        "jobs" => ThingKind::Job,
        "assessments" => ThingKind::Assessment,
        "Observation" => ThingKind::Measure,
        "noise-models" => ThingKind::NoiseModel,
        "clients" => ThingKind::Client,
        _ => return None,
    })
}

/// The thing that an address names: the first id in it, and the collection before it.
fn thing_of_path(route: &str, path: &str) -> Option<Thing> {
    let segments = route.split('/').zip(path.split('/'));
    let mut before = "";
    for (pattern, segment) in segments {
        if pattern.starts_with('{') {
            let kind = kind_of_segment(before)?;
            return uuid_in(segment).map(|id| Thing { kind, id });
        }
        before = segment;
    }
    None
}

fn thing_of_query(query: Option<&str>) -> Option<Thing> {
    let pairs = || query.unwrap_or_default().split('&').filter_map(|pair| pair.split_once('='));
    ASKED_ABOUT.iter().find_map(|(name, kind)| {
        let value = pairs().find(|(key, _)| key == name)?.1;
        uuid_in(value).map(|id| Thing { kind: *kind, id })
    })
}

/// What an answer says was made.
fn made(headers: &HeaderMap) -> Option<Thing> {
    let location = headers.get(header::LOCATION)?.to_str().ok()?;
    let (before, id) = location.strip_prefix("/v1/")?.split_once('/')?;
    Some(Thing { kind: kind_of_segment(before)?, id: id.parse().ok()? })
}

/// The id in a segment: all of it, or, of resources that are made up of several things, its beginning or end.
fn uuid_in(segment: &str) -> Option<Uuid> {
    const LENGTH: usize = 36;
    let end = segment.len().checked_sub(LENGTH)?;
    let part = |part: Option<&str>| part.and_then(|part| part.parse().ok());
    part(segment.get(..LENGTH)).or_else(|| part(segment.get(end..)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: &str = "0193b2a8-1111-7aaa-8bbb-000000000000";

    #[test]
    fn an_address_names_the_thing_that_is_read() {
        let of = |route: &str, path: String| {
            thing_of_path(route, &path).map(|thing| (thing.kind.name(), thing.id.to_string()))
        };
        let found = |kind: &'static str| Some((kind, ID.to_owned()));
        assert_eq!(of("/v1/patients/{id}/report", format!("/v1/patients/{ID}/report")), found("patient"));
        assert_eq!(of("/app/assessments/{id}", format!("/app/assessments/{ID}")), found("assessment"));
        assert_eq!(
            of("/fhir/R4/DiagnosticReport/{id}", format!("/fhir/R4/DiagnosticReport/report-{ID}")),
            found("patient")
        );
        assert_eq!(of("/fhir/R4/RiskAssessment/{id}", format!("/fhir/R4/RiskAssessment/{ID}-tug-1")), found("patient"));
        assert_eq!(of("/v1/patients/{id}", "/v1/patients/ä-not-an-id-but-longer-than-one-would-be".into()), None);
        assert_eq!(of("/v1/patients", "/v1/patients".into()), None);
    }

    #[test]
    fn a_query_names_what_is_asked_about_and_nothing_else_of_it_is_kept() {
        let of = |query: &str| thing_of_query(Some(query)).map(|thing| thing.kind.name());
        assert_eq!(of(&format!("limit=5&recording_id={ID}")), Some("recording"));
        assert_eq!(of(&format!("patient=Patient/{ID}")), Some("patient"));
        assert_eq!(of("pseudonym_prefix=P-1"), None);
    }
}
