//! Depth recordings of a walker's user, from the upload to steps and series.

use crate::support::{TestApp, text};
use axum::http::StatusCode;
use serde_json::{Value, json};
use std::io::Cursor;
use std::sync::LazyLock;
use surefoot::synthetic::walker::trousers::trousers;
use surefoot::synthetic::walker::{Course, WalkerSettings, WalkerSimulation};

/// Frames of [`WALK`].
const N_FRAMES: u64 = 70;

/// Seconds of a brisk walk.
static WALK: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let settings = WalkerSettings::of_seed(Course::Straight, 2).with_speed(0.8);
    let settings = WalkerSettings { duration_s: 3.5, rate_hz: 20.0, ..settings };
    let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
    simulation.write(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner()
});

/// Uploads a recording and answers its job after everything that was due has run.
async fn assessed(app: &TestApp, body: Vec<u8>) -> (Value, Value) {
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let upload = app.post(&path).body("application/mcap", body).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    let job = app.get(&format!("/v1/jobs/{}", text(&upload["job"]["id"]))).send().await.expect(StatusCode::OK);
    (upload, job)
}

#[tokio::test]
async fn depth_images_of_a_walk_give_steps_and_the_places_of_the_joints() {
    let app = TestApp::new().await;
    let (upload, job) = assessed(&app, WALK.clone()).await;
    assert_eq!(upload["job"]["settings"]["pipeline"], "leg_pose", "{upload:#}");
    assert_eq!(job["state"], "done", "{job:#}");

    let path = format!("/v1/assessments/{}", text(&job["assessment_id"]));
    let assessment = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!((&assessment["pipeline"], &assessment["method"]), (&json!("leg_pose"), &json!("fitted")));
    assert_eq!(assessment["n_samples"], N_FRAMES);
    assert_eq!(assessment["channels"].as_array().unwrap().len(), 22);
    let codes: Vec<&str> =
        assessment["quality"]["warnings"].as_array().unwrap().iter().map(|w| text(&w["code"])).collect();
    assert!(codes.contains(&"in_evaluation"), "{codes:?}");

    let gait = &assessment["gait"];
    let steps = gait["steps"].as_array().unwrap();
    // Two and a half seconds of walking hold three or four steps, all of them at the ends of the walk.
    assert!((2..=5).contains(&steps.len()), "{gait:#}");
    for step in steps {
        assert!(step["toe_off_s"].as_f64() < step["heel_strike_s"].as_f64(), "{step:#}");
        assert!(["left", "right"].contains(&text(&step["side"])), "{step:#}");
    }
    let n_left_out = steps.iter().filter(|step| step["excluded_because"] != json!([])).count() as u64;
    assert_eq!(gait["n_steps_used"].as_u64().unwrap() + n_left_out, steps.len() as u64);

    let series = format!("{path}/series?channels=left_ankle_z_m,step_length_floor_m");
    let series = app.get(&series).send().await.expect(StatusCode::OK);
    let channels = series["channels"].as_array().unwrap();
    assert_eq!(channels.len(), 2);
    let depths = channels[0]["value"].as_array().unwrap();
    assert!(depths.iter().filter_map(Value::as_f64).all(|z| (0.3..2.5).contains(&z)), "{depths:?}");
    assert!(depths.iter().filter(|z| z.is_number()).count() as u64 * 10 > N_FRAMES * 9, "{depths:?}");
}

/// The first images of a walk.
static START: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let settings = WalkerSettings::of_seed(Course::Straight, 2).with_speed(0.8);
    let settings = WalkerSettings { duration_s: 1.0, rate_hz: 8.0, ..settings };
    let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
    simulation.write(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner()
});

/// Asks for another assessment of a recording and answers the job after it has run.
async fn assessed_again(app: &TestApp, upload: &Value, settings: Value) -> Value {
    let path = format!("/v1/recordings/{}/jobs", text(&upload["recording"]["id"]));
    let job = app.post(&path).json(&settings).send().await.expect(StatusCode::ACCEPTED);
    app.run_pending_jobs().await;
    app.get(&format!("/v1/jobs/{}", text(&job["id"]))).send().await.expect(StatusCode::OK)
}

#[tokio::test]
async fn the_papers_particle_filter_gives_the_same_channels_when_it_is_asked_for_and_says_how_it_was_set() {
    let app = TestApp::new().await;
    let (upload, _) = assessed(&app, START.clone()).await;
    let settings = json!({"pipeline": "leg_pose", "mode": "paper", "cues": "both", "particles": 256, "seed": 7});
    let job = assessed_again(&app, &upload, settings).await;
    assert_eq!(job["state"], "done", "{job:#}");
    let path = format!("/v1/assessments/{}", text(&job["assessment_id"]));
    let assessment = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!((&assessment["pipeline"], &assessment["method"]), (&json!("leg_pose"), &json!("paper")));
    assert_eq!(assessment["n_samples"], 8);
    assert_eq!(assessment["channels"].as_array().unwrap().len(), 22);
    assert_eq!(assessment["quality"]["effective_sample_size"]["particles"], 256);
    let set = &assessment["provenance"]["settings"];
    assert_eq!((&set["mode"], &set["cues"], &set["seed"]), (&json!("paper"), &json!("both"), &json!(7)), "{set:#}");
    assert!(assessment["gait"]["steps"].is_array());

    let series = format!("{path}/series?channels=left_ankle_z_m");
    let series = app.get(&series).send().await.expect(StatusCode::OK);
    let depths = series["channels"][0]["value"].as_array().unwrap();
    assert!(depths.iter().all(|z| z.as_f64().is_some_and(|z| (0.5..2.0).contains(&z))), "{depths:?}");
}

#[tokio::test]
async fn the_colour_cue_of_a_recording_without_colour_is_refused_with_what_to_ask_instead() {
    let app = TestApp::new().await;
    let (upload, _) = assessed(&app, START.clone()).await;
    let job = assessed_again(&app, &upload, json!({"pipeline": "leg_pose", "mode": "paper", "cues": "rgb"})).await;
    assert_eq!((&job["state"], &job["error"]["code"]), (&json!("failed"), &json!("no_side_images")), "{job:#}");
}

#[tokio::test]
async fn the_colour_cue_follows_a_recording_with_cameras_at_the_sides() {
    let settings = WalkerSettings::of_seed(Course::Straight, 2).with_speed(0.8);
    let settings = WalkerSettings { duration_s: 1.0, rate_hz: 4.0, ..settings };
    let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
    let bytes = simulation.write_with_sides(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner();
    let app = TestApp::new().await;
    let (upload, _) = assessed(&app, bytes).await;
    let sides = &upload["recording"]["inspection"]["depth"]["side_cameras"];
    assert_eq!(*sides, json!({"n_images": [4, 4], "n_paired": 4, "is_usable": true}), "{upload:#}");
    let settings = json!({"pipeline": "leg_pose", "mode": "paper", "cues": "rgb", "particles": 256});
    let job = assessed_again(&app, &upload, settings).await;
    assert_eq!(job["state"], "done", "{job:#}");
}

#[tokio::test]
async fn half_a_depth_recording_is_refused_and_makes_no_job() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let half = WALK[..WALK.len() / 2].to_vec();
    let answer = app.post(&path).body("application/mcap", half).send().await;
    assert!(answer.status.is_client_error(), "{}", answer.status);
}
