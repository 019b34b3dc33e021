//! Who may do what, walked through the committed document: every operation without a key, with too low a role, and with the ids
//! of another organisation. Roles are read from the document; what is open to all stands in [`OPEN`], what has an id that belongs
//! to nobody in [`PUBLIC_IDS`], and nothing else is excepted.

use crate::support::{Answer, Call, TestApp, samples, text};
use axum::http::{Method, StatusCode};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::Path;
use surefoot::config::Config;
use surefoot::storage::Role;

/// Operations without a key.
const OPEN: [&str; 6] = [
    "fhir_metadata",
    "read_liveness",
    "read_readiness",
    "read_metrics",
    "read_upload_options",
    "read_upload_options_of_session",
];
/// What stands before an id that is the same for every organisation.
const PUBLIC_IDS: [&str; 1] = ["protocols"];

/// One operation of the document.
#[derive(Debug)]
struct Operation {
    id: String,
    method: Method,
    path: String,
    /// The role that is needed at least; none for an open one.
    role: Option<Role>,
    /// Names of the parameters of its query, and whether each is required.
    query: Vec<(String, bool)>,
}

fn operations() -> Vec<Operation> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/openapi.json");
    let document: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut operations = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let parameters = operation["parameters"].as_array().cloned().unwrap_or_default();
            let query = parameters.iter().filter(|parameter| parameter["in"] == "query");
            operations.push(Operation {
                id: text(&operation["operationId"]).to_owned(),
                method: method.to_uppercase().parse().unwrap(),
                path: path.clone(),
                role: role_of(operation),
                query: query.map(|p| (text(&p["name"]).to_owned(), p["required"] == true)).collect(),
            });
        }
    }
    operations
}

/// The role in the security requirement of an operation. One that says nothing of its own is a defect of the document.
fn role_of(operation: &Value) -> Option<Role> {
    let what = &operation["operationId"];
    let requirements = operation["security"].as_array().unwrap_or_else(|| panic!("{what} names no role"));
    let [requirement] = requirements.as_slice() else { panic!("{what}: one requirement is expected") };
    if requirement.as_object().unwrap().is_empty() {
        return None;
    }
    match requirement["api_key"][0].as_str() {
        Some("device") => Some(Role::Device),
        Some("clinician") => Some(Role::Clinician),
        Some("admin") => Some(Role::Admin),
        other => panic!("{what}: no role: {other:?}"),
    }
}

/// An organisation with one of everything.
struct House {
    app: TestApp,
    /// An id for each word that stands before one in a path.
    ids: HashMap<&'static str, String>,
}

impl House {
    async fn build() -> Self {
        let unlimited = Config { requests_per_minute: 0, anonymous_requests_per_minute: 0, ..Config::default() };
        let app = TestApp::with_config(unlimited).await;
        let assessment = app.assessed().await;
        let mut ids = HashMap::from([("assessments", assessment.clone())]);
        let read = app.get(&format!("/v1/assessments/{assessment}")).send().await.expect(StatusCode::OK);
        for (kind, field) in [("patients", "patient_id"), ("sessions", "session_id"), ("recordings", "recording_id")] {
            ids.insert(kind, text(&read[field]).to_owned());
        }
        ids.insert("jobs", text(&read["job_id"]).to_owned());
        let patient = ids["patients"].clone();
        let made = app.post("/v1/clients").json(&json!({"role": "device", "label": "kit"})).send().await;
        ids.insert("clients", text(&made.expect(StatusCode::CREATED)["client"]["id"]).to_owned());

        let measured = app.post(&format!("/v1/patients/{patient}/measurements")).json(&measurement());
        measured.send().await.expect(StatusCode::CREATED);
        for resource in ["Observation", "RiskAssessment", "DiagnosticReport"] {
            let found = app.get(&format!("/fhir/R4/{resource}?patient={patient}")).send().await;
            let found = found.expect(StatusCode::OK);
            ids.insert(resource, text(&found["entry"][0]["resource"]["id"]).to_owned());
        }
        let made = app.post("/v1/users").json(&user("m.lee")).send().await.expect(StatusCode::CREATED);
        ids.insert("users", text(&made["user"]["id"]).to_owned());
        let elsewhere = app.state.store.create_organisation("receivers").await.unwrap();
        let receiver = app.key_in(elsewhere.id, Role::Clinician).await.0;
        let share = json!({"receiver_id": receiver.id, "expires_at": tomorrow()});
        let made = app.post(&format!("/v1/patients/{patient}/shares")).json(&share).send().await;
        ids.insert("shares", text(&made.expect(StatusCode::CREATED)["id"]).to_owned());
        let begun = app.post(&format!("/v1/sessions/{}/uploads", ids["sessions"])).header("tus-resumable", "1.0.0");
        let begun = begun.header("upload-length", "100").send().await;
        begun.expect(StatusCode::CREATED);
        ids.insert("uploads", begun.header("location").rsplit('/').next().unwrap().to_owned());
        ids.insert("noise-models", trained_model(&app, &ids["sessions"]).await);
        Self { app, ids }
    }

