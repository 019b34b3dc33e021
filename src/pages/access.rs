//! Who looks at a page, the cookie that says so, and what a form must bring.

use super::error::PageError;
use crate::api::AppState;
use crate::api::auditing::recognise;
use crate::api::auth::{Caller, PAGE_COOKIE, caller_of_page};
use crate::api::peer::peer_address;
use crate::config::Config;
use crate::storage::page_sessions::LONGEST_SESSION;
use crate::storage::{PageToken, Role};
use axum::extract::{FromRequestParts, Path};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, header};
use serde::de::DeserializeOwned;
use std::convert::Infallible;
use std::net::IpAddr;

/// Where a visitor begins.
pub(super) const HOME: &str = "/app/patients";
/// Longest address that a sign-in goes on to, bytes.
const LONGEST_NEXT: usize = 512;

/// Somebody who is signed in.
#[derive(Debug, Clone)]
pub(super) struct Visitor(pub Caller);

impl FromRequestParts<AppState> for Visitor {
    type Rejection = PageError;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, PageError> {
        let caller = caller_of_page(&parts.headers, state).await?;
        match caller {
            Some(caller) if is_of_pages(caller.client.role) => {
                recognise(&parts.extensions, &caller.client);
                state.rates.count_client(caller.client.id)?;
                Ok(Self(caller))
            }
            _ => {
                if parts.headers.contains_key(header::COOKIE) {
                    state.rates.count_anonymous(parts, &state.config)?;
                }
                let next = parts.uri.path_and_query().map_or(HOME, |address| address.as_str()).to_owned();
                Err(PageError::SignInFirst { next })
            }
        }
    }
}

/// The address that a request comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peer(pub IpAddr);

impl FromRequestParts<AppState> for Peer {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, Infallible> {
        Ok(Self(peer_address(&parts.extensions, &parts.headers, &state.config.trusted_proxies)))
    }
}

/// True of roles that read patients.
pub(super) fn is_of_pages(role: Role) -> bool {
    matches!(role, Role::Clinician | Role::Admin)
}

/// An id in the address of a page; what is none leads to no page.
#[derive(Debug, Clone, Copy)]
pub(super) struct PageId<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for PageId<T> {
    type Rejection = PageError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, PageError> {
        let path = Path::<T>::from_request_parts(parts, state).await;
        path.map(|Path(id)| Self(id)).map_err(|_| PageError::NotFound("page"))
    }
}

/// The header that gives a browser the token of its session.
pub(super) fn cookie(token: &PageToken, headers: &HeaderMap, config: &Config) -> Option<HeaderValue> {
    header_of(&format!("{}; Max-Age={}", token.reveal(), LONGEST_SESSION.whole_seconds()), headers, config)
}

/// The header that takes it away.
pub(super) fn no_cookie(headers: &HeaderMap, config: &Config) -> Option<HeaderValue> {
    header_of("; Max-Age=0", headers, config)
}

fn header_of(value: &str, headers: &HeaderMap, config: &Config) -> Option<HeaderValue> {
    let forwarded = headers.get("x-forwarded-proto").and_then(|proto| proto.to_str().ok());
    let is_secure = config.behind_tls || forwarded.is_some_and(|proto| proto.eq_ignore_ascii_case("https"));
    let secure = if is_secure { "; Secure" } else { "" };
    HeaderValue::from_str(&format!("{PAGE_COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict{secure}")).ok()
}

/// Refuses a form that did not come from a page of this service. Browsers say where a form is from: all newer ones by
/// `Sec-Fetch-Site` where they trust the connection, all by `Origin`. What says neither is refused.
pub(super) fn check_form_is_own(headers: &HeaderMap) -> Result<(), PageError> {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
    let is_own = match (text("sec-fetch-site"), text("origin"), text("host")) {
        (Some(site), _, _) => site == "same-origin",
        (None, Some(origin), Some(host)) => origin.split_once("://").is_some_and(|(_, own)| own == host),
        _ => false,
    };
    if is_own { Ok(()) } else { Err(PageError::ForeignForm) }
}

/// The address to go on to after a sign-in: a page of this service, or else the first one.
pub(super) fn safe_next(next: &str) -> &str {
    let rest = next.strip_prefix("/app");
    let is_page = rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/') || rest.starts_with('?'));
    let is_plain = next.bytes().all(|b| b.is_ascii_graphic() && b != b'\\') && !next.contains("//");
    let is_way_in = rest.is_some_and(|rest| rest.starts_with("/sign-"));
    if is_page && is_plain && !is_way_in && next.len() <= LONGEST_NEXT { next } else { HOME }
}

/// Text as it stands in the query of an address.
pub(super) fn escaped(text: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
    text.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sign_in_goes_on_to_pages_of_this_service_only() {
        for own in ["/app", "/app/patients?q=a&cursor=x", "/app/assessments/0192"] {
            assert_eq!(safe_next(own), own);
        }
        for foreign in [
            "https://elsewhere.example/app",
            "//elsewhere.example/app",
            "/app//elsewhere.example",
            "/app\\elsewhere",
            "/application",
            "/v1/patients",
            "/app/x\r\nSet-Cookie: a=b",
            "/app/sign-out",
            "javascript:alert(1)",
            "",
        ] {
            assert_eq!(safe_next(foreign), HOME, "{foreign}");
        }
    }

    #[test]
    fn a_form_of_another_site_is_told_from_an_own_one() {
        let of = |pairs: &[(&'static str, &'static str)]| {
            let pairs = pairs
                .iter()
                .map(|(name, value)| (axum::http::HeaderName::from_static(name), HeaderValue::from_static(value)));
            check_form_is_own(&pairs.collect()).is_ok()
        };
        assert!(of(&[("sec-fetch-site", "same-origin")]));
        assert!(of(&[("origin", "http://clinic.example:8080"), ("host", "clinic.example:8080")]));
        assert!(!of(&[("sec-fetch-site", "same-site"), ("origin", "http://a"), ("host", "a")]));
        assert!(!of(&[("origin", "http://evil.example"), ("host", "clinic.example")]));
        assert!(!of(&[("origin", "null"), ("host", "clinic.example")]));
        assert!(!of(&[("host", "clinic.example")]));
    }

    #[test]
    fn an_address_in_a_query_keeps_its_own_query() {
        assert_eq!(escaped("/app/patients?q=a&b=ä"), "/app/patients%3Fq%3Da%26b%3D%C3%A4");
    }
}
