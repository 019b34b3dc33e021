//! What the operator can set. Sources, later ones win: defaults, `surefoot.toml`, environment `SUREFOOT_…`, flags.

use serde::{Deserialize, Serialize};
use std::net::SocketAddr;
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
        }
    }
}
