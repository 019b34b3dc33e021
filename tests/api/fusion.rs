//! Recordings with inertial units, from the upload to the series.

use crate::support::{TestApp, text};
use axum::http::StatusCode;
use serde_json::{Value, json};
use std::sync::LazyLock;
use surefoot::body::{Bone, Limb, Side};
use surefoot::recording::{Recording, encode};
use surefoot::synthetic::inertial::protocol::Protocol;
use surefoot::synthetic::{FusionSimulation, Movement, simulate_fusion};

/// Seconds of kicks with units on both segments of the right leg.
static KICK: LazyLock<Recording> = LazyLock::new(|| {
    let leg = Limb::RightLeg;
    let settings = FusionSimulation {
        movement_s: 6.0,
        unit_rate_hz: 64.0,
        units: vec![Bone::Trunk, Bone::Proximal(leg), Bone::Distal(leg)],
        protocol: Protocol { plank: false, jumps: 3 },
        ..FusionSimulation::new(Movement::Kick(Side::Right), 3)
    };
    simulate_fusion(&settings).unwrap().recording
});

/// Uploads a recording into a new session.
async fn uploaded(app: &TestApp, recording: &Recording) -> Value {
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let body = encode::mcap(recording).unwrap();
    app.post(&path).body("application/mcap", body).send().await.expect(StatusCode::ACCEPTED)
}

/// The job after everything that was due has run.
async fn finished(app: &TestApp, job: &Value) -> Value {
    app.run_pending_jobs().await;
    app.get(&format!("/v1/jobs/{}", text(&job["id"]))).send().await.expect(StatusCode::OK)
}

fn names(series: &Value) -> Vec<&str> {
    series["channels"].as_array().unwrap().iter().map(|channel| text(&channel["channel"])).collect()
}

#[tokio::test]
async fn a_recording_with_units_is_fused_and_its_angles_and_places_are_read_like_any_series() {
    let app = TestApp::new().await;
    let upload = uploaded(&app, &KICK).await;
    let settings = json!({"pipeline": "skeleton_fusion", "method": "fused", "orientation": null, "gain": null,
                          "rate_hz": null, "clocks": "estimated", "mounting": "auto"});
    let mut chosen = upload["job"]["settings"].clone();
    assert!(chosen.as_object_mut().unwrap().remove("min_confidence").is_some());
    assert_eq!(chosen, settings);
    let job = finished(&app, &upload["job"]).await;
    assert_eq!(job["state"], "done", "{job:#}");

    let path = format!("/v1/assessments/{}", text(&job["assessment_id"]));
    let assessment = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!((&assessment["pipeline"], &assessment["method"]), (&json!("skeleton_fusion"), &json!("fused")));
    assert_eq!(assessment["channels"].as_array().unwrap().len(), 34 + 39);
    let fusion = &assessment["quality"]["fusion"];
    let segments: Vec<&str> = fusion["units"].as_array().unwrap().iter().map(|unit| text(&unit["segment"])).collect();
    assert_eq!(segments, ["chest", "right_thigh", "right_shank"]);
    assert!((fusion["rate_hz"].as_f64().unwrap() - 64.0).abs() < 1.0, "{fusion:#}");
    assert_eq!(assessment["provenance"]["settings"]["pipeline"], "skeleton_fusion");

    let series = format!("{path}/series");
    let knee = app.get(&format!("{series}?joint=right_knee&max_points=50")).send().await.expect(StatusCode::OK);
    assert_eq!(names(&knee), ["right_knee_flexion_deg", "right_knee_x_m", "right_knee_y_m", "right_knee_z_m"]);
    assert!(knee["time_s"].as_array().unwrap().len() <= 50);
    assert_eq!(knee["n_in_range"], assessment["n_samples"]);
    let one = app.get(&format!("{series}?channels=right_knee_y_m&from_s=1&to_s=2&format=csv")).send().await;
    let csv = String::from_utf8(one.body.to_vec()).unwrap();
    assert!(csv.starts_with("time_s,right_knee_y_m,right_knee_y_m_low,right_knee_y_m_high,right_knee_y_m_flags"));
    assert!((60..70).contains(&csv.lines().count()), "{}", csv.lines().count());

    for (filter, n) in [("pipeline=skeleton_fusion", 1), ("method=fused", 1), ("pipeline=joint_angles", 0)] {
        let list = app.get(&format!("/v1/assessments?{filter}")).send().await.expect(StatusCode::OK);
        assert_eq!(list["items"].as_array().unwrap().len(), n, "{filter}");
    }
}