    /// A request for an operation on this house's things.
    fn ask(&self, operation: &Operation) -> Call<'_> {
        let mut path = String::new();
        let mut before = "";
        for part in operation.path.split('/').skip(1) {
            path.push('/');
            match part {
                "{id}" if PUBLIC_IDS.contains(&before) => path.push_str("sit_to_stand"),
                "{id}" | "{upload_id}" => {
                    let id = self.ids.get(before).unwrap_or_else(|| panic!("{}: whose id is it?", operation.path));
                    path.push_str(id);
                }
                other => path.push_str(other),
            }
            before = part;
        }
        let pairs: Vec<String> = operation
            .query
            .iter()
            .filter_map(|(name, is_required)| {
                let kind = match name.as_str() {
                    "patient" | "patient_id" => "patients",
                    "session_id" => "sessions",
                    "recording_id" => "recordings",
                    "form" => return Some("form=csv".to_owned()),
                    other => {
                        assert!(!is_required, "{}: what is `{other}`?", operation.id);
                        return None;
                    }
                };
                Some(format!("{name}={}", self.ids[kind]))
            })
            .collect();
        if !pairs.is_empty() {
            path = format!("{path}?{}", pairs.join("&"));
        }
        let call = self.app.request(operation.method.clone(), &path);
        match operation.id.as_str() {
            "upload_recording" => call.body("application/json", samples::json_recording()),
            "create_upload" => call.header("tus-resumable", "1.0.0").header("upload-length", "100"),
            "read_upload_offset" | "terminate_upload" => call.header("tus-resumable", "1.0.0"),
            "continue_upload" => {
                let call = call.header("tus-resumable", "1.0.0").header("upload-offset", "0");
                call.body("application/offset+octet-stream", vec![0; 10])
            }
            "erase_patient" => call.header("x-confirm-pseudonym", "P-1"),
            id if [Method::POST, Method::PATCH, Method::PUT].contains(&operation.method) => {
                call.json(&self.body_of(id))
            }
            _ => call,
        }
    }

    /// A sound body for an operation that takes one.
    fn body_of(&self, operation: &str) -> Value {
        match operation {
            "create_patient" => json!({"pseudonym": "P-new"}),
            "update_patient" => json!({"birth_year": 1950}),
            "create_session" => json!({"patient_id": self.ids["patients"]}),
            "create_job" => json!({"pipeline": "joint_angles"}),
            "cancel_job" | "rotate_client" | "reset_user" => json!({}),
            "create_client" => json!({"role": "device", "label": "another"}),
            "create_user" => user("k.stone"),
            "create_share" => json!({"receiver_id": self.ids["clients"], "expires_at": tomorrow()}),
            "create_noise_model" => {
                json!({"name": "theirs", "static_recordings": [self.ids["recordings"], self.ids["jobs"]]})
            }
            "record_consent" => json!({"scope": "assessment", "text_version": "1"}),
            "withdraw_consent" => json!({"scope": "assessment"}),
            "add_questionnaire" => json!({"falls_12_months": 1}),
            "add_measurement" => measurement(),
            "add_training_plan" => json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee"}]}),
            other => panic!("no body is known for {other}"),
        }
    }

    /// Nothing of this house stands in an answer.
    fn assert_tells_nothing(&self, what: &str, answer: &Answer) {
        let told = String::from_utf8_lossy(&answer.body);
        for (kind, id) in &self.ids {
            assert!(!told.contains(id.as_str()), "{what} tells of {kind}: {told}");
        }
        assert!(!told.contains("\"P-1\""), "{what}: {told}");
    }
}

fn user(name: &str) -> Value {
    json!({"name": name, "role": "clinician", "label": "somebody"})
}

fn tomorrow() -> String {
    let format = &time::format_description::well_known::Rfc3339;
    (time::OffsetDateTime::now_utc() + time::Duration::DAY).format(format).unwrap()
}

