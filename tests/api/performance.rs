//! What recordings of exercises come to: repetitions, measures, exports, and their place in the report.

use crate::support::fhir::validate;
use crate::support::{TestApp, text};
use axum::http::StatusCode;
use serde_json::{Value, json};
use std::io::Cursor;
use surefoot::recording::encode;
use surefoot::synthetic::walker::trousers::trousers;
use surefoot::synthetic::walker::{Course, WalkerSettings, WalkerSimulation};
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

struct Exercised {
    patient: String,
    assessment: Value,
}

/// A recording of an exercise whose session (and not its header) declares a protocol.
async fn exercised(app: &TestApp, exercise: Exercise, declared: &str) -> Exercised {
    let patient = app.patient("P-1").await;
    let session = json!({"patient_id": patient, "protocol": declared, "started_at": "2026-03-02T09:00:00Z"});
    let session = app.post("/v1/sessions").json(&session).send().await.expect(StatusCode::CREATED);
    let mut truth = simulate(&SimulationSettings::new(exercise, Preset::Table1, 3)).unwrap().recording;
    // A name that only the recording's maker knows does not hide the session's.
    truth.header.protocol = Some("maker's own name".into());
    let upload = app.post(&format!("/v1/sessions/{}/recordings", text(&session["id"])));
    let uploaded = upload.body("application/mcap", encode::mcap(&truth).unwrap()).send().await;
    let uploaded = uploaded.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).send().await.expect(StatusCode::OK);
    let assessment = app.get(&format!("/v1/assessments/{}", text(&job["assessment_id"]))).send().await;
    Exercised { patient, assessment: assessment.expect(StatusCode::OK) }
}

#[tokio::test]
async fn repetitions_of_a_recording_are_counted_measured_and_reported() {
    let app = TestApp::new().await;
    let Exercised { patient, assessment } = exercised(&app, Exercise::BackKnee, "back_knee").await;
    let performance = &assessment["performance"];
    assert_eq!((&performance["status"], &performance["protocol"]), (&json!("measured"), &json!("back_knee")));
    let repetitions = performance["repetitions"].as_array().unwrap();
    assert!(repetitions.len() >= 4, "{performance:#}");
    assert!(repetitions.iter().any(|r| r["side"] == "left") && repetitions.iter().any(|r| r["side"] == "right"));
    for repetition in repetitions {
        let time = |name: &str| repetition[name].as_f64().unwrap();
        assert!(time("start_s") < time("peak_s") && time("peak_s") < time("end_s"), "{repetition:#}");
    }

    // What has a value is a measure of the patient, dated by the session.
    let measures = app.get(&format!("/v1/patients/{patient}/measures?limit=200")).send().await.expect(StatusCode::OK);
    let with_value = performance["measures"].as_array().unwrap().iter().filter(|m| !m["value"].is_null()).count();
    let items = measures["items"].as_array().unwrap();
    assert_eq!(items.len(), with_value);
    assert!(items.iter().all(|m| m["measured_at"] == "2026-03-02T09:00:00Z" && m["protocol"] == "back_knee"));
    assert!(items.iter().all(|m| m["source"]["assessment_id"] == assessment["id"]));

    let plan = json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee", "repetitions": 2}]});
    let plans = format!("/v1/patients/{patient}/training-plans");
    app.post(&plans).json(&plan).send().await.expect(StatusCode::CREATED);
    let report = app.get(&format!("/v1/patients/{patient}/report")).send().await.expect(StatusCode::OK);
    let recording = &report["recent_sessions"][0]["recordings"][0];
    assert_eq!((&recording["job_state"], &recording["performance"]), (&json!("done"), &json!("measured")));
    assert_eq!(recording["n_repetitions"], repetitions.len());
    let needed = report["needed"].as_array().unwrap();
    let sts5 = needed.iter().find(|needed| needed["rule_id"] == "sts5").unwrap();
    assert!(sts5["record_protocols"].as_array().unwrap().contains(&json!("five_times_sit_to_stand")), "{sts5:#}");

    let bundle = app.get(&format!("/v1/patients/{patient}/fhir-bundle")).send().await.expect(StatusCode::OK);
    let provenances = bundle["entry"].as_array().unwrap().iter().map(|entry| &entry["resource"]);
    let provenances: Vec<&Value> = provenances.filter(|r| r["resourceType"] == "Provenance").collect();
    assert_eq!(provenances.len(), 1);
    assert_eq!(provenances[0]["target"].as_array().unwrap().len(), with_value);
    validate(&bundle);
}

