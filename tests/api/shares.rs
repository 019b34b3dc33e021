//! One patient, shared with one clinician of another organisation.

use crate::support::{TestApp, samples, text};
use axum::http::{Method, StatusCode};
use serde_json::{Value, json};
use std::sync::Arc;
use surefoot::config::Config;
use surefoot::storage::{Client, ManualClock, Role};
use time::macros::datetime;

/// A patient with an assessment, and a clinician of another organisation.
struct Scene {
    app: TestApp,
    clock: ManualClock,
    patient: String,
    session: String,
    recording: String,
    assessment: String,
    receiver: Client,
    key: String,
    /// Another clinician of the receiver's organisation.
    colleague: String,
}

impl Scene {
    async fn set() -> Self {
        let clock = ManualClock::at(datetime!(2026-11-28 08:00 UTC));
        let app = TestApp::with_clock(Config::default(), Arc::new(clock.clone())).await;
        let assessment = app.assessed().await;
        let read = app.get(&format!("/v1/assessments/{assessment}")).send().await.expect(StatusCode::OK);
        let [patient, session, recording] =
            ["patient_id", "session_id", "recording_id"].map(|name| text(&read[name]).to_owned());
        let measured = json!({"measured_at": "2026-11-01T10:00:00Z", "measures": {"usual_speed_mps": {"value": 0.9}}});
        let entered = app.post(&format!("/v1/patients/{patient}/measurements")).json(&measured);
        entered.send().await.expect(StatusCode::CREATED);
        let elsewhere = app.state.store.create_organisation("elsewhere").await.unwrap().id;
        let (receiver, key) = app.key_in(elsewhere, Role::Clinician).await;
        let colleague = app.key_in(elsewhere, Role::Admin).await.1;
        Self { app, clock, patient, session, recording, assessment, receiver, key, colleague }
    }

    async fn share(&self) -> Value {
        let body = json!({"receiver_id": self.receiver.id, "expires_at": "2026-11-29T08:00:00Z"});
        let shared = self.app.post(&format!("/v1/patients/{}/shares", self.patient)).json(&body).send().await;
        shared.expect(StatusCode::CREATED)
    }

    /// Everything that is read of the patient, by its address.
    fn readable(&self) -> Vec<String> {
        let Self { patient, session, recording, assessment, .. } = self;
        let of_patient =
            ["", "/questionnaires", "/measurements", "/training-plans", "/fall-risk", "/measures", "/trends"];
        let of_patient = of_patient.into_iter().chain(["/report", "/fhir-bundle"]);
        let of_assessment = ["", "/series?max_points=10", "/export?form=csv", "/joints", "/fhir-bundle"];
        let mut paths: Vec<String> = of_patient.map(|rest| format!("/v1/patients/{patient}{rest}")).collect();
        paths.extend(of_assessment.map(|rest| format!("/v1/assessments/{assessment}{rest}")));
        paths.extend([
            format!("/v1/sessions/{session}"),
            format!("/v1/sessions/{session}/recordings"),
            format!("/v1/recordings/{recording}"),
            format!("/v1/recordings/{recording}/content"),
        ]);
        let found = ["Observation", "RiskAssessment", "DiagnosticReport"];
        paths.extend(found.map(|resource| format!("/fhir/R4/{resource}?patient={patient}")));
        paths
    }

    /// Lists that name the patient, its session or its recording in a filter.
    fn lists(&self) -> [String; 4] {
        let Self { patient, session, recording, .. } = self;
        [
            format!("/v1/sessions?patient_id={patient}"),
            format!("/v1/assessments?patient_id={patient}"),
            format!("/v1/assessments?session_id={session}"),
            format!("/v1/assessments?recording_id={recording}"),
        ]
    }

    async fn reads(&self, key: &str, path: &str) -> StatusCode {
        self.app.get(path).key(key).send().await.status
    }

    async fn items(&self, key: &str, path: &str) -> usize {
        let page = self.app.get(path).key(key).send().await.expect(StatusCode::OK);
        page["items"].as_array().unwrap().len()
    }

    async fn sees_nothing(&self, key: &str) {
        for path in self.readable() {
            assert_eq!(self.reads(key, &path).await, StatusCode::NOT_FOUND, "{path}");
        }
        for path in self.lists() {
            assert_eq!(self.items(key, &path).await, 0, "{path}");
        }
    }
}