#[tokio::test]
async fn a_recording_with_units_is_assessed_again_by_other_methods_and_pipelines() {
    let app = TestApp::new().await;
    let upload = uploaded(&app, &KICK).await;
    let path = format!("/v1/recordings/{}/jobs", text(&upload["recording"]["id"]));
    for (settings, method, n) in [
        (json!({"pipeline": "skeleton_fusion", "method": "hierarchy", "gain": 0.05, "rate_hz": 32.0}), "hierarchy", 73),
        (json!({"pipeline": "skeleton_fusion", "method": "inertial"}), "inertial", 34),
        (json!({"pipeline": "joint_angles", "method": "ik"}), "ik", 34),
    ] {
        let queued = app.post(&path).json(&settings).send().await.expect(StatusCode::ACCEPTED);
        let job = finished(&app, &queued).await;
        assert_eq!(job["state"], "done", "{job:#}");
        let assessment = app.get(&format!("/v1/assessments/{}", text(&job["assessment_id"]))).send().await;
        let assessment = assessment.expect(StatusCode::OK);
        assert_eq!((&assessment["method"], assessment["channels"].as_array().unwrap().len()), (&json!(method), n));
    }
}

#[tokio::test]
async fn settings_of_the_fusion_are_refused_by_field() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    for (field, value) in [
        ("gain", json!(-0.1)),
        ("gain", json!(11)),
        ("gain", json!(0.033)),
        ("rate_hz", json!(0.5)),
        ("rate_hz", json!(1001)),
        ("min_confidence", json!(1.5)),
    ] {
        let mut settings = json!({"pipeline": "skeleton_fusion"});
        settings[field] = value.clone();
        let problem = app.post(&path).json(&settings).send().await.refused(422, "invalid_body");
        assert_eq!(problem["errors"][0]["path"], field, "{value}: {problem:#}");
    }
    for (field, value) in [
        ("method", json!("iekf")),
        ("orientation", json!("compass")),
        ("clocks", json!("atomic")),
        ("mounting", json!("tape")),
        ("particles", json!(128)),
        ("rate_hz", json!("fast")),
    ] {
        let mut settings = json!({"pipeline": "skeleton_fusion"});
        settings[field] = value.clone();
        app.post(&path).json(&settings).send().await.refused(422, "invalid_body");
    }
    let camera = json!({"pipeline": "skeleton_fusion", "method": "camera", "rate_hz": 50});
    let problem = app.post(&path).json(&camera).send().await.refused(422, "invalid_body");
    assert_eq!(problem["errors"][0]["path"], "rate_hz");
}

#[tokio::test]
async fn a_fusion_of_a_recording_without_units_fails_in_a_sentence() {
    let app = TestApp::new().await;
    let uploaded = app.uploaded().await;
    let path = format!("/v1/recordings/{}/jobs", text(&uploaded["recording"]["id"]));
    let queued = app.post(&path).json(&json!({"pipeline": "skeleton_fusion"})).send().await;
    let job = finished(&app, &queued.expect(StatusCode::ACCEPTED)).await;
    assert_eq!((&job["state"], &job["error"]["code"]), (&json!("failed"), &json!("no_inertial_units")), "{job:#}");
    assert!(text(&job["error"]["sentence"]).contains("joint_angles"), "{job:#}");
}