#[tokio::test]
async fn another_movement_than_the_declared_one_gives_no_numbers_and_says_what_it_looks_like() {
    let app = TestApp::new().await;
    let Exercised { patient, assessment } = exercised(&app, Exercise::BackKnee, "five_times_sit_to_stand").await;
    let performance = &assessment["performance"];
    assert_eq!(performance["status"], "other_movement", "{performance:#}");
    assert!(!text(&performance["reason"]).is_empty());
    let measures = app.get(&format!("/v1/patients/{patient}/measures")).send().await.expect(StatusCode::OK);
    assert_eq!(measures["items"], json!([]));
}

#[tokio::test]
async fn a_protocol_that_the_catalogue_does_not_have_is_named_with_what_the_movement_looks_like() {
    let app = TestApp::new().await;
    let Exercised { assessment, .. } = exercised(&app, Exercise::SideHip, "morning routine").await;
    let performance = &assessment["performance"];
    assert_eq!(
        (&performance["status"], &performance["protocol"]),
        (&json!("not_measured"), &json!("maker's own name"))
    );
    assert!(performance["recognized"].as_array().unwrap().contains(&json!("side_hip")), "{performance:#}");
    let catalogue = app.get("/v1/protocols").send().await.expect(StatusCode::OK);
    let ids: Vec<&str> = catalogue["items"].as_array().unwrap().iter().map(|item| text(&item["id"])).collect();
    for id in ["back_knee", "sit_front_knee", "side_hip", "step", "near_tandem", "five_times_sit_to_stand", "walk"] {
        assert!(ids.contains(&id), "{id} is not in {ids:?}");
    }
    let one = app.get("/v1/protocols/side_hip").send().await.expect(StatusCode::OK);
    assert_eq!(one["id"], "side_hip");
    app.get("/v1/protocols/morning").send().await.refused(404, "not_found");
}

