//! The issuer's public keys (RFC 7517), fetched when they are needed and kept for a while.

use super::super::error::ApiError;
use crate::config::OidcConfig;
use futures::StreamExt;
use jsonwebtoken::jwk::{Jwk, JwkSet, PublicKeyUse};
use jsonwebtoken::{Algorithm, DecodingKey};
use reqwest::{Client, Url, redirect};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// Keys are fetched anew after this time, so that a key that the issuer took back is not trusted for long.
const FRESH_FOR: Duration = Duration::from_secs(3600);
/// While the issuer cannot be reached, keys count for this long.
const KEPT_FOR: Duration = Duration::from_secs(24 * 3600);
/// Time between two attempts, whatever tokens ask for: an invented key id must not make this service ask the issuer.
const PAUSE: Duration = Duration::from_secs(60);
/// Time in which the issuer answers.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Largest document that is read of the issuer, bytes.
const MOST_BYTES: usize = 256 << 10;

/// The keys of one issuer.
#[derive(Debug)]
pub(super) struct Jwks {
    issuer: String,
    /// Where the keys are; none to ask the issuer.
    address: Option<Url>,
    client: Client,
    kept: RwLock<Option<Kept>>,
    /// Held by whoever fetches; says when that was last tried.
    tried: Mutex<Option<Instant>>,
}

#[derive(Debug, Clone)]
struct Kept {
    since: Instant,
    keys: Arc<JwkSet>,
}

/// What is needed of the issuer's description.
#[derive(Debug, Deserialize)]
struct Description {
    issuer: String,
    jwks_uri: String,
}

impl Jwks {
    /// The keys of the configured issuer, none fetched yet.
    pub(super) fn of(config: &OidcConfig) -> Result<Self, String> {
        safe_address(&config.issuer).map_err(|why| format!("`issuer` {why}"))?;
        let address = match config.jwks_uri.as_str() {
            "" => None,
            uri => Some(safe_address(uri).map_err(|why| format!("`jwks_uri` {why}"))?),
        };
        let client = Client::builder().timeout(TIMEOUT).redirect(redirect::Policy::none()).build();
        let client = client.map_err(|error| error.to_string())?;
        let issuer = config.issuer.clone();
        Ok(Self { issuer, address, client, kept: RwLock::default(), tried: Mutex::default() })
    }

    /// The key with which a token was signed; none when the issuer has no such key.
    ///
    /// # Errors
    /// `Unavailable` when there are no keys that still count.
    pub(super) async fn key(&self, id: Option<&str>, algorithm: Algorithm) -> Result<Option<DecodingKey>, ApiError> {
        const UNREACHABLE: &str =
            "The keys of the identity provider cannot be had, so its tokens cannot be checked. Try again in a minute.";
        if let Some(kept) = self.kept().filter(|kept| kept.since.elapsed() < FRESH_FOR)
            && let Some(key) = find(&kept.keys, id, algorithm)
        {
            return Ok(Some(key));
        }
        let mut tried = self.tried.lock().await;
        if tried.is_none_or(|last| last.elapsed() >= PAUSE) {
            match self.fetch().await {
                Ok(keys) => self.keep(keys),
                Err(why) => tracing::warn!(why, "the keys of the identity provider cannot be fetched"),
            }
            // After the attempt: one that took long must not be followed by the next at once.
            *tried = Some(Instant::now());
        }
        match self.kept().filter(|kept| kept.since.elapsed() < KEPT_FOR) {
            Some(kept) => Ok(find(&kept.keys, id, algorithm)),
            None => Err(ApiError::Unavailable(UNREACHABLE)),
        }
    }

    fn kept(&self) -> Option<Kept> {
        self.kept.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn keep(&self, keys: JwkSet) {
        let kept = Kept { since: Instant::now(), keys: Arc::new(keys) };
        *self.kept.write().unwrap_or_else(PoisonError::into_inner) = Some(kept);
    }

    async fn fetch(&self) -> Result<JwkSet, String> {
        let address = match &self.address {
            Some(address) => address.clone(),
            None => {
                let description = format!("{}/.well-known/openid-configuration", self.issuer.trim_end_matches('/'));
                let description: Description = self.document(safe_address(&description)?).await?;
                if description.issuer != self.issuer {
                    return Err(format!("the issuer calls itself `{}`", description.issuer));
                }
                safe_address(&description.jwks_uri)?
            }
        };
        self.document(address).await
    }

    async fn document<T: DeserializeOwned>(&self, address: Url) -> Result<T, String> {
        let told = |error: reqwest::Error| error.without_url().to_string();
        let answer =
            self.client.get(address).send().await.and_then(|answer| answer.error_for_status()).map_err(told)?;
        if !answer.status().is_success() {
            return Err(format!("the answer has the status {}", answer.status()));
        }
        let mut bytes = Vec::new();
        let mut chunks = answer.bytes_stream();
        while let Some(chunk) = chunks.next().await {
            bytes.extend_from_slice(&chunk.map_err(told)?);
            if bytes.len() > MOST_BYTES {
                return Err(format!("the document has more than {MOST_BYTES} bytes"));
            }
        }
        serde_json::from_slice(&bytes).map_err(|error| error.to_string())
    }
}

/// An address with TLS, or one of this machine: whoever can change keys on their way can sign what they like.
fn safe_address(text: &str) -> Result<Url, String> {
    let url: Url = text.parse().map_err(|_| format!("`{text}` is no address"))?;
    let is_local = url.host_str().is_some_and(|host| ["localhost", "127.0.0.1", "[::1]"].contains(&host));
    if url.scheme() == "https" || (url.scheme() == "http" && is_local) {
        return Ok(url);
    }
    Err(format!("`{text}` must begin with https://"))
}

/// The key with the id, when it is one for signatures of the algorithm. A token that names no key is taken only where the issuer has one
/// such key, so that there is nothing to choose.
fn find(keys: &JwkSet, id: Option<&str>, algorithm: Algorithm) -> Option<DecodingKey> {
    let fits = |key: &&Jwk| {
        let is_for_signatures = matches!(key.common.public_key_use, None | Some(PublicKeyUse::Signature));
        let named = key.common.key_algorithm.map(|named| named.to_string());
        is_for_signatures && named.is_none_or(|named| named == format!("{algorithm:?}"))
    };
    let of_algorithm = |key: &Jwk| DecodingKey::from_jwk(key).ok().filter(|key| key.family() == algorithm.family());
    let mut fitting = keys.keys.iter().filter(fits);
    match id {
        Some(id) => fitting.find(|key| key.common.key_id.as_deref() == Some(id)).and_then(of_algorithm),
        None => {
            let mut found = fitting.filter_map(of_algorithm);
            found.next().filter(|_| found.next().is_none())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_travel_by_tls_or_not_at_all() {
        for safe in
            ["https://id.example/keys", "http://127.0.0.1:9000/keys", "http://localhost/keys", "http://[::1]:1/"]
        {
            assert!(safe_address(safe).is_ok(), "{safe}");
        }
        for unsafe_ in ["http://id.example/keys", "file:///etc/keys", "id.example", "http://127.0.0.1.example/"] {
            assert!(safe_address(unsafe_).is_err(), "{unsafe_}");
        }
    }
}
