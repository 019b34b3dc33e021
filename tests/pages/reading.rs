//! What stands in the pages, and what never does.

use crate::support::Clinic;
use axum::body::Body;
use axum::http::{Method, StatusCode};
use serde_json::json;
use surefoot::recording::encode;
use surefoot::storage::audit::Actor;
use surefoot::storage::retention::RetentionRules;
use surefoot::storage::{NewPatient, Role};
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

fn exercise() -> Vec<u8> {
    let settings = SimulationSettings::new(Exercise::BackKnee, Preset::Table1, 1);
    let settings = SimulationSettings { duration_s: 8.0, ..settings };
    encode::mcap(&simulate(&settings).unwrap().recording).unwrap()
}

#[tokio::test]
async fn every_page_forbids_what_is_not_its_own_and_is_not_kept() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-7").await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    let pages = ["/app/sign-in", "/app/patients", &format!("/app/patients/{patient}"), "/app/nothing"];
    for page in pages {
        let answer = clinic.get(page, &cookie).await;
        let policy = answer.header("content-security-policy");
        for part in
            ["default-src 'none'", "script-src 'self'", "style-src 'self'", "frame-ancestors 'none'", "base-uri 'none'"]
        {
            assert!(policy.contains(part), "{page}: {policy}");
        }
        assert!(!policy.contains("unsafe"), "{policy}");
        assert_eq!(answer.header("cache-control"), "no-store", "{page}");
        assert_eq!(answer.header("x-content-type-options"), "nosniff");
        assert_eq!(answer.header("referrer-policy"), "same-origin");
        assert!(answer.header("content-type").starts_with("text/html"), "{page}");
        // Nothing that the policy would block, and nothing from outside.
        for forbidden in ["<style", " style=", "onclick", "http://", "https://"] {
            assert!(!answer.body.contains(forbidden), "{page} holds {forbidden}");
        }
        let scripts = answer.body.matches("<script").count();
        assert_eq!((scripts, answer.body.matches(r#"<script type="module" src="/app/assets/"#).count()), (1, 1));
    }
}

#[tokio::test]
async fn script_and_style_are_kept_for_ever_under_their_digest() {
    let clinic = Clinic::open().await;
    let page = clinic.get("/app/sign-in", "").await.body;
    for (begin, kind) in [("src=\"", "text/javascript"), ("stylesheet\" href=\"", "text/css")] {
        let address = page.split(begin).nth(1).unwrap().split('"').next().unwrap();
        let answer = clinic.get(address, "").await;
        assert_eq!(answer.status, StatusCode::OK, "{address}");
        assert!(answer.header("content-type").starts_with(kind));
        assert_eq!(answer.header("cache-control"), "public, max-age=31536000, immutable");
    }
    assert_eq!(clinic.get("/app/assets/app-0000000000000000.js", "").await.status, StatusCode::NOT_FOUND);
    assert_eq!(clinic.get("/app/assets/..%2F..%2FCargo.toml", "").await.status, StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn patients_are_found_by_a_piece_of_their_pseudonym_in_pages() {
    let clinic = Clinic::open().await;
    for i in 0..30 {
        clinic.made("/v1/patients", &json!({"pseudonym": format!("Ward-{i:02}")})).await;
    }
    clinic.made("/v1/patients", &json!({"pseudonym": "Other_1"})).await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    let rows = |body: &str| body.matches("<th scope=\"row\">").count();
    let first = clinic.get("/app/patients?q=wARD", &cookie).await.body;
    assert_eq!(rows(&first), 25);
    let next = first
        .split("rel=\"next\" href=\"")
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap()
        .replace("&amp;", "&")
        .replace("&#38;", "&");
    let second = clinic.get(&next, &cookie).await.body;
    assert_eq!((rows(&second), second.contains("rel=\"next\"")), (5, false));
    assert_eq!(rows(&clinic.get("/app/patients?q=-07", &cookie).await.body), 1);
    // What stands for anything in a pattern stands for itself here.
    assert_eq!(rows(&clinic.get("/app/patients?q=%25", &cookie).await.body), 0);
    assert_eq!(rows(&clinic.get("/app/patients?q=r_", &cookie).await.body), 1);
    assert_eq!(clinic.get("/app/patients?cursor=x", &cookie).await.status, StatusCode::BAD_REQUEST);
    let long = "a".repeat(65);
    assert_eq!(clinic.get(&format!("/app/patients?q={long}"), &cookie).await.status, StatusCode::BAD_REQUEST);
}

#[tokio::test]
async fn hostile_text_is_text() {
    let clinic = Clinic::open().await;
    let hostile = "\"><script>alert(1)</script>";
    // The API takes no such pseudonym; a page must not rely on that.
    let access = {
        let clients = clinic.state.store.clients(clinic.organisation().await).await.unwrap();
        clients[0].access()
    };
    let new = NewPatient { pseudonym: hostile.to_owned(), ..NewPatient::default() };
    let patient = clinic.state.store.create_patient(&access, &new).await.unwrap().id.to_string();
    let [session, recording] = clinic.uploaded(&patient, "<img src=x onerror=alert(1)>", exercise()).await;
    clinic.run_pending_jobs().await;
    let assessment = clinic.assessment_of(&recording).await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    for page in [
        "/app/patients".to_owned(),
        format!("/app/patients?q={}", "%22%3E%3Cscript%3Ealert(1)%3C%2Fscript%3E"),
        format!("/app/patients/{patient}"),
        format!("/app/sessions/{session}"),
        format!("/app/assessments/{assessment}"),
        "/app/sign-in?next=%22%3E%3Cscript%3Ealert(1)".to_owned(),
    ] {
        let answer = clinic.get(&page, &cookie).await;
        assert_eq!(answer.status, StatusCode::OK, "{page}: {}", answer.body);
        for raw in ["<script>", "<img", "<i>on", "<b>3"] {
            assert!(!answer.body.contains(raw), "{page} holds {raw}");
        }
    }
}

#[tokio::test]
async fn a_report_tells_its_findings_and_what_is_missing() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-7").await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    let body = clinic.get(&format!("/app/patients/{patient}"), &cookie).await.body;
    for part in [
        "Report of P-7",
        "0.700\u{a0}m/s",
        "standard errors beyond the limit",
        "Accuracy of the tool",
        "must not guide care",
        "That is not a sign of low risk",
        "no score blends them",
        "No change shown",
        "not a diagnosis",
        "Made by Surefoot",
        "sessions since",
    ] {
        assert!(body.contains(part), "no `{part}` in {body}");
    }
    // The summary stands before every finding.
    assert!(body.find("id=\"summary\"").unwrap() < body.find("<article").unwrap());
    let early = clinic.get(&format!("/app/patients/{patient}?as_of=2001-01-01"), &cookie).await.body;
    assert!(early.contains("Nothing was measured") && !early.contains("0.700"), "{early}");
    assert_eq!(clinic.get(&format!("/app/patients/{patient}?as_of=x"), &cookie).await.status, StatusCode::BAD_REQUEST);
}

#[tokio::test]
async fn a_recording_is_followed_from_its_upload_to_its_assessment() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-7").await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    assert!(clinic.get("/app/patients", &cookie).await.body.contains("none yet"));
    let [session, recording] = clinic.uploaded(&patient, "back_knee", exercise()).await;
    assert!(!clinic.get("/app/patients", &cookie).await.body.contains("none yet"));
    let waiting = clinic.get(&format!("/app/sessions/{session}"), &cookie).await.body;
    assert!(waiting.contains("data-job=") && waiting.contains("queued"), "{waiting}");
    let report = clinic.get(&format!("/app/patients/{patient}"), &cookie).await.body;
    assert!(report.contains(&format!("data-recording=\"{recording}\"")), "{report}");

    clinic.run_pending_jobs().await;
    let assessment = clinic.assessment_of(&recording).await;
    let done = clinic.get(&format!("/app/sessions/{session}"), &cookie).await.body;
    assert!(done.contains(&format!("/app/assessments/{assessment}")) && !done.contains("data-job="), "{done}");
    let own = clinic.get(&format!("/app/recordings/{recording}"), &cookie).await;
    assert_eq!(own.header("location"), format!("/app/sessions/{session}#recording-{recording}"));
    let page = clinic.get(&format!("/app/assessments/{assessment}"), &cookie).await.body;
    for part in [
        "Right knee flexion",
        "export?form=trc",
        "method iekf",
        "How far to trust it",
        "not a diagnosis",
        "data-joints",
    ] {
        assert!(page.contains(part), "no `{part}` in {page}");
    }

    let rules = RetentionRules { recordings: Some(time::Duration::milliseconds(1)), ..RetentionRules::default() };
    clinic.state.store.apply_retention(&rules, Actor::service).await.unwrap();
    let later = clinic.get(&format!("/app/sessions/{session}"), &cookie).await.body;
    assert!(later.contains("itself was removed") && !done.contains("itself was removed"), "{later}");
    assert!(later.contains(&format!("/app/assessments/{assessment}")), "the result stays: {later}");
}

#[tokio::test]
async fn what_another_organisation_has_does_not_exist() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-7").await;
    let [session, recording] = clinic.uploaded(&patient, "back_knee", exercise()).await;
    clinic.run_pending_jobs().await;
    let assessment = clinic.assessment_of(&recording).await;
    let stranger = clinic.key_of(Role::Admin, true).await;
    let cookie = clinic.cookie_of(&stranger).await;
    for page in [
        format!("patients/{patient}"),
        format!("sessions/{session}"),
        format!("recordings/{recording}"),
        format!("assessments/{assessment}"),
    ] {
        let answer = clinic.get(&format!("/app/{page}"), &cookie).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{page}");
        assert!(!answer.body.contains("P-7") && answer.header("content-type").starts_with("text/html"));
    }
    assert!(!clinic.get("/app/patients", &cookie).await.body.contains("P-7"));
}

#[tokio::test]
async fn refusals_are_pages_and_tell_nothing_of_the_inside() {
    let clinic = Clinic::open().await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    for (page, status) in [
        ("/app/patients/not-an-id", StatusCode::NOT_FOUND),
        ("/app/assessments/01920000-0000-7000-8000-000000000000", StatusCode::NOT_FOUND),
        ("/app/elsewhere/entirely", StatusCode::NOT_FOUND),
    ] {
        let answer = clinic.get(page, &cookie).await;
        assert_eq!(answer.status, status, "{page}");
        assert!(answer.body.contains("<h1>") && !answer.body.contains("sqlx"), "{}", answer.body);
    }
    let post = clinic.send(Method::POST, "/app/patients", &[("cookie", &cookie)], Body::empty()).await;
    assert_eq!(post.status, StatusCode::METHOD_NOT_ALLOWED);
    assert!(post.header("content-type").starts_with("text/html") && post.header("allow").contains("GET"));
    // The API's own refusals stay what they are.
    let api = clinic.get("/v1/nothing", &cookie).await;
    assert_eq!(api.header("content-type"), "application/problem+json");
}
