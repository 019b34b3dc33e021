//! Bearer tokens of an identity provider (OpenID Connect; access tokens as RFC 9068 has them), in place of a key.
//!
//! A token counts when its signature is of a pinned algorithm and of a key of the issuer, when it is of the configured issuer and for the
//! configured audience, and when its time is right to `LEEWAY_S`. Then its claims say the organisation and the role; its user is made
//! known when the first token comes. What a token does not say, nobody is given.

mod claims;
mod jwks;

use super::error::ApiError;
use crate::config::{OidcAlgorithm, OidcConfig};
use crate::storage::Provided;
use jsonwebtoken::{Algorithm, Validation, decode, decode_header};
use jwks::Jwks;
use serde_json::{Map, Value};

/// Clocks may differ by so much, seconds.
const LEEWAY_S: u64 = 60;
/// Longest token, bytes; claims of this service need a tenth of it.
const LONGEST_TOKEN: usize = 8 << 10;

/// Settings that cannot work.
#[derive(Debug, thiserror::Error)]
#[error("the settings of [oidc] cannot be used: {0}")]
pub struct OidcError(String);

/// An identity provider.
#[derive(Debug)]
pub struct Oidc {
    config: OidcConfig,
    keys: Jwks,
}

impl Oidc {
    /// The configured provider; none when there is no issuer. Nothing is asked of it yet.
    ///
    /// # Errors
    /// When settings are missing or name an address without TLS that is not of this machine.
    pub fn of(config: &OidcConfig) -> Result<Option<Self>, OidcError> {
        if config.issuer.is_empty() {
            return Ok(None);
        }
        if config.audience.is_empty() {
            return Err(OidcError(
                "`audience` is missing: without it, tokens for other services would open this one".into(),
            ));
        }
        if config.algorithms.is_empty() {
            return Err(OidcError("`algorithms` is empty".into()));
        }
        let keys = Jwks::of(config).map_err(OidcError)?;
        Ok(Some(Self { config: config.clone(), keys }))
    }

    /// What a token says of whoever brings it.
    ///
    /// # Errors
    /// `Unauthenticated` for a token that does not count, `Forbidden` for one without a role or an organisation, `Unavailable` when the
    /// issuer's keys cannot be had.
    pub async fn provided(&self, token: &str) -> Result<Provided, ApiError> {
        const MALFORMED: &str =
            "The bearer token cannot be read. Send the access token as the identity provider gave it.";
        const ALGORITHM: &str = "The bearer token is signed with an algorithm that is not taken here.";
        const UNKNOWN_KEY: &str = "The bearer token is not signed with a key of the identity provider.";
        if token.len() > LONGEST_TOKEN {
            return Err(ApiError::Unauthenticated(MALFORMED));
        }
        let header = decode_header(token).map_err(|_| ApiError::Unauthenticated(MALFORMED))?;
        // An extension that must be understood (RFC 7515, section 4.1.11) is one that is not understood here.
        if header.crit.is_some() {
            return Err(ApiError::Unauthenticated(MALFORMED));
        }
        let mut pinned = self.config.algorithms.iter().map(|algorithm| algorithm_of(*algorithm));
        let algorithm = pinned.find(|pinned| *pinned == header.alg).ok_or(ApiError::Unauthenticated(ALGORITHM))?;
        let key = self.keys.key(header.kid.as_deref(), algorithm).await?;
        let key = key.ok_or(ApiError::Unauthenticated(UNKNOWN_KEY))?;
        let decoded = decode::<Map<String, Value>>(token, &key, &self.validation(algorithm));
        let claims = decoded.map_err(|error| ApiError::Unauthenticated(why(error.kind())))?.claims;
        claims::provided(&self.config, &claims)
    }

    fn validation(&self, algorithm: Algorithm) -> Validation {
        let mut validation = Validation::new(algorithm);
        validation.leeway = LEEWAY_S;
        validation.validate_nbf = true;
        validation.set_issuer(&[&self.config.issuer]);
        validation.set_audience(&[&self.config.audience]);
        validation.set_required_spec_claims(&["exp", "iss", "aud", "sub"]);
        validation
    }
}

fn algorithm_of(algorithm: OidcAlgorithm) -> Algorithm {
    match algorithm {
        OidcAlgorithm::Rs256 => Algorithm::RS256,
        OidcAlgorithm::Es256 => Algorithm::ES256,
    }
}

/// Why a token does not count, for a person.
fn why(kind: &jsonwebtoken::errors::ErrorKind) -> &'static str {
    use jsonwebtoken::errors::ErrorKind as Kind;
    match kind {
        Kind::ExpiredSignature => "The bearer token has expired. Get a new one from the identity provider.",
        Kind::ImmatureSignature => "The bearer token is not valid yet. Is the clock of the identity provider right?",
        Kind::InvalidAudience => "The bearer token is for another service.",
        Kind::InvalidIssuer => "The bearer token is of another issuer.",
        Kind::MissingRequiredClaim(_) => "The bearer token lacks a claim: it needs exp, iss, aud and sub.",
        Kind::InvalidSignature => "The signature of the bearer token does not fit.",
        _ => "The bearer token does not count here.",
    }
}
