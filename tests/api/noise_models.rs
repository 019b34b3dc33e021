use crate::support::{TestApp, samples, text};
use axum::http::StatusCode;
use serde_json::{Value, json};
use surefoot::recording::encode;
use surefoot::storage::Role;
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

async fn upload(app: &TestApp, session: &str, body: Vec<u8>) -> Value {
    let call = app.post(&format!("/v1/sessions/{session}/recordings"));
    call.body("application/mcap", body).send().await.expect(StatusCode::ACCEPTED)
}

/// Ids of two static recordings of some seconds, assessed already.
async fn static_recordings(app: &TestApp, session: &str, seconds: usize) -> Vec<Value> {
    let mut ids = Vec::new();
    for seed in 1..=2 {
        ids.push(upload(app, session, samples::standing_still(seconds, seed)).await["recording"]["id"].clone());
    }
    app.run_pending_jobs().await;
    ids
}

/// Trains to the end; the job.
async fn train(app: &TestApp, name: &str, still: &[Value], movement: &[Value]) -> Value {
    let request = json!({"name": name, "static_recordings": still, "movement_recordings": movement});
    let answer = app.post("/v1/noise-models").json(&request).send().await;
    let job = answer.expect(StatusCode::ACCEPTED);
    assert_eq!(answer.header("location"), format!("/v1/jobs/{}", text(&job["id"])));
    assert_eq!((&job["settings"]["pipeline"], &job["recording_id"]), (&json!("noise_model"), &still[0]));
    app.run_pending_jobs().await;
    app.get(&format!("/v1/jobs/{}", text(&job["id"]))).send().await.expect(StatusCode::OK)
}

#[tokio::test]
async fn a_model_is_trained_from_stored_recordings_and_an_assessment_names_it() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let still = static_recordings(&app, &session, 11).await;
    let settings =
        SimulationSettings { duration_s: 12.0, ..SimulationSettings::new(Exercise::Step, Preset::Table1, 1) };
    let movement = encode::mcap(&simulate(&settings).unwrap().recording).unwrap();
    let movement = upload(&app, &session, movement).await["recording"]["id"].clone();

    let job = train(&app, "ward-3", &still, std::slice::from_ref(&movement)).await;
    assert_eq!((&job["state"], &job["assessment_id"]), (&json!("done"), &Value::Null), "{job:#}");
    let id = text(&job["noise_model_id"]);
    let model = app.get(&format!("/v1/noise-models/{id}")).send().await.expect(StatusCode::OK);
    assert_eq!((&model["name"], &model["version"], &model["job_id"]), (&json!("ward-3"), &json!(1), &job["id"]));
    assert!(model["model"]["training"]["white_s"].as_f64().unwrap() >= 18.0);
    assert_eq!(model["model"]["training"]["static_recordings"][1]["name"], still[1]);
    let hand = model["model"]["points"][2]["white_sd_mm"][0].as_f64().unwrap();
    assert!((hand / 151.5 - 1.0).abs() < 0.15, "{hand}");
    for name in ["ward-3", "ward-3@1"] {
        let named = app.get(&format!("/v1/noise-models/{name}")).send().await.expect(StatusCode::OK);
        assert_eq!(named, model);
    }

    let path = format!("/v1/recordings/{}/jobs", text(&movement));
    let wanted = json!({"pipeline": "joint_angles", "noise_model": "ward-3"});
    let job = app.post(&path).json(&wanted).send().await.expect(StatusCode::ACCEPTED);
    assert_eq!(job["settings"]["noise_model"], "ward-3@1");
    // A further version before the job runs changes nothing for it.
    let second = train(&app, "ward-3", &still, &[]).await;
    assert_eq!(second["state"], "done");
    let newest = app.get("/v1/noise-models/ward-3").send().await.expect(StatusCode::OK);
    assert_eq!((&newest["version"], &newest["id"]), (&json!(2), &second["noise_model_id"]));
    let job = app.get(&format!("/v1/jobs/{}", text(&job["id"]))).send().await.expect(StatusCode::OK);
    let path = format!("/v1/assessments/{}", text(&job["assessment_id"]));
    let assessment = app.get(&path).send().await.expect(StatusCode::OK);
    let expected = json!({"name": "ward-3", "version": 1, "sha256": model["sha256"]});
    assert_eq!(assessment["provenance"]["noise_model"], expected);
}

#[tokio::test]
async fn a_session_names_the_noise_model_of_its_sensor_for_its_uploads() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let new = |name: &str| json!({"patient_id": patient, "noise_model": name});
    let refused = app.post("/v1/sessions").json(&new("kinect-v9")).send().await.refused(422, "invalid_body");
    assert_eq!(refused["errors"][0]["path"], "noise_model");
    let session = app.post("/v1/sessions").json(&new("kinect-v2")).send().await.expect(StatusCode::CREATED);
    assert_eq!(session["noise_model"], "kinect-v2");
    let uploaded = upload(&app, text(&session["id"]), samples::mcap_recording()).await;
    assert_eq!(uploaded["job"]["settings"]["noise_model"], "kinect-v2@1");
}

#[tokio::test]
async fn recordings_that_teach_too_little_make_a_failed_job_that_says_what_to_record() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let still = static_recordings(&app, &session, 3).await;
    let job = train(&app, "ward-3", &still, &[]).await;
    assert_eq!((&job["state"], &job["error"]["code"]), (&json!("failed"), &json!("static_too_short")), "{job:#}");
    assert!(text(&job["error"]["sentence"]).contains("ten seconds, twice"));
    assert_eq!((&job["attempt"], &job["noise_model_id"]), (&json!(1), &Value::Null));
    app.get("/v1/noise-models/ward-3").send().await.refused(404, "not_found");
}

