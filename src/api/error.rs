//! Refusals: one error type at the edge, told as problem documents (RFC 9457).
//!
//! Every answer of 400 and above is `application/problem+json` with a stable `code`, a sentence for a person, and the
//! paths of the fields concerned. What went wrong inside is logged and never sent.

use crate::queue::Crowded;
use crate::recording::DecodeError;
use crate::storage::{ConsentState, StorageError};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Media type of a refusal.
pub const PROBLEM_JSON: &str = "application/problem+json";

/// Why a request was refused (RFC 9457). Programs look at `code`, people read `detail`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// Stable name of the kind of problem: `urn:surefoot:problem:` and the code.
    #[serde(rename = "type")]
    pub problem_type: String,
    /// The kind of problem in words.
    pub title: String,
    /// The HTTP status again.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// Stable code, for example `not_found`.
    pub code: String,
    /// What was wrong, where, and what to do; for a person.
    pub detail: String,
    /// The fields concerned; absent when the problem lies in no field.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<FieldError>,
    /// Seconds after which it is worth trying again; also in the header `Retry-After`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_s: Option<u64>,
    /// Names this one occurrence; quote it when asking for help. It is also in the header `x-request-id`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instance: Option<String>,
}

/// One defect and its place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FieldError {
    /// Path of the field, for example `height_m` or `frames[17].time_ns`; the name of a parameter or header.
    pub path: String,
    /// What is wrong with it.
    pub message: String,
}

impl FieldError {
    /// A defect of the field at `path`.
    pub fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), message: message.into() }
    }
}

