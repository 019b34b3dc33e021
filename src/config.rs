//! What the operator can set. Sources, later ones win: defaults, `surefoot.toml`, environment `SUREFOOT_…`, flags.

use ipnet::IpNet;
use serde::{Deserialize, Serialize};
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;

/// Configuration of `surefoot serve`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Directory of the database file and the blob folder; made when absent.
    pub data_dir: PathBuf,
    /// Address of the PostgreSQL database that holds the rows in place of the file, `postgres://…`; needs the build feature `scaleout`.
    pub database_url: Option<String>,
    /// Address of the bucket that holds the recordings in place of the folder, `s3://bucket/prefix`; needs the build feature
    /// `scaleout`. Credentials, region and endpoint come from the environment variables `AWS_…`.
    pub blob_url: Option<String>,
    /// Address of the NATS server that carries the ids of new jobs to workers on other machines, `nats://…`; needs the build feature
    /// `scaleout`.
    pub nats_url: Option<String>,
    /// Name by which installations that share a NATS server are kept apart.
    pub nats_subject: String,
    /// Address to listen on.
    pub listen: SocketAddr,
    /// Jobs that run at the same time; 0 leaves them to another process.
    pub workers: usize,
    /// Largest accepted recording, bytes.
    pub max_recording_bytes: u64,
    /// Largest accepted JSON recording, bytes; a JSON document is parsed in memory.
    pub max_json_recording_bytes: u64,
    /// Hours for which the bytes of an unfinished resumable upload are kept after the last of them arrived.
    pub resumable_upload_hours: u64,
    /// Time after which a job whose worker fell silent runs again, seconds.
    pub lease_s: u64,
    /// Whether workers assess recordings whose truth is known before they take jobs; it costs some seconds at the start.
    pub canary: bool,
    /// Jobs that may wait in all; further uploads are told to come again (503).
    pub max_waiting_jobs: u64,
    /// Jobs of one organisation that may wait; its further uploads are told to come again (429).
    pub max_waiting_jobs_of_organisation: u64,
    /// Times a job is tried before it is given up.
    pub max_attempts: u32,
    /// True when browsers reach the service through TLS only: cookies of the pages then never travel without it. A proxy that sends
    /// `X-Forwarded-Proto: https` has the same effect.
    pub behind_tls: bool,
    /// Addresses or networks of the proxies before the service; the address of a client is taken from `X-Forwarded-For` only when one
    /// of them says it.
    pub trusted_proxies: Vec<Network>,
    /// Requests that one key or user may send in a minute, and at once; 0 for no limit.
    pub requests_per_minute: u32,
    /// Requests without a valid key that one address may send in a minute, and at once; 0 for no limit.
    pub anonymous_requests_per_minute: u32,
    /// False only on a test stand without people: uploads and jobs then need no consent of the patient.
    pub require_consent: bool,
    /// Days after which the bytes of a recording that was assessed are removed, from its upload on; 0 keeps them.
    pub retain_recordings_days: u32,
    /// Days without a session after which a patient is erased; 0 keeps patients.
    pub retain_patients_days: u32,
    /// Days after which entries of the audit log are removed; 0 keeps them.
    pub retain_audit_days: u32,
    /// Tokens of an identity provider.
    pub oidc: OidcConfig,
}

/// Whose bearer tokens are taken besides keys (OpenID Connect, RFC 9068). Without an issuer, nobody's.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OidcConfig {
    /// The issuer, exactly as its tokens name it; empty for none.
    pub issuer: String,
    /// What tokens for this service name as their audience.
    pub audience: String,
    /// Algorithms of signatures that are taken, and no other.
    pub algorithms: Vec<OidcAlgorithm>,
    /// Address of the issuer's keys; empty to take it from the issuer's `/.well-known/openid-configuration`.
    pub jwks_uri: String,
    /// Claim with the roles: a list, or words with spaces between them. A name with points leads into objects.
    pub roles_claim: String,
    /// The role of a clinician in that claim.
    pub clinician_role: String,
    /// The role of an administrator in that claim.
    pub admin_role: String,
    /// Claim with the name of the organisation, which must be there already.
    pub organisation_claim: String,
    /// Claim with who it is, for people; the subject where it is missing.
    pub label_claim: String,
}

/// An algorithm of signatures with a public key. Those with a shared secret, and none at all, cannot be named.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum OidcAlgorithm {
    /// RSA, PKCS #1 v1.5, SHA-256.
    #[serde(rename = "RS256")]
    Rs256,
    /// ECDSA on P-256, SHA-256.
    #[serde(rename = "ES256")]
    Es256,
}

impl Default for OidcConfig {
    fn default() -> Self {
        Self {
            issuer: String::new(),
            audience: String::new(),
            algorithms: vec![OidcAlgorithm::Rs256, OidcAlgorithm::Es256],
            jwks_uri: String::new(),
            roles_claim: "roles".to_owned(),
            clinician_role: "clinician".to_owned(),
            admin_role: "admin".to_owned(),
            organisation_claim: "organisation".to_owned(),
            label_claim: "name".to_owned(),
        }
    }
}

/// A network of addresses; one address is the smallest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Network(IpNet);

impl Network {
    /// True of an address that lies in it.
    pub fn contains(&self, address: IpAddr) -> bool {
        self.0.contains(&address)
    }
}

impl TryFrom<String> for Network {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let one = text.parse::<IpAddr>().map(IpNet::from);
        one.or_else(|_| text.parse()).map(Self).map_err(|_| format!("`{text}` is no address and no network"))
    }
}

impl From<Network> for String {
    fn from(network: Network) -> Self {
        network.0.to_string()
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            data_dir: PathBuf::from("surefoot-data"),
            database_url: None,
            blob_url: None,
            nats_url: None,
            nats_subject: "surefoot".to_owned(),
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            workers: 2,
            max_recording_bytes: 1 << 30,
            max_json_recording_bytes: 32 << 20,
            resumable_upload_hours: 24,
            lease_s: 30,
            canary: true,
            max_waiting_jobs: 20_000,
            max_waiting_jobs_of_organisation: 5_000,
            max_attempts: 3,
            behind_tls: false,
            trusted_proxies: Vec::new(),
            requests_per_minute: 1200,
            anonymous_requests_per_minute: 120,
            oidc: OidcConfig::default(),
            require_consent: true,
            retain_recordings_days: 0,
            retain_patients_days: 0,
            retain_audit_days: 0,
        }
    }
}
