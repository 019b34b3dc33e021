//! A service in the test's own process, and a client that knows the document.

pub mod contract;
pub mod fhir;
pub mod samples;

use axum::Router;
use axum::body::Body;
use axum::http::{HeaderMap, Method, Request, StatusCode};
use bytes::Bytes;
use contract::contract;
use serde_json::{Value, json};
use std::sync::Arc;
use surefoot::api::{self, AppState};
use surefoot::cli::serve::recording_limits;
use surefoot::config::Config;
use surefoot::queue::{Queue, QueueSettings};
use surefoot::storage::{Client, Clock, Role, Store, SystemClock};
use surefoot::worker::{Assess, Ran, Worker};
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;

/// One service on a data directory of its own. No worker runs: [`TestApp::run_pending_jobs`] drains the queue.
pub struct TestApp {
    pub folder: TempDir,
    pub state: AppState,
    pub worker: Worker,
    pub admin: String,
    router: Router,
}

impl TestApp {
    pub async fn new() -> Self {
        Self::with_config(Config::default()).await
    }

    pub async fn with_config(config: Config) -> Self {
        Self::with_clock(config, Arc::new(SystemClock)).await
    }

    pub async fn with_clock(config: Config, clock: Arc<dyn Clock>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = Config { data_dir: folder.path().to_owned(), ..config };
        let store = Store::open_with_clock(&config.data_dir, clock).await.unwrap();
        let admin = store.ensure_first_admin().await.unwrap().expect("an empty database").reveal().to_owned();
        let queue = Queue::new(store, QueueSettings::from(&config));
        let limits = recording_limits(&config);
        let worker = Worker::new(queue.clone(), "test", limits.clone(), CancellationToken::new());
        let state = AppState::new(queue, config, limits).unwrap();
        Self { folder, router: api::router(state.clone()), state, worker, admin }
    }

    /// The same service whose worker gives `assess` as its result.
    pub async fn with_assess(assess: Arc<Assess>) -> Self {
        let mut app = Self::new().await;
        app.worker = app.worker.with_assess(assess);
        app
    }

    /// The same service on another state, such as one with a clock of the test's own.
    pub fn use_state(&mut self, state: AppState) {
        self.router = api::router(state.clone());
        self.state = state;
    }

    /// A new key in the organisation of `app.admin`.
    pub async fn key(&self, role: Role) -> String {
        let organisation = self.state.store.organisations().await.unwrap()[0].id;
        self.key_in(organisation, role).await.1
    }

    /// The admin key of another organisation.
    pub async fn stranger(&self) -> String {
        self.stranger_of("elsewhere").await
    }

    /// The admin key of another organisation of this name.
    pub async fn stranger_of(&self, organisation: &str) -> String {
        let organisation = self.state.store.create_organisation(organisation).await.unwrap();
        self.key_in(organisation.id, Role::Admin).await.1
    }

    /// A key of a role in an organisation, and its holder.
    pub async fn key_in(&self, organisation: surefoot::storage::OrganisationId, role: Role) -> (Client, String) {
        let (client, key) = self.state.store.create_client(organisation, role, role.name()).await.unwrap();
        (client, key.reveal().to_owned())
    }

    /// Runs every job that is due.
    pub async fn run_pending_jobs(&self) {
        while self.worker.run_next().await.unwrap() != Ran::QueueEmpty {}
    }

