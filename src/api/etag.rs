//! Entity tags: a client that has the newest form already is told so and gets no body.

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Clients may keep an answer, but ask each time whether it still holds; shared caches may not keep it at all.
const REVALIDATE: HeaderValue = HeaderValue::from_static("private, no-cache");

/// A strong entity tag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ETag(String);

impl ETag {
    /// The tag of everything that decides about the bytes of an answer, or of the bytes themselves.
    pub fn of(parts: &[&[u8]]) -> Self {
        let mut hash = Sha256::new();
        for part in parts {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
        // 128 bits leave no chance of two forms with one tag.
        Self(format!("\"{}\"", hex::encode(&hash.finalize()[..16])))
    }

    /// True when `If-None-Match` names this tag.
    pub fn is_known(&self, request: &HeaderMap) -> bool {
        let values = request.get_all(header::IF_NONE_MATCH).into_iter().filter_map(|value| value.to_str().ok());
        values.flat_map(|list| list.split(',')).any(|tag| {
            let tag = tag.trim();
            tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == self.0
        })
    }

    /// The answer to a client that has this form already.
    pub fn not_modified(&self) -> Response {
        self.on(StatusCode::NOT_MODIFIED.into_response())
    }

    /// Marks an answer with this tag.
    pub fn on(&self, mut response: Response) -> Response {
        if let Ok(value) = HeaderValue::from_str(&self.0) {
            response.headers_mut().insert(header::ETAG, value);
        }
        response.headers_mut().insert(header::CACHE_CONTROL, REVALIDATE);
        response
    }
}

/// `value` as JSON under its tag, or 304 when the client has it.
pub fn tagged_json(request: &HeaderMap, value: &impl Serialize) -> Response {
    match serde_json::to_vec(value) {
        Ok(body) => tagged(request, "application/json", body),
        Err(error) => super::error::ApiError::internal(error).into_response(),
    }
}

fn tagged(request: &HeaderMap, content_type: &'static str, body: Vec<u8>) -> Response {
    let tag = ETag::of(&[&body]);
    if tag.is_known(request) {
        return tag.not_modified();
    }
    tag.on(([(header::CONTENT_TYPE, content_type)], Body::from(body)).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asking(value: &str) -> HeaderMap {
        HeaderMap::from_iter([(header::IF_NONE_MATCH, HeaderValue::from_str(value).unwrap())])
    }

    #[test]
    fn a_tag_is_known_in_a_list_weakened_or_by_a_star() {
        let tag = ETag::of(&[b"id", b"query"]);
        assert!(tag.is_known(&asking(&format!("\"other\", {}", tag.0))));
        assert!(tag.is_known(&asking(&format!("W/{}", tag.0))));
        assert!(tag.is_known(&asking("*")));
        assert!(!tag.is_known(&asking("\"other\"")));
    }

    #[test]
    fn parts_do_not_run_into_each_other() {
        assert_ne!(ETag::of(&[b"ab", b"c"]), ETag::of(&[b"a", b"bc"]));
    }
}
