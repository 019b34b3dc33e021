//! The report of a patient and its parts, from entered results alone; `performance.rs` has those of recordings.

use crate::support::{TestApp, text};
use axum::http::StatusCode;
use serde_json::{Value, json};

/// A patient of the rules' population with three walks and three rises.
async fn followed(app: &TestApp) -> String {
    let new =
        json!({"pseudonym": "P-7", "birth_year": 1948, "sex": "male", "uses_walking_aid": false, "height_m": 1.74});
    let patient = text(&app.post("/v1/patients").json(&new).send().await.expect(StatusCode::CREATED)["id"]).to_owned();
    let answers = json!({"falls_12_months": 0, "lives_in_community": true, "worries_about_falling": false});
    app.post(&format!("/v1/patients/{patient}/questionnaires")).json(&answers).send().await.expect(StatusCode::CREATED);
    for (day, speed, rises) in [(1, 1.05, 14.0), (8, 0.98, 13.0), (15, 0.70, 12.9)] {
        let measures = json!({"usual_speed_mps": {"value": speed, "standard_error": 0.02, "n_observations": 12},
                              "five_times_sit_to_stand_s": {"value": rises, "standard_error": 0.1}});
        let body = json!({"measured_at": format!("2026-03-{day:02}T10:00:00Z"), "measures": measures});
        app.post(&format!("/v1/patients/{patient}/measurements")).json(&body).send().await.expect(StatusCode::CREATED);
    }
    patient
}

fn by_name<'a>(items: &'a Value, name: &str) -> &'a Value {
    let found = items.as_array().unwrap().iter().find(|item| item["name"] == name);
    found.unwrap_or_else(|| panic!("no {name} in {items:#}"))
}

#[tokio::test]
async fn a_report_holds_findings_measures_trends_and_what_is_missing() {
    let app = TestApp::new().await;
    let patient = followed(&app).await;
    let report = app.get(&format!("/v1/patients/{patient}/report")).send().await.expect(StatusCode::OK);
    assert_eq!(
        (&report["patient"]["pseudonym"], &report["patient"]["matches_population"]),
        (&json!("P-7"), &json!(true))
    );
    let rules = app.get("/v1/fall-risk-rules").send().await.expect(StatusCode::OK);
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.len(), rules["items"].as_array().unwrap().len());
    let counted: u64 = report["counts"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(counted, findings.len() as u64);
    let speed = findings.iter().find(|finding| finding["rule_id"] == "speed_slow_ss").unwrap();
    assert_eq!((&speed["status"], &speed["value"]), (&json!("positive"), &json!(0.7)));
    assert!(speed["accuracy"].as_str().unwrap().contains("AUC 0.69") && !text(&speed["citation"]).is_empty());
    // Every finding without an answer says what it needs.
    let unknown = findings.iter().filter(|finding| finding["status"] == "unknown").count();
    assert_eq!(report["needed"].as_array().unwrap().len(), unknown);
    assert_eq!(by_name(&report["measures"], "usual_speed_mps")["unit"], "m/s");

    let speed = by_name(&report["trends"], "usual_speed_mps");
    assert_eq!(speed["points"].as_array().unwrap().len(), 3);
    assert_eq!(speed["since_previous"]["verdict"], "changed", "{speed:#}");
    assert_eq!(speed["since_previous"]["rule"]["id"], "mdc_slow_walkers");
    let rises = by_name(&report["trends"], "five_times_sit_to_stand_s");
    assert_eq!(rises["since_first"]["verdict"], "within_error", "{rises:#}");
    assert_eq!((&report["adherence"], &report["recent_sessions"]), (&Value::Null, &json!([])));
    assert!(text(&report["caution"]).contains("not a diagnosis"));
}

#[tokio::test]
async fn the_report_of_an_earlier_time_knows_nothing_of_what_came_later() {
    let app = TestApp::new().await;
    let patient = followed(&app).await;
    let report = app.get(&format!("/v1/patients/{patient}/report?as_of=2001-01-01T00:00:00Z")).send().await;
    let report = report.expect(StatusCode::OK);
    assert_eq!((&report["measures"], &report["trends"]), (&json!([]), &json!([])));
    assert_eq!(report["counts"]["positive"], 0);
}

#[tokio::test]
async fn measures_and_trends_can_be_read_by_name() {
    let app = TestApp::new().await;
    let patient = followed(&app).await;
    let measures = format!("/v1/patients/{patient}/measures");
    let page = app.get(&format!("{measures}?name=usual_speed_mps&limit=2")).send().await.expect(StatusCode::OK);
    let items = page["items"].as_array().unwrap();
    assert_eq!((items.len(), &items[0]["value"], &items[0]["source"]["kind"]), (2, &json!(0.7), &json!("entered")));
    let rest = app.get(text(&page["next"])).send().await.expect(StatusCode::OK);
    assert_eq!((&rest["items"][0]["value"], &rest["next"]), (&json!(1.05), &Value::Null));
    let trends = app.get(&format!("/v1/patients/{patient}/trends?name=usual_speed_mps&points=2")).send().await;
    let trends = trends.expect(StatusCode::OK);
    assert_eq!(trends["items"].as_array().unwrap().len(), 1);
    assert_eq!(trends["items"][0]["points"].as_array().unwrap().len(), 2);
    let nothing = app.get(&format!("{measures}?name=shoe_size")).send().await.expect(StatusCode::OK);
    assert_eq!(nothing["items"], json!([]));
    app.get(&format!("{measures}?name=Not a word")).send().await.refused(400, "invalid_request");
    app.get(&format!("/v1/patients/{patient}/trends?points=0")).send().await.refused(400, "invalid_request");
}

