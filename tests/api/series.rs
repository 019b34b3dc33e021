use crate::support::samples::KNOWN_SAMPLES;
use crate::support::{TestApp, samples};
use axum::http::StatusCode;
use serde_json::{Value, json};

async fn assessed() -> (TestApp, String) {
    let app = TestApp::with_assess(samples::known_result()).await;
    let path = format!("/v1/assessments/{}/series", app.assessed().await);
    (app, path)
}

#[tokio::test]
async fn all_channels_come_with_interval_and_flags_and_null_for_no_number() {
    let (app, path) = assessed().await;
    let series = app.get(&path).send().await.expect(StatusCode::OK);
    assert_eq!(series["n_in_range"], KNOWN_SAMPLES);
    assert_eq!(series["time_s"].as_array().unwrap().len(), KNOWN_SAMPLES);
    let [knee, trunk] = series["channels"].as_array().unwrap().as_slice() else { panic!("two channels") };
    assert_eq!(knee["channel"], "right_knee_flexion_deg");
    for part in ["value", "low", "high", "flags"] {
        assert_eq!(knee[part].as_array().unwrap().len(), KNOWN_SAMPLES, "{part}");
    }
    assert_eq!(
        (&knee["value"][1234], &knee["low"][1234], &knee["high"][1234]),
        (&json!(12.34), &json!(10.84), &json!(13.84))
    );
    assert_eq!((&trunk["value"][10], &trunk["flags"][10]), (&Value::Null, &json!(2)));
    assert_eq!((&trunk["value"][11], &trunk["low"][11]), (&json!(3), &Value::Null));
    assert_eq!(series["flag_names"][1], "not_observable");
}

#[tokio::test]
async fn channels_are_chosen_by_name_or_joint_and_times_by_range() {
    let (app, path) = assessed().await;
    let by_name = app.get(&format!("{path}?channels=trunk_flexion_deg&from_s=1&to_s=1.05&interval=false&flags=false"));
    insta::assert_json_snapshot!(by_name.send().await.expect(StatusCode::OK), {
        ".assessment_id" => "[id]", ".recording_sha256" => "[digest]",
    });
    let by_joint = app.get(&format!("{path}?joint=right_knee")).send().await.expect(StatusCode::OK);
    let names: Vec<&Value> = by_joint["channels"].as_array().unwrap().iter().map(|c| &c["channel"]).collect();
    assert_eq!(names, ["right_knee_flexion_deg"]);
    let never = app.get(&format!("{path}?from_s=1e300")).send().await.expect(StatusCode::OK);
    assert_eq!(never["time_s"], json!([]));
}

#[tokio::test]
async fn decimation_keeps_the_number_of_points_and_the_extremes() {
    let (app, path) = assessed().await;
    let series = app.get(&format!("{path}?joint=right_knee&max_points=100")).send().await.expect(StatusCode::OK);
    let values: Vec<f64> =
        series["channels"][0]["value"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!((2..=100).contains(&values.len()), "{}", values.len());
    assert_eq!((values[0], values[values.len() - 1]), (0.0, 49.99));
    assert_eq!(series["n_in_range"], KNOWN_SAMPLES);
}

#[tokio::test]
async fn csv_holds_the_same_numbers() {
    let (app, path) = assessed().await;
    let expected = "time_s,trunk_flexion_deg,trunk_flexion_deg_low,trunk_flexion_deg_high,trunk_flexion_deg_flags\r\n\
                    1,,,,2\r\n1.01,3,,,0\r\n";
    let query = "channels=trunk_flexion_deg&from_s=1&to_s=1.01";
    let by_format = app.get(&format!("{path}?{query}&format=csv")).send().await;
    assert_eq!(String::from_utf8_lossy(&by_format.body), expected);
    let by_accept = app.get(&format!("{path}?{query}")).header("accept", "text/csv").send().await;
    assert_eq!((by_accept.header("content-type"), &by_accept.body), ("text/csv; charset=utf-8", &by_format.body));
    let neither = app.get(&path).header("accept", "application/xml").send().await;
    neither.refused(406, "not_acceptable");
}

#[tokio::test]
async fn the_tag_of_a_series_differs_by_question_and_form() {
    let (app, path) = assessed().await;
    let json = app.get(&format!("{path}?max_points=10")).send().await;
    let csv = app.get(&format!("{path}?max_points=10&format=csv")).send().await;
    let more = app.get(&format!("{path}?max_points=20")).send().await;
    let tags = [&json, &csv, &more].map(|answer| answer.header("etag").to_owned());
    assert!(tags[0] != tags[1] && tags[0] != tags[2] && tags[1] != tags[2], "{tags:?}");
    let again = app.get(&format!("{path}?max_points=10")).header("if-none-match", &tags[0]).send().await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn a_question_that_cannot_be_answered_is_refused_with_what_there_is() {
    let (app, path) = assessed().await;
    let problem = app.get(&format!("{path}?channels=left_tail_deg")).send().await.refused(400, "invalid_request");
    assert!(problem["errors"][0]["message"].as_str().unwrap().contains("trunk_flexion_deg"), "{problem:#}");
    for query in ["joint=tail", "max_points=1", "from_s=NaN", "to_s=inf", "format=xml", "channel=x"] {
        app.get(&format!("{path}?{query}")).send().await.refused(400, "invalid_request");
    }
}
