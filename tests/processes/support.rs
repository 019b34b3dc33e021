//! The binary as a process, and a home app that does not give up.

use crate::common::standing;
use base64::Engine;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use surefoot::recording::encode;

/// Time for a service to start, and for a queue to be worked off.
pub const PATIENCE: Duration = Duration::from_secs(900);

/// A number that the environment may set.
pub fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().map_or(default, |text| text.parse().expect("a number"))
}

/// The binary with these settings, killed without warning when it is dropped.
pub struct Process(pub Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A command of the binary under test; `SUREFOOT_BINARY` names another one, such as a release build.
pub fn surefoot(arguments: &[&str]) -> Command {
    let binary = std::env::var("SUREFOOT_BINARY").unwrap_or_else(|_| env!("CARGO_BIN_EXE_surefoot").to_owned());
    let mut command = Command::new(binary);
    command
        .args(arguments)
        .env("SUREFOOT_LOG", "error")
        .env("SUREFOOT_LEASE_S", "2")
        .env("SUREFOOT_CANARY", "false")
        .env("SUREFOOT_REQUESTS_PER_MINUTE", "0")
        .env("SUREFOOT_MAX_ATTEMPTS", "1000");
    command
}

/// A service and where it answers.
pub struct Service {
    pub process: Process,
    pub address: String,
    pub admin_key: Option<String>,
}

impl Service {
    pub fn start(data_dir: &Path, settings: &[(&str, &str)]) -> Self {
        let mut command = surefoot(&["serve", "--json", "--listen", "127.0.0.1:0", "--data-dir"]);
        command.arg(data_dir).envs(settings.iter().copied()).stdout(Stdio::piped());
        let mut process = Process(command.spawn().expect("the binary starts"));
        let mut line = String::new();
        BufReader::new(process.0.stdout.take().expect("a pipe")).read_line(&mut line).expect("a line");
        let started: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: `{line}`"));
        let text = |field: &str| started[field].as_str().map(str::to_owned);
        Self { process, address: text("address").expect("an address"), admin_key: text("admin_key") }
    }
}

/// One who uploads, and sends again what was not acknowledged.
#[derive(Clone)]
pub struct App {
    http: reqwest::Client,
    address: String,
    key: String,
}

impl App {
    pub fn new(service: &Service, key: &str) -> Self {
        Self { http: reqwest::Client::new(), address: service.address.clone(), key: key.to_owned() }
    }

    pub async fn post(&self, path: &str, body: &Value) -> Value {
        let request = self.http.post(format!("{}{path}", self.address)).bearer_auth(&self.key).json(body);
        let response = request.send().await.expect("an answer");
        let status = response.status();
        let body: Value = response.json().await.expect("JSON");
        assert!(status.is_success(), "{path}: {status} {body:#}");
        body
    }

    pub async fn get(&self, path: &str) -> Value {
        serde_json::from_slice(&self.get_bytes(path).await).expect("JSON")
    }

    pub async fn get_bytes(&self, path: &str) -> Vec<u8> {
        let request = self.http.get(format!("{}{path}", self.address)).bearer_auth(&self.key);
        let response = request.send().await.expect("an answer");
        let status = response.status();
        let body = response.bytes().await.expect("a body");
        assert!(status.is_success(), "{path}: {status} {}", String::from_utf8_lossy(&body));
        body.to_vec()
    }

    /// Every item of a list, over all of its pages.
    pub async fn list(&self, path: &str) -> Vec<Value> {
        let separator = if path.contains('?') { '&' } else { '?' };
        let (mut items, mut address) = (Vec::new(), format!("{path}{separator}limit=200"));
        loop {
            let page = self.get(&address).await;
            items.extend(page["items"].as_array().expect("items").iter().cloned());
            match page["next"].as_str() {
                Some(next) => next.clone_into(&mut address),
                None => return items,
            }
        }
    }

    /// Id of a new session of a new patient, who has consented.
    pub async fn session(&self, pseudonym: &str) -> String {
        let patient = self.post("/v1/patients", &json!({"pseudonym": pseudonym})).await;
        let consents = format!("/v1/patients/{}/consents", patient["id"].as_str().expect("an id"));
        self.post(&consents, &json!({"scope": "assessment", "text_version": "test"})).await;
        let session = self.post("/v1/sessions", &json!({"patient_id": patient["id"]})).await;
        session["id"].as_str().expect("an id").to_owned()
    }

    /// One try to upload; the status and the answer, none when the service went away.
    pub async fn try_upload(&self, session: &str, key: &str, recording: Vec<u8>) -> Option<(u16, Value)> {
        let request = self.http.post(format!("{}/v1/sessions/{session}/recordings", self.address));
        let request =
            request.bearer_auth(&self.key).header("idempotency-key", key).header("content-type", "application/json");
        let response = request.body(recording).send().await.ok()?;
        let status = response.status().as_u16();
        Some((status, response.json().await.ok()?))
    }

    /// Address of a new resumable upload.
    pub async fn begin_upload(&self, session: &str, length: usize, content_type: &str) -> String {
        let request = self.http.post(format!("{}/v1/sessions/{session}/uploads", self.address)).bearer_auth(&self.key);
        let said = format!("filetype {}", base64::engine::general_purpose::STANDARD.encode(content_type));
        let request = request.header("tus-resumable", "1.0.0").header("upload-length", length);
        let response = request.header("upload-metadata", said).send().await.expect("an answer");
        assert_eq!(response.status().as_u16(), 201);
        response.headers()["location"].to_str().expect("text").to_owned()
    }

    /// How much of an upload has arrived.
    pub async fn upload_offset(&self, upload: &str) -> usize {
        let request = self.http.head(format!("{}{upload}", self.address)).bearer_auth(&self.key);
        let response = request.header("tus-resumable", "1.0.0").send().await.expect("an answer");
        assert_eq!(response.status().as_u16(), 200);
        response.headers()["upload-offset"].to_str().expect("text").parse().expect("a number")
    }

    /// One try to go on with an upload; the status, none when the service went away.
    pub async fn continue_upload(&self, upload: &str, offset: usize, piece: Vec<u8>) -> Option<u16> {
        let request = self.http.patch(format!("{}{upload}", self.address)).bearer_auth(&self.key);
        let request = request.header("tus-resumable", "1.0.0").header("upload-offset", offset);
        let request = request.header("content-type", "application/offset+octet-stream").body(piece);
        request.send().await.ok().map(|response| response.status().as_u16())
    }

    /// Waits until no job is waiting or running.
    pub async fn until_all_jobs_are_over(&self) {
        let begun = Instant::now();
        loop {
            let mut open = 0;
            for state in ["queued", "running"] {
                let page = self.get(&format!("/v1/jobs?state={state}&limit=1")).await;
                open += page["items"].as_array().expect("items").len();
            }
            if open == 0 {
                return;
            }
            assert!(begun.elapsed() < PATIENCE, "jobs are stuck");
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }
}

/// A JSON recording of a person who sways, `seconds` long at 30 frames a second; another for every `version`.
pub fn recording(seconds: usize, version: usize) -> Vec<u8> {
    encode::json(&standing(30 * seconds, 0.1 + 0.01 * version as f64)).expect("JSON")
}