#[tokio::test]
async fn an_assessment_is_exported_in_every_form_and_its_joints_can_be_replayed() {
    let app = TestApp::new().await;
    let Exercised { assessment, .. } = exercised(&app, Exercise::Step, "step").await;
    let id = text(&assessment["id"]);
    let n = assessment["n_samples"].as_u64().unwrap() as usize;
    let joints = app.get(&format!("/v1/assessments/{id}/joints")).send().await.expect(StatusCode::OK);
    let (frames, names) = (joints["time_s"].as_array().unwrap().len(), joints["joints"].as_array().unwrap().len());
    assert_eq!((frames, joints["positions_m"].as_array().unwrap().len()), (n, 3 * n * names));
    let few = app.get(&format!("/v1/assessments/{id}/joints?max_frames=50")).send().await.expect(StatusCode::OK);
    assert!(few["time_s"].as_array().unwrap().len() <= 50);
    for (form, start) in
        [("csv", "time_s,"), ("mot", "surefoot joint angles"), ("trc", "PathFileType"), ("bvh", "HIERARCHY")]
    {
        let answer = app.get(&format!("/v1/assessments/{id}/export?form={form}")).send().await;
        assert_eq!(answer.status, StatusCode::OK);
        assert!(answer.header("content-disposition").ends_with(&format!("{id}.{form}\"")));
        let content = String::from_utf8(answer.body.to_vec()).unwrap();
        assert!(content.starts_with(start) && content.lines().count() > n, "{form}");
    }
    let bundle = app.get(&format!("/v1/assessments/{id}/fhir-bundle")).send().await.expect(StatusCode::OK);
    let entries = bundle["entry"].as_array().unwrap();
    assert_eq!(entries.len(), assessment["channels"].as_array().unwrap().len());
    let data = text(&entries[0]["resource"]["valueSampledData"]["data"]);
    assert_eq!(data.split(' ').count(), n);
    validate(&bundle);
    app.get(&format!("/v1/assessments/{id}/export?form=c3d")).send().await.refused(400, "invalid_request");
    let elsewhere = app.stranger().await;
    app.get(&format!("/v1/assessments/{id}/joints")).key(&elsewhere).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_protocol_says_which_rules_look_at_its_measures() {
    let app = TestApp::new().await;
    let rules_of = async |id: &str| {
        let found = app.get(&format!("/v1/protocols/{id}")).send().await.expect(StatusCode::OK);
        found["fall_risk_rules"].as_array().unwrap().iter().map(|rule| text(rule).to_owned()).collect::<Vec<_>>()
    };
    assert!(rules_of("five_times_sit_to_stand").await.contains(&"sts5".to_owned()));
    assert!(rules_of("walk").await.contains(&"speed_slow_ss".to_owned()));
    assert_eq!(rules_of("back_knee").await, Vec::<String>::new());
}

/// Seconds of a brisk walk behind a walker, as depth images.
fn walk_with_walker() -> Vec<u8> {
    let settings = WalkerSettings::of_seed(Course::Straight, 2).with_speed(0.8);
    let settings = WalkerSettings { duration_s: 6.0, rate_hz: 20.0, ..settings };
    let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
    simulation.write(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner()
}

#[tokio::test]
async fn a_walk_behind_a_walker_is_measured_by_its_footfalls_and_makes_its_person_a_user_of_an_aid() {
    let app = TestApp::new().await;
    let new = json!({"pseudonym": "P-9", "birth_year": 1948, "uses_walking_aid": false});
    let patient = text(&app.post("/v1/patients").json(&new).send().await.expect(StatusCode::CREATED)["id"]).to_owned();
    app.consent(&patient, &app.admin).await;
    let session =
        app.post("/v1/sessions").json(&json!({"patient_id": patient})).send().await.expect(StatusCode::CREATED);
    let upload = app.post(&format!("/v1/sessions/{}/recordings", text(&session["id"])));
    let uploaded = upload.body("application/mcap", walk_with_walker()).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&uploaded["job"]["id"]))).send().await.expect(StatusCode::OK);
    let path = format!("/v1/assessments/{}", text(&job["assessment_id"]));
    let assessment = app.get(&path).send().await.expect(StatusCode::OK);
    let performance = &assessment["performance"];
    assert_eq!((&performance["protocol"], &performance["status"]), (&json!("walk_with_walker"), &json!("measured")));
    let footfalls = &performance["footfalls"];
    assert!(footfalls["contacts"].as_array().unwrap().len() >= 6, "{footfalls:#}");
    assert_eq!(footfalls["exclusions"][0]["reason"], "first_or_last");
    let joints = app.get(&format!("{path}/joints")).send().await.expect(StatusCode::OK);
    assert_eq!(joints["joints"].as_array().unwrap().len(), 6);

    let risk = app.get(&format!("/v1/patients/{patient}/fall-risk")).send().await.expect(StatusCode::OK);
    let used = risk["inputs"]["measures"].as_array().unwrap();
    assert!(used.iter().any(|measure| measure["name"] == "usual_speed_mps"), "{used:#?}");
    for finding in risk["findings"].as_array().unwrap() {
        assert_eq!((&finding["population_match"], &finding["probability"]), (&json!(false), &Value::Null));
    }
}