#[tokio::test]
async fn shipped_models_stand_at_the_end_of_the_list_and_are_read_by_name() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let still = static_recordings(&app, &session, 11).await;
    for _ in 0..2 {
        train(&app, "ward-3", &still, &[]).await;
    }
    let mut names = Vec::new();
    let mut next = Some("/v1/noise-models?limit=2".to_owned());
    while let Some(path) = next {
        let page = app.get(&path).send().await.expect(StatusCode::OK);
        let items = page["items"].as_array().unwrap();
        assert!((1..=2).contains(&items.len()));
        names.extend(items.iter().map(|item| format!("{}@{}", text(&item["name"]), item["version"])));
        next = page["next"].as_str().map(str::to_owned);
    }
    assert_eq!(names, ["ward-3@2", "ward-3@1", "kinect-v2@1", "kinect-v1@1", "nite-table1@1"]);
    let shipped = app.get("/v1/noise-models/kinect-v2").send().await.expect(StatusCode::OK);
    assert_eq!((&shipped["is_shipped"], &shipped["job_id"]), (&json!(true), &Value::Null));
    let by_id = app.get(&format!("/v1/noise-models/{}", text(&shipped["id"]))).send().await;
    assert_eq!(by_id.expect(StatusCode::OK), shipped);
    app.get("/v1/noise-models/kinect-v2@9").send().await.refused(404, "not_found");
    app.get("/v1/noise-models/No%20Name").send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_noise_model_that_does_not_exist_is_refused_with_the_names_that_do() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    let refusal = async |settings: Value| {
        let problem = app.post(&path).json(&settings).send().await.refused(422, "invalid_body");
        assert_eq!(problem["errors"][0]["path"], "noise_model", "{problem:#}");
        text(&problem["errors"][0]["message"]).to_owned()
    };
    let unknown = refusal(json!({"pipeline": "joint_angles", "noise_model": "kinect-v9"})).await;
    assert!(unknown.contains("adaptive, nite-table1, kinect-v1, kinect-v2"), "{unknown}");
    refusal(json!({"pipeline": "joint_angles", "noise_model": "Kinect V2"})).await;
    refusal(json!({"pipeline": "joint_angles", "noise_model": "kinect-v2@2"})).await;
    refusal(json!({"pipeline": "joint_angles", "method": "ik", "noise_model": "kinect-v2"})).await;
    refusal(json!({"pipeline": "joint_angles", "method": "particle", "noise_model": "adaptive"})).await;
    let training = json!({"pipeline": "noise_model", "name": "a", "static_recordings": []});
    let problem = app.post(&path).json(&training).send().await.refused(422, "invalid_body");
    assert!(text(&problem["detail"]).contains("POST /v1/noise-models"), "{problem:#}");
}

#[tokio::test]
async fn a_training_request_is_checked_before_it_is_queued() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let still = static_recordings(&app, &session, 2).await;
    let refusal = async |request: Value| {
        let problem = app.post("/v1/noise-models").json(&request).send().await.refused(422, "invalid_body");
        text(&problem["errors"][0]["path"]).to_owned()
    };
    assert_eq!(refusal(json!({"name": "kinect-v2", "static_recordings": still})).await, "name");
    assert_eq!(refusal(json!({"name": "adaptive", "static_recordings": still})).await, "name");
    assert_eq!(refusal(json!({"name": "Ward 3", "static_recordings": still})).await, "name");
    assert_eq!(refusal(json!({"name": "a", "static_recordings": [still[0]]})).await, "static_recordings");
    let twice = json!([still[0], still[0]]);
    assert_eq!(refusal(json!({"name": "a", "static_recordings": twice})).await, "static_recordings[1]");
    let absent = json!(["0192a000-0000-7000-8000-000000000000"]);
    let request = json!({"name": "a", "static_recordings": still, "movement_recordings": absent});
    assert_eq!(refusal(request).await, "movement_recordings[0]");
}

#[tokio::test]
async fn devices_train_and_see_no_models_and_another_organisation_sees_its_own_only() {
    let app = TestApp::new().await;
    let session = app.session().await;
    let still = static_recordings(&app, &session, 11).await;
    let job = train(&app, "ward-3", &still, &[]).await;
    let path = format!("/v1/noise-models/{}", text(&job["noise_model_id"]));
    let request = json!({"name": "mine", "static_recordings": still});

    let device = app.key(Role::Device).await;
    app.get("/v1/noise-models").key(&device).send().await.refused(403, "forbidden");
    app.get(&path).key(&device).send().await.refused(403, "forbidden");
    app.post("/v1/noise-models").key(&device).json(&request).send().await.refused(403, "forbidden");

    let elsewhere = app.stranger().await;
    app.get(&path).key(&elsewhere).send().await.refused(404, "not_found");
    app.get("/v1/noise-models/ward-3").key(&elsewhere).send().await.refused(404, "not_found");
    let problem = app.post("/v1/noise-models").key(&elsewhere).json(&request).send().await.refused(422, "invalid_body");
    assert_eq!(problem["errors"][0]["path"], "static_recordings[0]");
    let list = app.get("/v1/noise-models").key(&elsewhere).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"].as_array().unwrap().len(), 3);

    let clinician = app.key(Role::Clinician).await;
    app.post("/v1/noise-models").key(&clinician).json(&request).send().await.expect(StatusCode::ACCEPTED);
}