/// Everything that a handler may answer instead of a result.
#[derive(Debug)]
pub enum ApiError {
    /// A path, query or header value cannot be understood.
    InvalidRequest(Vec<FieldError>),
    /// The body is not JSON.
    MalformedJson(String),
    /// The body is JSON, but not what the endpoint takes.
    InvalidBody(Vec<FieldError>),
    /// No key, or a key nobody knows.
    Unauthenticated(&'static str),
    /// A key that has come to its end, or that another has replaced.
    KeyExpired,
    /// More requests than are served; the seconds after which there is room again, and whose limit it is.
    TooManyRequests(u64, &'static str),
    /// A good key whose role does not reach this far.
    Forbidden(&'static str),
    /// The patient's consent is missing, or over.
    NoConsent(ConsentState),
    /// The bytes of the recording were removed by a rule of retention.
    ContentRemoved,
    /// Nothing here that the caller may see; the text names the kind of thing.
    NotFound(&'static str),
    /// The state of the thing does not allow this.
    Conflict(&'static str, String),
    /// The caller accepts no form this endpoint has.
    NotAcceptable(&'static str),
    /// The body ended early or the connection broke while it was read.
    IncompleteBody,
    /// The body did not arrive in time.
    Timeout(&'static str),
    /// The body is larger than the limit, bytes.
    TooLarge(u64),
    /// The content type is none of those listed.
    UnsupportedMediaType(&'static str),
    /// The uploaded bytes are not a recording.
    Recording(DecodeError),
    /// The bytes that arrived are not the bytes whose digest the client announced.
    DigestMismatch {
        /// The digest the client sent, hexadecimal.
        expected: String,
        /// The digest of what arrived, hexadecimal.
        found: String,
    },
    /// The idempotency key was used before, with another request.
    IdempotencyKeyReused,
    /// A part of the service is not ready.
    Unavailable(&'static str),
    /// Too many jobs wait for one more.
    Crowded(Crowded),
    /// The disk is full.
    OutOfSpace,
    /// A problem in its final form: one that was told before, or of a protocol with problems of its own.
    Told(Box<Problem>),
    /// Our fault: logged, not told.
    Internal(anyhow::Error),
}

impl ApiError {
    /// A bad value of one path, query or header field.
    pub fn field(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::InvalidRequest(vec![FieldError::new(path, message)])
    }

    /// A fault of ours.
    pub fn internal(error: impl Into<anyhow::Error>) -> Self {
        Self::Internal(error.into())
    }

    /// The document that the client gets.
    pub fn problem(&self) -> Problem {
        use StatusCode as S;
        match self {
            Self::InvalidRequest(errors) => Problem::new(S::BAD_REQUEST, "invalid_request", listed(errors)),
            Self::MalformedJson(why) => {
                let detail = format!("The body is not valid JSON: {why}. Send one JSON document in UTF-8.");
                Problem::new(S::BAD_REQUEST, "malformed_json", detail)
            }
            Self::InvalidBody(errors) => Problem::new(S::UNPROCESSABLE_ENTITY, "invalid_body", listed(errors)),
            Self::Unauthenticated(detail) => Problem::new(S::UNAUTHORIZED, "unauthenticated", *detail),
            Self::KeyExpired => {
                let detail =
                    "This API key has expired, or it was replaced by a new one. Ask an administrator for the new key.";
                Problem::new(S::UNAUTHORIZED, "key_expired", detail)
            }
            Self::TooManyRequests(wait_s, whose) => {
                let detail =
                    format!("There were more requests than {whose} may send. Wait {wait_s} s and send it again.");
                Problem::new(S::TOO_MANY_REQUESTS, "too_many_requests", detail)
            }
            Self::Forbidden(needed) => {
                let detail = format!("This request needs a key with the role {needed}. Ask an administrator for one.");
                Problem::new(S::FORBIDDEN, "forbidden", detail)
            }
            Self::NoConsent(state) => Problem::new(S::FORBIDDEN, "consent_required", no_consent(*state)),
            Self::ContentRemoved => {
                let detail =
                    "The bytes of this recording were removed by a rule of retention; what was found in them stays.";
                Problem::new(S::GONE, "content_removed", detail)
            }
            Self::NotFound(kind) => {
                let detail = format!("There is no {kind} with this id that your key may see. Check the id.");
                Problem::new(S::NOT_FOUND, "not_found", detail)
            }
            Self::Conflict(code, detail) => Problem::new(S::CONFLICT, code, detail.clone()),
            Self::NotAcceptable(offered) => {
                let detail = format!("This address answers with {offered}. Change the Accept header.");
                Problem::new(S::NOT_ACCEPTABLE, "not_acceptable", detail)
            }
            Self::IncompleteBody => {
                let detail = "The body ended before it was complete. Nothing was stored; send it again.";
                Problem::new(S::BAD_REQUEST, "incomplete_body", detail)
            }
            Self::Timeout(detail) => Problem::new(S::REQUEST_TIMEOUT, "timeout", *detail),
            Self::TooLarge(limit) => {
                let detail = format!("The body is larger than the {limit} bytes that are accepted here. Send less.");
                Problem::new(S::PAYLOAD_TOO_LARGE, "too_large", detail)
            }
            Self::UnsupportedMediaType(accepted) => {
                let detail = format!("The content type is not accepted here. Send {accepted}.");
                Problem::new(S::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", detail)
            }
            Self::Recording(error) => Problem::of_recording(error),
            Self::DigestMismatch { expected, found } => {
                let detail = format!(
                    "The bytes that arrived have the SHA-256 {found}, announced was {expected}. They changed on the \
                     way or the digest is of another file; nothing was stored. Send the recording again."
                );
                Problem::new(S::UNPROCESSABLE_ENTITY, "digest_mismatch", detail)
            }
            Self::IdempotencyKeyReused => {
                let detail = "This Idempotency-Key came before with a different request. Use a new key for each \
                              recording, and the same key only to repeat the very same upload.";
                Problem::new(S::UNPROCESSABLE_ENTITY, "idempotency_key_reused", detail)
            }
            Self::Unavailable(detail) => Problem::new(S::SERVICE_UNAVAILABLE, "unavailable", *detail),
            Self::Crowded(crowded) => Problem::of_crowd(crowded),
            Self::OutOfSpace => {
                let detail = "The service has no room left for this. Nothing was stored and nothing that was stored is \
                              lost; keep the recording and send it again later.";
                Problem::new(S::INSUFFICIENT_STORAGE, "out_of_space", detail)
            }
            Self::Told(problem) => return (**problem).clone(),
            Self::Internal(_) => Problem::of_status(S::INTERNAL_SERVER_ERROR),
        }
        .with_errors(self.field_errors())
    }

    /// The header that says when to try again, where a refusal is for now only.
    pub fn retry_after(&self) -> Option<(HeaderName, HeaderValue)> {
        match self {
            Self::TooManyRequests(wait_s, _) => Some((header::RETRY_AFTER, HeaderValue::from(*wait_s))),
            _ => None,
        }
    }

    fn field_errors(&self) -> Vec<FieldError> {
        match self {
            Self::InvalidRequest(errors) | Self::InvalidBody(errors) => errors.clone(),
            Self::Recording(error) => {
                error.place.iter().map(|place| FieldError::new(place, error.sentence.clone())).collect()
            }
            _ => Vec::new(),
        }
    }
}

impl From<StorageError> for ApiError {
    fn from(error: StorageError) -> Self {
        match error {
            StorageError::NotFound { what } => Self::NotFound(what),
            StorageError::Conflict { code, sentence } => Self::Conflict(code, sentence),
            StorageError::NoConsent(state) => Self::NoConsent(state),
            full if full.is_out_of_space() => {
                tracing::error!(error = format!("{full:#}"), "the disk is full");
                Self::OutOfSpace
            }
            other => Self::internal(other),
        }
    }
}

/// Why the patient's consent does not do, and what does.
fn no_consent(state: ConsentState) -> String {
    let why = match state {
        ConsentState::Withdrawn => "The patient has withdrawn the consent to assessment",
        ConsentState::Expired => "The patient's consent to assessment has come to its end",
        ConsentState::Missing | ConsentState::Valid => "No valid consent of the patient to assessment is recorded",
    };
    format!(
        "{why}: nothing was stored and nothing is computed. When the patient agrees, a clinician records it with \
         POST /v1/patients/{{id}}/consents; then send the request again."
    )
}

/// One sentence that names every defect.
fn listed(errors: &[FieldError]) -> String {
    let each: Vec<String> = errors
        .iter()
        .map(|e| if e.path.is_empty() { e.message.clone() } else { format!("`{}`: {}", e.path, e.message) })
        .collect();
    format!("The request was understood but refused: {}.", each.join("; "))
}

impl Problem {
    pub(super) fn new(status: StatusCode, code: &str, detail: impl Into<String>) -> Self {
        Self {
            problem_type: format!("urn:surefoot:problem:{code}"),
            title: title(status, code).to_owned(),
            status: status.as_u16(),
            code: code.to_owned(),
            detail: detail.into(),
            errors: Vec::new(),
            retry_after_s: None,
            instance: None,
        }
    }

    fn of_recording(error: &DecodeError) -> Self {
        let detail = match &error.place {
            Some(place) => format!("{place}: {}", error.sentence),
            None => error.sentence.clone(),
        };
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, error.code, detail)
    }

    fn of_crowd(crowded: &Crowded) -> Self {
        let Crowded { is_own, waiting, retry_after } = crowded;
        let (status, code, whose) = match is_own {
            true => (StatusCode::TOO_MANY_REQUESTS, "too_many_waiting_jobs", "of your organisation "),
            false => (StatusCode::SERVICE_UNAVAILABLE, "queue_full", ""),
        };
        let seconds = retry_after.as_secs();
        let detail = format!(
            "{waiting} recordings {whose}already wait to be assessed, and no more may. Nothing was stored; keep the \
             recording and send it again in {seconds} s."
        );
        Self { retry_after_s: Some(seconds), ..Self::new(status, code, detail) }
    }

    /// The problem of an answer that carries nothing but a status, such as the router's own 404 and 405.
    pub fn of_status(status: StatusCode) -> Self {
        let (code, detail) = match status {
            StatusCode::NOT_FOUND => ("unknown_address", "Nothing lives at this address. See /docs for what there is."),
            StatusCode::METHOD_NOT_ALLOWED => {
                ("method_not_allowed", "This address does not know the method; the header Allow lists those it knows.")
            }
            StatusCode::REQUEST_TIMEOUT => ("timeout", "The request took too long. Send it again."),
            StatusCode::SERVICE_UNAVAILABLE => ("unavailable", "The service is not ready. Try again in a moment."),
            status if status.is_server_error() => {
                ("internal_error", "Something went wrong on our side. Try again; if it stays, quote the instance.")
            }
            _ => ("bad_request", "The request cannot be understood. See /docs for what is expected."),
        };
        Self::new(status, code, detail)
    }

    fn with_errors(mut self, errors: Vec<FieldError>) -> Self {
        self.errors = errors;
        self
    }
}

fn title(status: StatusCode, code: &str) -> &'static str {
    match code {
        "digest_mismatch" => "The digest does not match",
        "idempotency_key_reused" => "The idempotency key was used before",
        "invalid_body" => "The body has invalid fields",
        "malformed_json" => "The body is not JSON",
        "incomplete_body" => "The body is incomplete",
        "too_large" => "The body is too large",
        "unknown_address" => "Unknown address",
        "not_found" => "Not found",
        "out_of_space" => "No room left",
        "consent_required" => "The patient's consent is needed",
        "offset_mismatch" => "The upload goes on elsewhere",
        "upload_expired" => "The upload has expired",
        "tus_version" => "The version of tus is not known here",
        "upload_checksum_mismatch" => "The checksum does not match",
        "upload_locked" => "The upload is busy",
        _ if status == StatusCode::UNPROCESSABLE_ENTITY => "The recording was refused",
        _ => status.canonical_reason().unwrap_or("Refused"),
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let mut response = (status, [(header::CONTENT_TYPE, PROBLEM_JSON)], body).into_response();
        if status == StatusCode::UNAUTHORIZED {
            let challenge = HeaderValue::from_static("Bearer realm=\"surefoot\"");
            response.headers_mut().insert(header::WWW_AUTHENTICATE, challenge);
        }
        if let Some(seconds) = self.retry_after_s {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        // `observe` adds the instance, which is not known here.
        response.extensions_mut().insert(self);
        response
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        if let Self::Internal(error) = &self {
            tracing::error!(error = format!("{error:#}"), "request failed");
        }
        let mut response = self.problem().into_response();
        response.headers_mut().extend(self.retry_after());
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_internal_error_tells_nothing_of_its_cause() {
        let problem = ApiError::Internal(anyhow::anyhow!("table patients is locked")).problem();
        let text = serde_json::to_string(&problem).unwrap();
        assert_eq!((problem.status, problem.code.as_str()), (500, "internal_error"));
        assert!(!text.contains("patients"), "{text}");
    }

    #[test]
    fn a_decode_error_keeps_its_code_and_place() {
        let error = DecodeError::new("time_not_increasing", "the time stamp goes back").at("frames[3].time_ns");
        let problem = ApiError::Recording(error).problem();
        assert_eq!((problem.status, problem.code.as_str()), (422, "time_not_increasing"));
        assert_eq!(problem.errors, [FieldError::new("frames[3].time_ns", "the time stamp goes back")]);
    }
}
