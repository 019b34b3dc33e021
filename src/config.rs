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
    /// Address to listen on.
    pub listen: SocketAddr,
    /// Jobs that run at the same time; 0 leaves them to another process.
    pub workers: usize,
    /// Largest accepted recording, bytes.
    pub max_recording_bytes: u64,
    /// Largest accepted JSON recording, bytes; a JSON document is parsed in memory.
    pub max_json_recording_bytes: u64,
    /// Time after which a job whose worker fell silent runs again, seconds.
    pub lease_s: u64,
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
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            workers: 2,
            max_recording_bytes: 1 << 30,
            max_json_recording_bytes: 32 << 20,
            lease_s: 30,
            max_attempts: 3,
            behind_tls: false,
        }
    }
}
