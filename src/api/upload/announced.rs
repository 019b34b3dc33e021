//! What the headers of an upload say of its body.

use crate::api::error::{ApiError, FieldError};
use crate::api::request::{content_length, media_type};
use crate::recording::decode::Format;
use axum::http::{HeaderMap, HeaderName};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use tus_protocol::UploadMetadata;

const ACCEPTED: &str = "application/mcap, application/json or application/octet-stream";
/// Content types of MCAP beside those that `Format` knows.
const VENDOR_MCAP: &str = "application/vnd.surefoot.mcap";
const UNKNOWN: &str = "application/octet-stream";

/// What is known of an upload before its first byte.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Announced {
    /// The format, when the content type says it.
    pub(super) format: Option<Format>,
    /// Bytes of the body.
    pub(super) length: Option<u64>,
    /// SHA-256 of the body, lower-case hexadecimal, as often as the client says it: each must hold.
    pub(super) sha256: Vec<String>,
    /// The client's name for this upload.
    pub(super) idempotency_key: Option<String>,
}

impl Announced {
    pub(super) fn from_headers(headers: &HeaderMap) -> Result<Self, ApiError> {
        Ok(Self {
            format: format(headers)?,
            length: content_length(headers),
            sha256: digest(headers)?.into_iter().chain(hexadecimal(headers)?).collect(),
            idempotency_key: idempotency_key(headers)?,
        })
    }

    /// What the metadata of a resumable upload say: `filetype`, `sha256`. Its name of the file is not looked at.
    pub(super) fn from_metadata(metadata: &UploadMetadata, length: u64) -> Result<Self, ApiError> {
        let text = |key: &'static str| -> Result<Option<&str>, ApiError> {
            let Some(value) = metadata.get(key) else { return Ok(None) };
            let text =
                value.as_str().ok_or_else(|| ApiError::field("Upload-Metadata", format!("`{key}` must be text")));
            // Browsers know no type of MCAP and say so by an empty one.
            Ok(Some(text?.trim()).filter(|text| !text.is_empty()))
        };
        let format = text("filetype")?.map(|kind| format_of(&bare(kind))).transpose()?.flatten();
        let sha256 =
            text("sha256")?.map(|text| hexadecimal_of(text, "Upload-Metadata", "sha256 must be")).transpose()?;
        Ok(Self { format, length: Some(length), sha256: sha256.into_iter().collect(), idempotency_key: None })
    }

    /// Refuses bytes other than those that were announced.
    pub(super) fn check_digest(&self, found: &str) -> Result<(), ApiError> {
        match self.sha256.iter().find(|expected| *expected != found) {
            None => Ok(()),
            Some(expected) => Err(ApiError::DigestMismatch { expected: expected.clone(), found: found.to_owned() }),
        }
    }
}

fn format(headers: &HeaderMap) -> Result<Option<Format>, ApiError> {
    media_type(headers).map_or(Ok(None), |name| format_of(&name))
}

fn format_of(media_type: &str) -> Result<Option<Format>, ApiError> {
    match media_type {
        UNKNOWN => Ok(None),
        VENDOR_MCAP => Ok(Some(Format::Mcap)),
        name => Format::from_content_type(name).map(Some).ok_or(ApiError::UnsupportedMediaType(ACCEPTED)),
    }
}

/// A content type without its parameters, lower case.
fn bare(content_type: &str) -> String {
    content_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

/// A header that may come once, as text.
fn single<'h>(headers: &'h HeaderMap, name: &'static str) -> Result<Option<&'h str>, ApiError> {
    let mut values = headers.get_all(HeaderName::from_static(name)).iter();
    let Some(value) = values.next() else { return Ok(None) };
    if values.next().is_some() {
        return Err(ApiError::field(name, "must come only once"));
    }
    value.to_str().map(|text| Some(text.trim())).map_err(|_| ApiError::field(name, "must be plain text"))
}

/// `Content-Digest: sha-256=:base64:` (RFC 9530). Digests by other algorithms are left aside, as the RFC asks, and a
/// dictionary without a member is the same as none (RFC 9651, section 3.2).
fn digest(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(list) = single(headers, "content-digest")?.filter(|list| !list.is_empty()) else { return Ok(None) };
    let wrong = || ApiError::field("Content-Digest", "must be sha-256=:<44 characters of base64>:");
    let mut found = None;
    for entry in list.split(',') {
        let (algorithm, value) = entry.trim().split_once('=').ok_or_else(wrong)?;
        if algorithm == "sha-256" {
            let base64 = value.strip_prefix(':').and_then(|value| value.strip_suffix(':')).ok_or_else(wrong)?;
            let bytes = STANDARD.decode(base64).map_err(|_| wrong())?;
            if bytes.len() != 32 {
                return Err(wrong());
            }
            found = Some(hex::encode(bytes));
        }
    }
    found.map(Some).ok_or_else(wrong)
}

fn hexadecimal(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(text) = single(headers, "x-content-sha256")? else { return Ok(None) };
    hexadecimal_of(text, "X-Content-SHA256", "must be").map(Some)
}

fn hexadecimal_of(text: &str, header: &str, must_be: &str) -> Result<String, ApiError> {
    if text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Ok(text.to_ascii_lowercase());
    }
    Err(ApiError::field(header, format!("{must_be} 64 hexadecimal digits")))
}

fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(key) = single(headers, "idempotency-key")? else { return Ok(None) };
    let plain = key.bytes().all(|b| b.is_ascii_alphanumeric() || b"._:-".contains(&b));
    if plain && (1..=128).contains(&key.len()) {
        return Ok(Some(key.to_owned()));
    }
    let message = "must be 1 to 128 letters, digits, `.`, `_`, `:` or `-`; a UUID does";
    Err(ApiError::InvalidRequest(vec![FieldError::new("Idempotency-Key", message)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;
    use proptest::prelude::*;

    /// SHA-256 of no bytes.
    const EMPTY_HEX: &str = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
    const EMPTY_BASE64: &str = "47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=";

    fn headers(list: &[(&'static str, &str)]) -> HeaderMap {
        let pair = |(name, value): &(&'static str, &str)| {
            (HeaderName::from_static(name), HeaderValue::from_str(value).unwrap())
        };
        list.iter().map(pair).collect()
    }

    #[test]
    fn both_spellings_of_a_digest_are_read() {
        let rfc = format!("sha-512=:AAAA:, sha-256=:{EMPTY_BASE64}:");
        let rfc = Announced::from_headers(&headers(&[("content-digest", &rfc)])).unwrap();
        let plain = Announced::from_headers(&headers(&[("x-content-sha256", &EMPTY_HEX.to_uppercase())])).unwrap();
        assert_eq!(rfc.sha256, [EMPTY_HEX]);
        assert_eq!(plain.sha256, rfc.sha256);
        assert!(rfc.check_digest(EMPTY_HEX).is_ok());
        assert!(rfc.check_digest(&"0".repeat(64)).is_err());
    }

    #[test]
    fn a_digest_that_cannot_be_read_is_refused_and_not_ignored() {
        for bad in ["sha-256=AAAA", "sha-256=:AAAA:", "md5=:AAAA:", "nonsense"] {
            assert!(Announced::from_headers(&headers(&[("content-digest", bad)])).is_err(), "{bad}");
        }
    }

    #[test]
    fn an_empty_content_digest_is_none_and_any_other_empty_header_is_refused() {
        let empty = |name: &'static str| Announced::from_headers(&headers(&[(name, "")]));
        assert!(empty("content-digest").unwrap().sha256.is_empty());
        assert!(empty("x-content-sha256").is_err() && empty("idempotency-key").is_err());
    }

    #[test]
    fn of_two_digests_each_must_hold() {
        let both = [("content-digest", format!("sha-256=:{EMPTY_BASE64}:")), ("x-content-sha256", "0".repeat(64))];
        let both: Vec<_> = both.iter().map(|(name, value)| (*name, value.as_str())).collect();
        assert!(Announced::from_headers(&headers(&both)).unwrap().check_digest(EMPTY_HEX).is_err());
    }

    #[test]
    fn the_content_type_names_the_format_or_leaves_it_to_the_bytes() {
        let format = |kind: &str| Announced::from_headers(&headers(&[("content-type", kind)])).map(|a| a.format);
        assert_eq!(format("application/json; charset=utf-8").unwrap(), Some(Format::Json));
        assert_eq!(format("application/vnd.surefoot.mcap").unwrap(), Some(Format::Mcap));
        assert_eq!(format("application/octet-stream").unwrap(), None);
        assert!(matches!(format("text/plain"), Err(ApiError::UnsupportedMediaType(_))));
    }

    const NAMES: [&str; 10] = [
        "content-type",
        "content-length",
        "content-digest",
        "x-content-sha256",
        "idempotency-key",
        "tus-resumable",
        "upload-length",
        "upload-offset",
        "upload-metadata",
        "upload-concat",
    ];

    /// Bytes, and what is nearly a header.
    fn value() -> impl Strategy<Value = Vec<u8>> {
        let text = |pattern: &str| prop::string::string_regex(pattern).unwrap().prop_map(String::into_bytes);
        prop_oneof![
            prop::collection::vec(any::<u8>(), 0..90),
            text("(sha256|filetype|filename) ?[A-Za-z0-9+/]{0,90}={0,3}(,(sha256|filetype) [A-Za-z0-9+/=]{0,90})?"),
            text("sha-(256|512)=?:?[A-Za-z0-9+/]{40,46}={0,2}:?(, ?sha-256=:[A-Za-z0-9+/]{43}=:)?"),
            text("-?[0-9]{0,22}|1\\.0\\.0|[0-9a-fA-F]{63,65}|final;/v1/[a-z/ ]{0,9}|partial"),
        ]
    }

    // The long run: PROPTEST_CASES=1000000 cargo test --release --lib announced
    proptest! {
        #[test]
        fn no_header_is_too_strange_and_what_is_accepted_is_sound(
            pairs in prop::collection::vec((prop::sample::select(&NAMES[..]), value()), 0..7),
        ) {
            let mut headers = HeaderMap::new();
            for (name, value) in pairs {
                if let Ok(value) = HeaderValue::from_bytes(&value) {
                    headers.append(name, value);
                }
            }
            let metadata = tus_protocol::Headers::from_headers(&headers).ok().and_then(|asked| asked.upload_metadata);
            let resumed = metadata.and_then(|metadata| Announced::from_metadata(&metadata, 1).ok());
            for announced in Announced::from_headers(&headers).into_iter().chain(resumed) {
                let is_digest = |text: &String| text.len() == 64 && hex::decode(text).is_ok();
                prop_assert!(announced.sha256.iter().all(is_digest), "{announced:?}");
                prop_assert!(announced.idempotency_key.is_none_or(|key| (1..=128).contains(&key.len())));
            }
        }
    }
}
