//! What comes in, parsed and checked: path, query, JSON body. Each extractor refuses with a problem that names the field.

use super::error::{ApiError, FieldError};
use axum::body::Body;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use futures::StreamExt;
use garde::Validate;
use serde::de::DeserializeOwned;

/// Largest JSON body of an ordinary request, bytes. Recordings have their own, configured limits.
pub const MAX_JSON_BYTES: usize = 64 << 10;

/// Path parameters.
#[derive(Debug, Clone, Copy)]
pub struct ApiPath<T>(pub T);

/// Query parameters; unknown names are refused, so that a mistyped filter never widens a result.
#[derive(Debug, Clone)]
pub struct ApiQuery<T>(pub T);

/// A validated JSON body.
#[derive(Debug, Clone)]
pub struct ApiJson<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for ApiPath<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Path::<T>::from_request_parts(parts, state).await {
            Ok(Path(value)) => Ok(Self(value)),
            Err(PathRejection::FailedToDeserializePathParams(why)) => Err(ApiError::field("id", why.body_text())),
            Err(other) => Err(ApiError::field("id", other.body_text())),
        }
    }
}

impl<S: Send + Sync, T: DeserializeOwned + Validate<Context = ()> + Send> FromRequestParts<S> for ApiQuery<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let Query(value) = Query::<T>::from_request_parts(parts, state).await.map_err(|rejection| {
            let text = match &rejection {
                QueryRejection::FailedToDeserializeQueryString(why) => why.body_text(),
                other => other.body_text(),
            };
            let text = text.strip_prefix("Failed to deserialize query string: ").unwrap_or(&text);
            match text.split_once(": ") {
                Some((path, message)) if !path.contains(' ') => ApiError::field(path, message),
                _ => ApiError::field("", text),
            }
        })?;
        value.validate().map_err(|report| ApiError::InvalidRequest(field_errors(&report)))?;
        Ok(Self(value))
    }
}

impl<S: Send + Sync, T: DeserializeOwned + Validate<Context = ()> + Send> FromRequest<S> for ApiJson<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, _state: &S) -> Result<Self, ApiError> {
        if !is_json(request.headers()) {
            return Err(ApiError::UnsupportedMediaType("application/json"));
        }
        let bytes = read_body(request.headers().clone(), request.into_body(), MAX_JSON_BYTES).await?;
        let value: T = parse_json(&bytes)?;
        value.validate().map_err(|report| ApiError::InvalidBody(field_errors(&report)))?;
        Ok(Self(value))
    }
}

/// True when the body calls itself JSON.
pub fn is_json(headers: &HeaderMap) -> bool {
    media_type(headers).is_some_and(|kind| kind == "application/json")
}

/// The content type without its parameters, lower case.
pub fn media_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().ok()?;
    Some(value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase())
}

/// The announced length of the body, bytes.
pub fn content_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

async fn read_body(headers: HeaderMap, body: Body, limit: usize) -> Result<Vec<u8>, ApiError> {
    if content_length(&headers).is_some_and(|length| length > limit as u64) {
        return Err(ApiError::TooLarge(limit as u64));
    }
    let mut bytes = Vec::new();
    let mut chunks = body.into_data_stream();
    while let Some(chunk) = chunks.next().await {
        let chunk = chunk.map_err(|_| ApiError::IncompleteBody)?;
        if bytes.len() + chunk.len() > limit {
            return Err(ApiError::TooLarge(limit as u64));
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

fn parse_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ApiError> {
    // Every body here is an object. The derived parsers would also take its values as an array, without their names.
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    if first == Some(&b'[') {
        return Err(ApiError::InvalidBody(vec![FieldError::new("", "the body must be a JSON object, not an array")]));
    }
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let path = error.path().to_string();
        let inner = error.into_inner();
        if inner.is_data() {
            let path = if path == "." { String::new() } else { path };
            ApiError::InvalidBody(vec![FieldError::new(path, inner.to_string())])
        } else {
            ApiError::MalformedJson(inner.to_string())
        }
    })?;
    deserializer.end().map_err(|error| ApiError::MalformedJson(error.to_string()))?;
    Ok(value)
}

fn field_errors(report: &garde::Report) -> Vec<FieldError> {
    report.iter().map(|(path, error)| FieldError::new(path.to_string(), error.message())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Body {
        #[expect(dead_code, reason = "only its parsing is looked at")]
        inner: Vec<u8>,
    }

    #[test]
    fn a_wrong_field_is_named_by_its_path() {
        let Err(ApiError::InvalidBody(errors)) = parse_json::<Body>(br#"{"inner": [1, 2, "x"]}"#) else {
            panic!("must be refused as an invalid body")
        };
        assert_eq!(errors[0].path, "inner[2]");
    }

    #[test]
    fn an_unknown_field_a_tail_and_a_deep_nest_are_refused() {
        assert!(matches!(parse_json::<Body>(br#"{"inner": [], "more": 1}"#), Err(ApiError::InvalidBody(_))));
        assert!(matches!(parse_json::<Body>(br#"{"inner": []} 1"#), Err(ApiError::MalformedJson(_))));
        let nest = format!("{{\"inner\": {}", "[".repeat(100_000));
        assert!(matches!(parse_json::<serde_json::Value>(nest.as_bytes()), Err(ApiError::MalformedJson(_))));
    }

    #[test]
    fn values_without_names_are_not_taken_for_an_object() {
        assert!(matches!(parse_json::<Body>(b" [[1, 2]]"), Err(ApiError::InvalidBody(_))));
    }
}