#[tokio::test]
async fn everything_of_a_shared_patient_is_read_by_its_receiver_alone_until_it_is_revoked() {
    let scene = Scene::set().await;
    scene.sees_nothing(&scene.key).await;
    let share = scene.share().await;
    assert_eq!((&share["pseudonym"], &share["organisation"]), (&json!("P-1"), &json!("default")));
    for path in scene.readable() {
        assert_eq!(scene.reads(&scene.key, &path).await, StatusCode::OK, "{path}");
    }
    for path in scene.lists() {
        assert_eq!(scene.items(&scene.key, &path).await, 1, "{path}");
    }
    let searched = format!("/fhir/R4/Observation?patient={}", scene.patient);
    let searched = scene.app.get(&searched).key(&scene.key).send().await.expect(StatusCode::OK);
    let observation = text(&searched["entry"][0]["resource"]["id"]);
    assert_eq!(scene.reads(&scene.key, &format!("/fhir/R4/Observation/{observation}")).await, StatusCode::OK);
    // The report holds what the owner's holds.
    let report = format!("/v1/patients/{}/report?as_of=2026-11-28T08:00:00Z", scene.patient);
    let own = scene.app.get(&report).send().await.expect(StatusCode::OK);
    assert_eq!(scene.app.get(&report).key(&scene.key).send().await.expect(StatusCode::OK), own);

    scene.sees_nothing(&scene.colleague).await;
    let received = scene.app.get("/v1/shares").key(&scene.key).send().await.expect(StatusCode::OK);
    assert_eq!(received["items"][0]["patient_id"], json!(scene.patient));
    assert_eq!(scene.items(&scene.colleague, "/v1/shares").await, 0);
    // Lists of all that one has stay what they were.
    for path in ["/v1/patients", "/v1/sessions", "/v1/assessments", "/v1/jobs"] {
        assert_eq!(scene.items(&scene.key, path).await, 0, "{path}");
    }

    let path = format!("/v1/shares/{}", text(&share["id"]));
    scene.app.request(Method::DELETE, &path).key(&scene.key).send().await.refused(404, "not_found");
    let revoked = scene.app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert!(revoked["revoked_at"].is_string());
    scene.sees_nothing(&scene.key).await;
    assert_eq!(scene.items(&scene.key, "/v1/shares").await, 0);
    assert_eq!(scene.items(&scene.app.admin, &format!("/v1/patients/{}/shares", scene.patient)).await, 1);
}

#[tokio::test]
async fn a_share_ends_by_itself_and_other_patients_stay_out_of_reach() {
    let scene = Scene::set().await;
    let other = scene.app.patient("P-2").await;
    scene.share().await;
    let shared = format!("/v1/patients/{}", scene.patient);
    assert_eq!(scene.reads(&scene.key, &shared).await, StatusCode::OK);
    assert_eq!(scene.reads(&scene.key, &format!("/v1/patients/{other}")).await, StatusCode::NOT_FOUND);
    scene.clock.advance(time::Duration::DAY);
    scene.sees_nothing(&scene.key).await;
}

#[tokio::test]
async fn a_receiver_changes_nothing_and_sees_no_work() {
    let scene = Scene::set().await;
    scene.share().await;
    let Scene { app, patient, session, recording, .. } = &scene;
    let job = app.get("/v1/jobs").send().await.expect(StatusCode::OK);
    let job = text(&job["items"][0]["id"]);
    let post = |path: String, body: Value| app.post(&path).key(&scene.key).json(&body);
    let refused = [
        post("/v1/sessions".into(), json!({"patient_id": patient})),
        post(format!("/v1/patients/{patient}/questionnaires"), json!({"falls_12_months": 1})),
        post(
            format!("/v1/patients/{patient}/training-plans"),
            json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee"}]}),
        ),
        post(format!("/v1/recordings/{recording}/jobs"), json!({"pipeline": "joint_angles"})),
        post(format!("/v1/jobs/{job}/cancel"), json!({})),
        post(
            format!("/v1/patients/{patient}/shares"),
            json!({"receiver_id": scene.receiver.id, "expires_at": "2026-11-29T08:00:00Z"}),
        ),
        app.request(Method::PATCH, &format!("/v1/patients/{patient}"))
            .key(&scene.key)
            .json(&json!({"birth_year": 1950})),
        app.get(&format!("/v1/patients/{patient}/shares")).key(&scene.key),
        app.get(&format!("/v1/jobs/{job}")).key(&scene.key),
        app.post(&format!("/v1/sessions/{session}/recordings"))
            .key(&scene.key)
            .body("application/json", samples::json_recording()),
    ];
    for call in refused {
        call.send().await.refused(404, "not_found");
    }
    let training = json!({"name": "theirs", "static_recordings": [recording, session]});
    let problem = post("/v1/noise-models".into(), training).send().await.refused(422, "invalid_body");
    assert_eq!(problem["errors"][0]["path"], "static_recordings[0]", "{problem:#}");
}

#[tokio::test]
async fn a_patient_is_shared_with_clinicians_of_others_and_not_for_ever() {
    let scene = Scene::set().await;
    let path = format!("/v1/patients/{}/shares", scene.patient);
    let share = |receiver: &str, expires_at: &str| {
        scene.app.post(&path).json(&json!({"receiver_id": receiver, "expires_at": expires_at}))
    };
    let tomorrow = "2026-11-29T08:00:00Z";
    let receiver = scene.receiver.id.to_string();
    for bad in ["2026-11-28T08:00:00Z", "2028-01-01T00:00:00Z"] {
        let problem = share(&receiver, bad).send().await.refused(422, "invalid_body");
        assert_eq!(problem["errors"][0]["path"], "expires_at");
    }
    let me = scene.app.get("/v1/me").send().await.expect(StatusCode::OK);
    share(text(&me["id"]), tomorrow).send().await.refused(409, "own_clinician");
    let device = scene.app.key_in(scene.receiver.organisation_id, Role::Device).await.0;
    share(&device.id.to_string(), tomorrow).send().await.refused(404, "not_found");
    share(&scene.patient, tomorrow).send().await.refused(404, "not_found");
    let device = scene.app.key(Role::Device).await;
    share(&receiver, tomorrow).key(&device).send().await.refused(403, "forbidden");
}