    pub fn get(&self, path: &str) -> Call<'_> {
        Call::new(self, Method::GET, path)
    }

    pub fn post(&self, path: &str) -> Call<'_> {
        Call::new(self, Method::POST, path)
    }

    pub fn request(&self, method: Method, path: &str) -> Call<'_> {
        Call::new(self, method, path)
    }

    /// Id of a new patient, who consents to assessment.
    pub async fn patient(&self, pseudonym: &str) -> String {
        let patient = self.patient_without_consent(pseudonym).await;
        self.consent(&patient, &self.admin).await;
        patient
    }

    /// Id of a new patient.
    pub async fn patient_without_consent(&self, pseudonym: &str) -> String {
        let made = self.post("/v1/patients").json(&json!({"pseudonym": pseudonym})).send().await;
        made.expect(StatusCode::CREATED)["id"].as_str().unwrap().to_owned()
    }

    /// Records a patient's consent to assessment.
    pub async fn consent(&self, patient: &str, key: &str) {
        let consent = json!({"scope": "assessment", "text_version": "test"});
        let recorded = self.post(&format!("/v1/patients/{patient}/consents")).key(key).json(&consent).send().await;
        recorded.expect(StatusCode::CREATED);
    }

    /// Id of a new session of a new patient.
    pub async fn session(&self) -> String {
        self.session_of("P-1").await
    }

    /// Id of a new session of a new patient of this pseudonym.
    pub async fn session_of(&self, pseudonym: &str) -> String {
        let patient = self.patient(pseudonym).await;
        let made = self.post("/v1/sessions").json(&json!({"patient_id": patient})).send().await;
        made.expect(StatusCode::CREATED)["id"].as_str().unwrap().to_owned()
    }

    /// Uploads a sound JSON recording into a new session; the body of the answer.
    pub async fn uploaded(&self) -> Value {
        let session = self.session().await;
        let upload = self.post(&format!("/v1/sessions/{session}/recordings"));
        upload.body("application/json", samples::json_recording()).send().await.expect(StatusCode::ACCEPTED)
    }

    /// Uploads and assesses; the id of the assessment.
    pub async fn assessed(&self) -> String {
        let uploaded = self.uploaded().await;
        self.run_pending_jobs().await;
        let job = self.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).send().await.expect(StatusCode::OK);
        assert_eq!(job["state"], "done", "{job:#}");
        text(&job["assessment_id"]).to_owned()
    }

    /// Rows of recordings and files of uploads: what a refused upload must not add to.
    pub async fn stored_uploads(&self) -> usize {
        let files = |name: &str| count_files(&self.folder.path().join(name));
        files("parts") + files("blobs")
    }
}

fn count_files(folder: &std::path::Path) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { count_files(&path) } else { 1 }).sum()
}

/// A JSON string.
pub fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("not a string: {value}"))
}

/// A request that is being put together; it carries the admin key unless told otherwise.
pub struct Call<'a> {
    app: &'a TestApp,
    method: Method,
    path: String,
    request: axum::http::request::Builder,
    key: Option<String>,
    body: Body,
}

impl<'a> Call<'a> {
    fn new(app: &'a TestApp, method: Method, path: &str) -> Self {
        let request = Request::builder().method(method.clone()).uri(path);
        Self { app, method, path: path.to_owned(), request, key: Some(app.admin.clone()), body: Body::empty() }
    }

    pub fn key(mut self, key: &str) -> Self {
        self.key = Some(key.to_owned());
        self
    }

    pub fn without_key(mut self) -> Self {
        self.key = None;
        self
    }

    /// Comes over a connection from this address.
    pub fn from(mut self, address: &str) -> Self {
        let address: std::net::SocketAddr = address.parse().unwrap();
        self.request = self.request.extension(axum::extract::ConnectInfo(address));
        self
    }

    pub fn header(mut self, name: &str, value: &str) -> Self {
        self.request = self.request.header(name, value);
        self
    }

    pub fn json(self, value: &Value) -> Self {
        self.body("application/json", value.to_string())
    }

    pub fn body(mut self, content_type: &str, body: impl Into<Body>) -> Self {
        self.request = self.request.header("content-type", content_type);
        self.body = body.into();
        self
    }

    /// Sends it, reads the whole answer, and holds it against the document.
    pub async fn send(self) -> Answer {
        let (app, method, path) = (self.app, self.method.clone(), self.path.clone());
        let request = self.into_request();
        let response = app.router.clone().oneshot(request).await.unwrap();
        let (parts, body) = response.into_parts();
        let body = axum::body::to_bytes(body, usize::MAX).await.unwrap();
        let answer = Answer { status: parts.status, headers: parts.headers, body };
        contract().check(&method, &path, &answer);
        answer
    }

    /// Sends it and gives the answer before its body; for bodies that last.
    pub async fn open(self) -> axum::response::Response {
        let app = self.app;
        app.router.clone().oneshot(self.into_request()).await.unwrap()
    }

    fn into_request(self) -> Request<Body> {
        let mut request = self.request;
        if let Some(key) = &self.key {
            request = request.header("authorization", format!("Bearer {key}"));
        }
        request.body(self.body).unwrap()
    }
}

/// A whole answer.
#[derive(Debug)]
pub struct Answer {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub body: Bytes,
}

impl Answer {
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {:?}", self.body))
    }

    /// The body of an answer that must have this status.
    pub fn expect(&self, status: StatusCode) -> Value {
        assert_eq!(self.status, status, "{}", String::from_utf8_lossy(&self.body));
        if self.body.is_empty() { Value::Null } else { self.json() }
    }

    /// The problem of a refusal that must have this status and code.
    pub fn refused(&self, status: u16, code: &str) -> Value {
        let problem = self.json();
        assert_eq!((self.status.as_u16(), text(&problem["code"])), (status, code), "{problem:#}");
        assert_eq!(self.header("content-type"), "application/problem+json");
        problem
    }
}
