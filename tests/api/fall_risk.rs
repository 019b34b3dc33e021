use crate::support::{TestApp, text};
use axum::http::StatusCode;
use serde_json::{Value, json};

async fn fall_risk(app: &TestApp, patient: &str) -> Value {
    app.get(&format!("/v1/patients/{patient}/fall-risk")).send().await.expect(StatusCode::OK)
}

fn finding<'a>(risk: &'a Value, rule: &str) -> &'a Value {
    let found = risk["findings"].as_array().unwrap().iter().find(|finding| finding["rule_id"] == rule);
    found.unwrap_or_else(|| panic!("no {rule} in {risk:#}"))
}

#[tokio::test]
async fn of_a_patient_of_whom_nothing_is_known_every_rule_says_what_it_needs() {
    let app = TestApp::new().await;
    let patient = app.patient("P-1").await;
    let risk = fall_risk(&app, &patient).await;
    let rules = app.get("/v1/fall-risk-rules").send().await.expect(StatusCode::OK);
    let findings = risk["findings"].as_array().unwrap();
    assert_eq!(findings.len(), rules["items"].as_array().unwrap().len());
    for finding in findings {
        assert!(["unknown", "not_assessable"].contains(&text(&finding["status"])), "{finding:#}");
        assert_eq!(finding["probability"], Value::Null);
    }
    assert_eq!(risk["inputs"], json!({"age_years": null, "questionnaire": null, "measures": []}));
}

#[tokio::test]
async fn answers_and_tests_become_findings_and_the_newest_count() {
    let app = TestApp::new().await;
    let born = 1950;
    let new = json!({"pseudonym": "P-2", "birth_year": born, "sex": "female", "uses_walking_aid": false});
    let patient = text(&app.post("/v1/patients").json(&new).send().await.expect(StatusCode::CREATED)["id"]).to_owned();
    let answer = |answers: Value| {
        let request = app.post(&format!("/v1/patients/{patient}/questionnaires")).json(&answers);
        async move { request.send().await.expect(StatusCode::CREATED) }
    };
    let measure = |body: Value| {
        let request = app.post(&format!("/v1/patients/{patient}/measurements")).json(&body);
        async move { request.send().await.expect(StatusCode::CREATED) }
    };
    answer(json!({"falls_12_months": 3})).await;
    let newest = answer(json!({"falls_12_months": 1, "medicines": 2, "takes_psychotropic": false,
        "reads_low_contrast_line_10": true, "feels_ankle_filament": true, "lives_in_community": true}));
    let newest = newest.await;
    let rises = |value: f64| json!({"five_times_sit_to_stand_s": {"value": value, "standard_error": 0.9}});
    let late = json!({"measured_at": "2026-03-01T10:00:00Z", "measures": rises(15.0)});
    let late = measure(late).await;
    // Added later, measured earlier: it does not count.
    measure(json!({"measured_at": "2026-02-01T10:00:00Z", "measures": rises(9.0)})).await;
    let others = json!({"near_tandem_hold_s": {"value": 10.0}, "alternate_step_s": {"value": 9.0}});
    measure(json!({"measured_at": "2026-01-01T10:00:00Z", "measures": others})).await;

    let risk = fall_risk(&app, &patient).await;
    assert_eq!(risk["inputs"]["questionnaire"], newest["id"]);
    let used = risk["inputs"]["measures"].as_array().unwrap();
    let rises = used.iter().find(|used| used["name"] == "five_times_sit_to_stand_s").unwrap();
    assert_eq!((used.len(), &rises["source"]["measurement_id"]), (3, &late["id"]));
    let sts5 = finding(&risk, "sts5");
    assert_eq!((&sts5["status"], &sts5["value"]), (&json!("positive"), &json!(15.0)));
    assert_eq!((&sts5["evidence"], &sts5["cutoff"]["value"]), (&json!("unconfirmed"), &json!(12.0)));
    let quickscreen = finding(&risk, "quickscreen");
    assert_eq!(quickscreen["probability"], json!([0.13, 0.13]), "{quickscreen:#}");
    assert_eq!(quickscreen["population_match"], json!(true));

    let before = app.get(&format!("/v1/patients/{patient}/fall-risk?as_of=2000-01-01T00:00:00Z")).send().await;
    let before = before.expect(StatusCode::OK);
    assert_eq!((&before["inputs"]["questionnaire"], &before["inputs"]["measures"]), (&Value::Null, &json!([])));
    let page = app.get(&format!("/v1/patients/{patient}/questionnaires?limit=1")).send().await.expect(StatusCode::OK);
    assert_eq!(page["items"][0]["id"], newest["id"]);
    let rest = app.get(text(&page["next"])).send().await.expect(StatusCode::OK);
    assert_eq!((&rest["items"][0]["answers"]["falls_12_months"], &rest["next"]), (&json!(3), &Value::Null));
}

#[tokio::test]
async fn a_user_of_a_walking_aid_is_given_findings_and_no_probability() {
    let app = TestApp::new().await;
    let new = json!({"pseudonym": "P-3", "birth_year": 1950, "uses_walking_aid": true});
    let patient = text(&app.post("/v1/patients").json(&new).send().await.expect(StatusCode::CREATED)["id"]).to_owned();
    let risk = fall_risk(&app, &patient).await;
    let quickscreen = finding(&risk, "quickscreen");
    assert_eq!((&quickscreen["probability"], &quickscreen["population_match"]), (&Value::Null, &json!(false)));
}

#[tokio::test]
async fn contradictory_answers_and_impossible_values_are_named_and_nothing_is_kept() {
    let app = TestApp::new().await;
    let patient = app.patient("P-4").await;
    let questionnaires = format!("/v1/patients/{patient}/questionnaires");
    let answers = json!({"falls_12_months": 0, "loss_of_consciousness": true, "falls_efficacy": 3});
    let problem = app.post(&questionnaires).json(&answers).send().await.refused(422, "invalid_body");
    let paths: Vec<&str> = problem["errors"].as_array().unwrap().iter().map(|e| text(&e["path"])).collect();
    assert_eq!(paths, ["loss_of_consciousness", "falls_efficacy"]);
    app.post(&questionnaires).json(&json!({"falls": 2})).send().await.refused(422, "invalid_body");
    let list = app.get(&questionnaires).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"], json!([]));

    let measurements = format!("/v1/patients/{patient}/measurements");
    let measures =
        json!({"timed_up_and_go_s": {"value": -1.0}, "usual_speed_mps": {"value": 1.0, "standard_error": -0.1}});
    let problem =
        app.post(&measurements).json(&json!({"measures": measures})).send().await.refused(422, "invalid_body");
    let paths: Vec<&str> = problem["errors"].as_array().unwrap().iter().map(|e| text(&e["path"])).collect();
    assert_eq!(paths, ["measures.timed_up_and_go_s", "measures.usual_speed_mps"]);
    app.post(&measurements).json(&json!({"measures": {}})).send().await.refused(422, "invalid_body");
}

#[tokio::test]
async fn answers_of_another_organisations_patient_do_not_exist_and_devices_may_not_read_risks() {
    let app = TestApp::new().await;
    let patient = app.patient("P-5").await;
    let elsewhere = app.stranger().await;
    for path in ["questionnaires", "measurements", "fall-risk"] {
        let path = format!("/v1/patients/{patient}/{path}");
        app.get(&path).key(&elsewhere).send().await.refused(404, "not_found");
    }
    let path = format!("/v1/patients/{patient}/questionnaires");
    app.post(&path).key(&elsewhere).json(&json!({"medicines": 1})).send().await.refused(404, "not_found");
}
