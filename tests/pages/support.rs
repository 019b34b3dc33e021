//! A service in the test's own process, and a visitor with a cookie.

use axum::Router;
use axum::body::Body;
use axum::http::{HeaderMap, Method, Request, StatusCode};
use serde_json::{Value, json};
use surefoot::api::AppState;
use surefoot::cli::serve::recording_limits;
use surefoot::config::Config;
use surefoot::pages;
use surefoot::queue::{Queue, QueueSettings};
use surefoot::storage::{OrganisationId, Role, Store};
use surefoot::worker::{Ran, Worker};
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;

/// One service on a data directory of its own; [`Clinic::run_pending_jobs`] drains the queue.
pub struct Clinic {
    _folder: TempDir,
    pub state: AppState,
    worker: Worker,
    pub router: Router,
    /// A clinician's key.
    pub key: String,
}

/// An answer, whole.
pub struct Answer {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub body: String,
}

impl Answer {
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }

    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.body))
    }
}

impl Clinic {
    pub async fn open() -> Self {
        Self::with_config(Config::default()).await
    }

    pub async fn with_config(config: Config) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = Config { data_dir: folder.path().to_owned(), ..config };
        let store = Store::open(&config.data_dir).await.unwrap();
        store.ensure_first_admin().await.unwrap();
        let organisation = store.organisations().await.unwrap()[0].id;
        let (_, key) = store.create_client(organisation, Role::Clinician, "ward <b>3</b>").await.unwrap();
        let queue = Queue::new(store, QueueSettings::from(&config));
        let limits = recording_limits(&config);
        let worker = Worker::new(queue.clone(), "test", limits.clone(), CancellationToken::new());
        let state = AppState::new(queue, config, limits).unwrap();
        let router = pages::router(state.clone());
        Self { _folder: folder, state, worker, router, key: key.reveal().to_owned() }
    }

    pub async fn organisation(&self) -> OrganisationId {
        self.state.store.organisations().await.unwrap()[0].id
    }

    /// A key of a role; in an organisation of its own with `elsewhere`.
    pub async fn key_of(&self, role: Role, elsewhere: bool) -> String {
        let organisation = match elsewhere {
            true => self.state.store.create_organisation("elsewhere").await.unwrap().id,
            false => self.organisation().await,
        };
        self.state.store.create_client(organisation, role, role.name()).await.unwrap().1.reveal().to_owned()
    }

    pub async fn run_pending_jobs(&self) {
        while self.worker.run_next().await.unwrap() != Ran::QueueEmpty {}
    }

    pub async fn send(&self, method: Method, path: &str, headers: &[(&str, &str)], body: impl Into<Body>) -> Answer {
        let mut request = Request::builder().method(method).uri(path);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let response = self.router.clone().oneshot(request.body(body.into()).unwrap()).await.unwrap();
        let (parts, body) = response.into_parts();
        let body = axum::body::to_bytes(body, usize::MAX).await.unwrap();
        Answer { status: parts.status, headers: parts.headers, body: String::from_utf8_lossy(&body).into_owned() }
    }

    /// Sends the sign-in form as a browser does.
    pub async fn sign_in(&self, key: &str, more: &[(&str, &str)]) -> Answer {
        let mut headers =
            vec![("content-type", "application/x-www-form-urlencoded"), ("sec-fetch-site", "same-origin")];
        headers.extend(more);
        self.send(Method::POST, "/app/sign-in", &headers, format!("key={key}&next=%2Fapp%2Fpatients")).await
    }

    /// Sends a form of a page as a browser does.
    pub async fn form(&self, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        self.form_from(std::net::SocketAddr::from(([127, 0, 0, 1], 1)), path, headers, body).await
    }

    /// Sends a form over a connection from an address.
    pub async fn form_from(
        &self,
        from: std::net::SocketAddr,
        path: &str,
        headers: &[(&str, &str)],
        body: &str,
    ) -> Answer {
        let mut request = Request::builder().method(Method::POST).uri(path).extension(axum::extract::ConnectInfo(from));
        request = request.header("content-type", "application/x-www-form-urlencoded");
        if !headers.iter().any(|(name, _)| *name == "sec-fetch-site") {
            request = request.header("sec-fetch-site", "same-origin");
        }
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let response = self.router.clone().oneshot(request.body(Body::from(body.to_owned())).unwrap()).await.unwrap();
        let (parts, body) = response.into_parts();
        let body = axum::body::to_bytes(body, usize::MAX).await.unwrap();
        Answer { status: parts.status, headers: parts.headers, body: String::from_utf8_lossy(&body).into_owned() }
    }

    /// The cookie of a new session, as a browser sends it back.
    pub async fn cookie_of(&self, key: &str) -> String {
        let answer = self.sign_in(key, &[]).await;
        assert_eq!(answer.status, StatusCode::SEE_OTHER, "{}", answer.body);
        answer.header("set-cookie").split(';').next().unwrap().to_owned()
    }

    pub async fn get(&self, path: &str, cookie: &str) -> Answer {
        self.send(Method::GET, path, &[("cookie", cookie)], Body::empty()).await
    }

    /// Posts JSON to the API with the clinician's key; the answer's body.
    pub async fn made(&self, path: &str, body: &Value) -> Value {
        let bearer = format!("Bearer {}", self.key);
        let headers = [("authorization", bearer.as_str()), ("content-type", "application/json")];
        let answer = self.send(Method::POST, path, &headers, body.to_string()).await;
        assert!(answer.status.is_success(), "{path}: {}", answer.body);
        answer.json()
    }

    /// Uploads a recording to a new session of a patient, who consents; the ids of session and recording.
    pub async fn uploaded(&self, patient: &str, protocol: &str, bytes: Vec<u8>) -> [String; 2] {
        let consent = json!({"scope": "assessment", "text_version": "home 1"});
        self.made(&format!("/v1/patients/{patient}/consents"), &consent).await;
        let session = json!({"patient_id": patient, "protocol": protocol, "notes": "slippers <i>on</i>"});
        let session = text(&self.made("/v1/sessions", &session).await["id"]);
        let bearer = format!("Bearer {}", self.key);
        let headers = [("authorization", bearer.as_str()), ("content-type", "application/mcap")];
        let answer = self.send(Method::POST, &format!("/v1/sessions/{session}/recordings"), &headers, bytes).await;
        assert_eq!(answer.status, StatusCode::ACCEPTED, "{}", answer.body);
        [session, text(&answer.json()["recording"]["id"])]
    }

    /// Id of the newest assessment of a recording.
    pub async fn assessment_of(&self, recording: &str) -> String {
        let bearer = format!("Bearer {}", self.key);
        let path = format!("/v1/assessments?recording_id={recording}");
        let page = self.send(Method::GET, &path, &[("authorization", &bearer)], Body::empty()).await.json();
        text(&page["items"][0]["id"])
    }

    /// A patient of the rules' population with three walks and three rises; the id.
    pub async fn followed_patient(&self, pseudonym: &str) -> String {
        let new = json!({"pseudonym": pseudonym, "birth_year": 1948, "sex": "male", "uses_walking_aid": false, "height_m": 1.74});
        let patient = text(&self.made("/v1/patients", &new).await["id"]);
        let answers = json!({"falls_12_months": 1, "lives_in_community": true, "worries_about_falling": false});
        self.made(&format!("/v1/patients/{patient}/questionnaires"), &answers).await;
        for (day, speed, rises) in [(1, 1.05, 14.0), (8, 0.98, 13.0), (15, 0.70, 12.9)] {
            let measures = json!({
                "usual_speed_mps": {"value": speed, "standard_error": 0.02, "n_observations": 12},
                "five_times_sit_to_stand_s": {"value": rises, "standard_error": 0.1},
                "timed_up_and_go_s": {"value": 14.9, "standard_error": 0.4}
            });
            let body = json!({"measured_at": format!("2026-03-{day:02}T10:00:00Z"), "measures": measures});
            self.made(&format!("/v1/patients/{patient}/measurements"), &body).await;
        }
        let plan = json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee", "repetitions": 10}]});
        self.made(&format!("/v1/patients/{patient}/training-plans"), &plan).await;
        patient
    }
}

/// A JSON string.
pub fn text(value: &Value) -> String {
    value.as_str().unwrap_or_else(|| panic!("not a string: {value}")).to_owned()
}