/// Ten seconds in which a unit is turned about its x axis, at rest before and after.
fn unit(segment: &str, declared_hz: f64) -> Value {
    let angle = |i: i64| 0.5 * (1.0 - (0.02 * std::f64::consts::PI * (i - 200).clamp(0, 600) as f64).cos());
    let times = 0..1001i64;
    json!({
        "segment": segment, "nominal_rate_hz": declared_hz,
        "time_ns": times.clone().map(|i| i * 10_000_000).collect::<Vec<_>>(),
        "acceleration": times.clone().map(|i| json!([0.01 * (i % 3) as f64, 9.8 * angle(i).cos(), -9.8 * angle(i).sin()])).collect::<Vec<_>>(),
        "angular_rate": times.map(|i| json!([(angle(i + 1) - angle(i - 1)) * 50.0 + 1e-4 * (i % 2) as f64, 0, 0])).collect::<Vec<_>>(),
    })
}

fn document(units: &[Value]) -> String {
    let document = json!({
        "format": "surefoot", "version": 1,
        "coordinates": {"handedness": "right", "up": "+y", "length_unit": "m"},
        "inertial": units,
    });
    document.to_string()
}

#[tokio::test]
async fn inertial_units_alone_are_taken_and_described_and_give_the_angle_between_them() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let body = document(&[unit("left_thigh", 50.0), unit("left_shank", 100.0)]);
    let upload = app.post(&path).body("application/json", body).send().await.expect(StatusCode::ACCEPTED);
    let inspection = &upload["recording"]["inspection"];
    assert_eq!((&inspection["n_frames"], &inspection["duration_s"]), (&json!(0), &json!(10.0)));
    let unit = &inspection["inertial_units"][0];
    assert_eq!(
        (&unit["segment"], &unit["n_samples"], &unit["rate_hz"]),
        (&json!("left_thigh"), &json!(1001), &json!(100.0))
    );
    assert_eq!(unit["warnings"][0]["kind"], "rate_differs", "{unit:#}");

    let job = finished(&app, &upload["job"]).await;
    assert_eq!(job["state"], "done", "{job:#}");
    let assessment = app.get(&format!("/v1/assessments/{}", text(&job["assessment_id"]))).send().await;
    let assessment = assessment.expect(StatusCode::OK);
    let codes: Vec<&str> =
        assessment["quality"]["warnings"].as_array().unwrap().iter().map(|w| text(&w["code"])).collect();
    assert!(codes.contains(&"no_camera") && codes.contains(&"unit_rate_differs"), "{codes:?}");
    let coverage = |channel: &str| {
        let lines = assessment["summary"].as_array().unwrap();
        lines.iter().find(|line| line["channel"] == channel).unwrap()["coverage"].as_f64().unwrap()
    };
    assert_eq!((coverage("left_knee_flexion_deg"), coverage("right_knee_flexion_deg")), (1.0, 0.0));
}

#[tokio::test]
async fn a_unit_that_no_other_is_beside_is_refused_in_a_sentence() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let body = document(&[unit("left_thigh", 100.0)]);
    let upload = app.post(&path).body("application/json", body).send().await.expect(StatusCode::ACCEPTED);
    let job = finished(&app, &upload["job"]).await;
    assert_eq!((&job["state"], &job["error"]["code"]), (&json!("failed"), &json!("no_joint_between_units")), "{job:#}");
    assert!(text(&job["error"]["sentence"]).contains("both segments"), "{job:#}");
}

#[tokio::test]
async fn units_in_g_or_in_degrees_are_refused_while_they_arrive() {
    let app = TestApp::new().await;
    let path = format!("/v1/sessions/{}/recordings", app.session().await);
    let scaled = |field: &str, factor: f64| {
        let mut unit = unit("left_thigh", 100.0);
        for axis in unit[field].as_array_mut().unwrap().iter_mut().flat_map(|v| v.as_array_mut().unwrap()) {
            *axis = json!(axis.as_f64().unwrap() * factor);
        }
        document(&[unit])
    };
    for (field, factor, code) in
        [("acceleration", 1.0 / 9.8, "acceleration_unit"), ("angular_rate", 57.3, "angular_rate_unit")]
    {
        app.post(&path).body("application/json", scaled(field, factor)).send().await.refused(422, code);
    }
    let twice = document(&[unit("left_thigh", 100.0), unit("left_thigh", 100.0)]);
    app.post(&path).body("application/json", twice).send().await.refused(422, "duplicate_channel");
}