fn measurement() -> Value {
    json!({"measured_at": "2026-11-01T10:00:00Z", "measures": {"usual_speed_mps": {"value": 0.9}}})
}

/// Id of a noise model, trained on recordings that are not assessed.
async fn trained_model(app: &TestApp, session: &str) -> String {
    let mut recordings = Vec::new();
    for seed in [1, 2] {
        let upload = app.post(&format!("/v1/sessions/{session}/recordings"));
        let uploaded = upload.body("application/mcap", samples::standing_still(11, seed)).send().await;
        let uploaded = uploaded.expect(StatusCode::ACCEPTED);
        let cancel = app.post(&format!("/v1/jobs/{}/cancel", text(&uploaded["job"]["id"])));
        cancel.send().await.expect(StatusCode::ACCEPTED);
        recordings.push(uploaded["recording"]["id"].clone());
    }
    let request = json!({"name": "ward-3", "static_recordings": recordings});
    let job = app.post("/v1/noise-models").json(&request).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&job["id"]))).send().await.expect(StatusCode::OK);
    assert_eq!(job["state"], "done", "{job:#}");
    text(&job["noise_model_id"]).to_owned()
}

#[tokio::test]
async fn every_operation_holds_the_walls_that_the_document_names() {
    let house = House::build().await;
    let keys = HashMap::from([
        (Role::Device, house.app.key(Role::Device).await),
        (Role::Clinician, house.app.key(Role::Clinician).await),
        (Role::Admin, house.app.admin.clone()),
    ]);
    let stranger = house.app.stranger().await;
    let order = [Role::Device, Role::Clinician, Role::Admin];
    let (mut refused_roles, mut absent) = (0, 0);
    for operation in operations() {
        let what = format!("{} ({} {})", operation.id, operation.method, operation.path);
        let Some(role) = operation.role else {
            assert!(OPEN.contains(&operation.id.as_str()), "{what} is open and not listed as such");
            let answer = house.ask(&operation).without_key().send().await;
            assert!(answer.status.is_success(), "{what}: {answer:?}");
            house.assert_tells_nothing(&what, &answer);
            continue;
        };
        assert!(!OPEN.contains(&operation.id.as_str()), "{what} is listed as open and needs a key");

        let answer = house.ask(&operation).without_key().send().await;
        assert_eq!(answer.status, StatusCode::UNAUTHORIZED, "{what} without a key: {answer:?}");
        for lower in order.into_iter().take_while(|lower| *lower != role) {
            let answer = house.ask(&operation).key(&keys[&lower]).send().await;
            assert_eq!(answer.status, StatusCode::FORBIDDEN, "{what} as {}: {answer:?}", lower.name());
            refused_roles += 1;
        }
        // An event stream does not end, and what changes something is for the tests of its resource.
        if operation.method == Method::GET && operation.id != "read_job_events" {
            let status = house.ask(&operation).key(&keys[&role]).send().await.status;
            let is_let_in = ![StatusCode::UNAUTHORIZED, StatusCode::FORBIDDEN].contains(&status);
            assert!(is_let_in && !status.is_server_error(), "{what} as {}: {status}", role.name());
        }

        let answer = house.ask(&operation).key(&stranger).send().await;
        let has_own_id = operation.path.split('/').zip(operation.path.split('/').skip(1));
        let has_own_id = has_own_id
            .into_iter()
            .any(|(before, part)| ["{id}", "{upload_id}"].contains(&part) && !PUBLIC_IDS.contains(&before));
        let names_patient = operation.query.iter().any(|(name, is_required)| *is_required && name == "patient");
        if has_own_id || names_patient || operation.id == "create_session" {
            match operation.method {
                Method::HEAD => assert_eq!(answer.status, StatusCode::NOT_FOUND, "{what}"),
                _ => {
                    assert_eq!(answer.status, StatusCode::NOT_FOUND, "{what}: {answer:?}");
                    drop(answer.refused(404, "not_found"));
                }
            }
            absent += 1;
        } else if operation.id == "create_noise_model" {
            let problem = answer.refused(422, "invalid_body");
            assert!(text(&problem["detail"]).contains("no recording that your key may see"), "{what}: {problem:#}");
        } else {
            assert!(answer.status.is_success(), "{what} as another organisation: {answer:?}");
            house.assert_tells_nothing(&what, &answer);
        }
    }
    assert!(refused_roles > 30 && absent > 30, "only {refused_roles} roles and {absent} ids were tried");
}