#[tokio::test]
async fn a_training_plan_is_kept_and_the_report_tells_what_was_done() {
    let app = TestApp::new().await;
    let patient = followed(&app).await;
    let plans = format!("/v1/patients/{patient}/training-plans");
    let wrong = json!({"sessions_per_week": 40, "exercises": []});
    let problem = app.post(&plans).json(&wrong).send().await.refused(422, "invalid_body");
    let paths: Vec<&str> = problem["errors"].as_array().unwrap().iter().map(|e| text(&e["path"])).collect();
    assert_eq!(paths, ["sessions_per_week", "exercises"]);
    let plan = json!({"sessions_per_week": 3, "exercises": [{"protocol": "back_knee", "repetitions": 10}]});
    let added = app.post(&plans).json(&plan).send().await.expect(StatusCode::CREATED);
    let list = app.get(&plans).send().await.expect(StatusCode::OK);
    assert_eq!((&list["items"][0]["id"], &list["items"][0]["plan"]["sessions_per_week"]), (&added["id"], &json!(3)));
    let report = app.get(&format!("/v1/patients/{patient}/report")).send().await.expect(StatusCode::OK);
    assert_eq!((&report["adherence"]["done_sessions"], &report["adherence"]["done_pct"]), (&json!(0), &Value::Null));
}

#[tokio::test]
async fn a_report_is_read_as_fhir_resources_one_by_one_by_search_and_as_a_bundle() {
    let app = TestApp::new().await;
    let patient = followed(&app).await;
    let bundle = app.get(&format!("/v1/patients/{patient}/fhir-bundle")).send().await.expect(StatusCode::OK);
    let kinds = |kind: &str| {
        let entries = bundle["entry"].as_array().unwrap();
        entries.iter().map(|entry| &entry["resource"]).filter(|r| r["resourceType"] == kind).collect::<Vec<_>>()
    };
    assert_eq!((kinds("Observation").len(), kinds("DiagnosticReport").len(), kinds("Device").len()), (2, 1, 1));
    assert_eq!(kinds("DiagnosticReport")[0]["status"], "preliminary");
    assert_eq!(kinds("Patient").len(), 0);
    assert!(!bundle.to_string().contains("P-7"), "the pseudonym stands in the bundle");
    let slow = kinds("RiskAssessment").into_iter().find(|r| r["code"]["coding"][0]["code"] == "speed_slow_ss").unwrap();
    assert_eq!(slow["prediction"][0]["qualitativeRisk"]["text"], "positive");
    assert_eq!(slow["basis"].as_array().unwrap().len(), 1);

    let search = |query: &str| app.get(&format!("/fhir/R4/{query}")).send();
    let found = search(&format!("Observation?patient={patient}&code=usual_speed_mps&_count=2")).await;
    let found = found.expect(StatusCode::OK);
    assert_eq!((&found["type"], found["entry"].as_array().unwrap().len()), (&json!("searchset"), 2));
    let next = found["link"].as_array().unwrap().iter().find(|link| link["relation"] == "next").unwrap();
    let rest = app.get(text(&next["url"])).send().await.expect(StatusCode::OK);
    assert_eq!(rest["entry"].as_array().unwrap().len(), 1);
    let early =
        search(&format!("Observation?patient=Patient/{patient}&date=lt2026-03-02")).await.expect(StatusCode::OK);
    assert_eq!(early["entry"].as_array().unwrap().len(), 2);
    let foreign = search(&format!("Observation?patient={patient}&code=http://loinc.org|1-8")).await;
    assert_eq!(foreign.expect(StatusCode::OK).get("entry"), None);
    let id = text(&found["entry"][0]["resource"]["id"]).to_owned();
    let one = search(&format!("Observation/{id}")).await.expect(StatusCode::OK);
    assert_eq!(one, found["entry"][0]["resource"]);
    let risks = search(&format!("RiskAssessment?patient={patient}&code=urn:surefoot:rule|sts5")).await;
    let risks = risks.expect(StatusCode::OK);
    assert_eq!(risks["total"], 1);
    let own = search(&format!("RiskAssessment/{}", text(&risks["entry"][0]["resource"]["id"]))).await;
    assert_eq!(own.expect(StatusCode::OK)["method"]["text"], "sts5/1");
    let reports = search(&format!("DiagnosticReport?patient={patient}")).await.expect(StatusCode::OK);
    let own = search(&format!("DiagnosticReport/{}", text(&reports["entry"][0]["resource"]["id"]))).await;
    assert_eq!(own.expect(StatusCode::OK)["resourceType"], "DiagnosticReport");
    let metadata = search("metadata").await.expect(StatusCode::OK);
    assert_eq!((&metadata["resourceType"], &metadata["fhirVersion"]), (&json!("CapabilityStatement"), &json!("4.0.1")));

    search("Observation?patient=nobody").await.refused(400, "invalid_request");
    search(&format!("Observation?patient={patient}&date=yesterday")).await.refused(400, "invalid_request");
    search("RiskAssessment/x").await.refused(404, "not_found");
    search("DiagnosticReport/report-x").await.refused(404, "not_found");
    let elsewhere = app.stranger().await;
    for path in ["report", "trends", "measures", "fhir-bundle", "training-plans"] {
        app.get(&format!("/v1/patients/{patient}/{path}")).key(&elsewhere).send().await.refused(404, "not_found");
    }
    let path = format!("/fhir/R4/Observation?patient={patient}");
    app.get(&path).key(&elsewhere).send().await.refused(404, "not_found");
}
