//! How many requests are served: so many in a minute of one key or user, and so many without a valid key from one address.
//!
//! The buckets are those of the crate `governor` (the generic cell rate algorithm): a minute's worth may come at once, then there is
//! room for one more each `60 / n` seconds. Health and metrics are never limited. The counts are of this process.

use super::error::ApiError;
use super::peer::peer_address;
use super::state::AppState;
use crate::config::Config;
use crate::storage::ClientId;
use axum::extract::{Request, State};
use axum::http::header;
use axum::http::request::Parts;
use axum::middleware::Next;
use axum::response::Response;
use governor::clock::{Clock, DefaultClock};
use governor::state::keyed::HashMapStateStore;
use governor::{Quota, RateLimiter};
use std::hash::Hash;
use std::net::IpAddr;
use std::num::NonZeroU32;
use std::sync::Arc;

type Buckets<K> = RateLimiter<K, HashMapStateStore<K>, DefaultClock>;

/// The buckets of one service; a clone is another handle to the same.
#[derive(Debug, Clone)]
pub struct Rates {
    of_clients: Option<Arc<Buckets<ClientId>>>,
    of_addresses: Option<Arc<Buckets<IpAddr>>>,
}

impl Rates {
    /// Full buckets of the configured size.
    pub fn new(config: &Config) -> Self {
        Self {
            of_clients: buckets(config.requests_per_minute),
            of_addresses: buckets(config.anonymous_requests_per_minute),
        }
    }

    /// Counts a request of a client.
    ///
    /// # Errors
    /// `TooManyRequests` when its bucket is empty.
    pub fn count_client(&self, client: ClientId) -> Result<(), ApiError> {
        count(self.of_clients.as_deref(), &client, "this key or user")
    }

    /// Counts a request without a valid key.
    ///
    /// # Errors
    /// `TooManyRequests` when the bucket of its address is empty.
    pub fn count_anonymous(&self, parts: &Parts, config: &Config) -> Result<(), ApiError> {
        let address = peer_address(&parts.extensions, &parts.headers, &config.trusted_proxies);
        count(self.of_addresses.as_deref(), &address, "an address without a valid key")
    }

    /// Forgets buckets that are full again; without it the table would grow with every address that ever asked.
    pub fn tidy(&self) {
        if let Some(buckets) = &self.of_clients {
            buckets.retain_recent();
        }
        if let Some(buckets) = &self.of_addresses {
            buckets.retain_recent();
        }
    }
}

fn buckets<K: Hash + Eq + Clone>(per_minute: u32) -> Option<Arc<Buckets<K>>> {
    NonZeroU32::new(per_minute).map(|n| Arc::new(RateLimiter::hashmap(Quota::per_minute(n))))
}

fn count<K: Hash + Eq + Clone>(buckets: Option<&Buckets<K>>, key: &K, whose: &'static str) -> Result<(), ApiError> {
    let Some(buckets) = buckets else { return Ok(()) };
    buckets.check_key(key).map_err(|not_until| {
        let wait = not_until.wait_time_from(DefaultClock::default().now());
        ApiError::TooManyRequests(wait.as_secs() + 1, whose)
    })
}

/// Middleware: counts requests that bring no key and no cookie, and those to addresses that look at neither. All others are counted
/// when it is known whose they are.
pub(super) async fn count_strangers(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Result<Response, ApiError> {
    let path = request.uri().path();
    let is_watch = path.starts_with("/health/") || path == "/metrics";
    let headers = request.headers();
    // Sign-in, sign-out and the change of a password take forms of people whom nobody knows yet.
    let is_form = path.starts_with("/app/sign-") || path == "/app/password";
    let is_page = path.starts_with("/app/") && !is_form;
    let is_api = path.starts_with("/v1/") || (path.starts_with("/fhir/") && !path.ends_with("/metadata"));
    let will_be_known = (is_api && headers.contains_key(header::AUTHORIZATION))
        || ((is_api || is_page) && headers.contains_key(header::COOKIE));
    if is_watch || will_be_known {
        return Ok(next.run(request).await);
    }
    let (parts, body) = request.into_parts();
    state.rates.count_anonymous(&parts, &state.config)?;
    Ok(next.run(Request::from_parts(parts, body)).await)
}
