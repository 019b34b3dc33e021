//! Sign-in with name and password, the change of a password, and what failures cost.

use crate::support::{Answer, Clinic};
use axum::http::StatusCode;
use surefoot::config::Config;
use surefoot::storage::{ClientId, NewUser, Role};

const OWN: &str = "a quiet garden path";

/// Makes the user `lee`; the id and the password that was given out.
async fn lee(clinic: &Clinic) -> (ClientId, String) {
    let new = NewUser { name: "lee".into(), role: Role::Clinician, label: "Dr <b>Lee</b>".into() };
    let (user, password) = clinic.state.store.create_user(clinic.organisation().await, &new).await.unwrap();
    (user.client.id, password.reveal().to_owned())
}

async fn sign_in(clinic: &Clinic, name: &str, password: &str) -> Answer {
    let body = format!("name={name}&password={}&next=%2Fapp%2Fpatients", password.replace(' ', "+"));
    clinic.form("/app/sign-in", &[], &body).await
}

async fn change(clinic: &Clinic, cookie: &str, current: &str, new: &str, again: &str) -> Answer {
    let words = [current, new, again].map(|text| text.replace(' ', "+"));
    let body = format!("current={}&new={}&again={}", words[0], words[1], words[2]);
    clinic.form("/app/password", &[("cookie", cookie)], &body).await
}

fn cookie(answer: &Answer) -> String {
    answer.header("set-cookie").split(';').next().unwrap().to_owned()
}

#[tokio::test]
async fn a_password_that_was_given_out_is_good_for_its_change_only() {
    let clinic = Clinic::open().await;
    let (_, given) = lee(&clinic).await;
    let answer = sign_in(&clinic, "Lee", &given).await;
    assert_eq!((answer.status, answer.header("location")), (StatusCode::SEE_OTHER, "/app/password"));
    let first = cookie(&answer);
    assert_eq!(clinic.get("/app/patients", &first).await.status, StatusCode::SEE_OTHER);
    assert_eq!(clinic.get("/v1/patients", &first).await.status, StatusCode::UNAUTHORIZED);
    assert_eq!(clinic.get("/app/sign-in", &first).await.header("location"), "/app/password");
    let form = clinic.get("/app/password", &first).await;
    assert!(form.body.contains("given out by an administrator") && !form.body.contains("<b>Lee"), "{}", form.body);

    for (current, new, again, why) in [
        ("not the password", OWN, OWN, "current password is not right"),
        (given.as_str(), "short", "short", "must have 15 to 128 characters"),
        (given.as_str(), "passwordpassword", "passwordpassword", "tried first"),
        (given.as_str(), OWN, "a quiet garden wall", "not typed the same twice"),
        (given.as_str(), given.as_str(), given.as_str(), "is the current one"),
    ] {
        let answer = change(&clinic, &first, current, new, again).await;
        assert_eq!(answer.status, StatusCode::UNPROCESSABLE_ENTITY, "{why}");
        assert!(answer.body.contains(why) && !answer.body.contains(OWN), "{why}: {}", answer.body);
    }
    let answer = change(&clinic, &first, &given, OWN, OWN).await;
    assert_eq!((answer.status, answer.header("location")), (StatusCode::SEE_OTHER, "/app/patients"));
    let second = cookie(&answer);
    assert_ne!(first, second);
    assert_eq!(clinic.get("/app/password", &first).await.status, StatusCode::SEE_OTHER, "the session before is over");
    let page = clinic.get("/app/patients", &second).await;
    assert!(page.status == StatusCode::OK && page.body.contains("/app/password"), "{}", page.body);
    assert_eq!(clinic.get("/v1/patients", &second).await.status, StatusCode::OK);
    assert_eq!(sign_in(&clinic, "lee", &given).await.status, StatusCode::UNAUTHORIZED);
    assert_eq!(sign_in(&clinic, "lee", OWN).await.header("location"), "/app/patients");
}

#[tokio::test]
async fn an_unknown_name_and_a_wrong_password_get_the_same_answer_and_the_same_wait() {
    let clinic = Clinic::open().await;
    let (_, given) = lee(&clinic).await;
    for attempt in 0..6 {
        let [known, unknown] = [sign_in(&clinic, "lee", "wrong").await, sign_in(&clinic, "kim", "wrong").await];
        assert_eq!(known.status, StatusCode::UNAUTHORIZED, "{attempt}");
        assert_eq!((known.status, &known.body), (unknown.status, &unknown.body));
    }
    let [known, unknown] = [sign_in(&clinic, "lee", &given).await, sign_in(&clinic, "kim", &given).await];
    assert_eq!(known.status, StatusCode::TOO_MANY_REQUESTS);
    assert_eq!((known.status, &known.body), (unknown.status, &unknown.body));
    let wait: u64 = known.header("retry-after").parse().unwrap();
    assert!((1..=31).contains(&wait), "{wait}");
    assert!(known.header("set-cookie").is_empty());
}

#[tokio::test]
async fn disabling_and_resetting_end_what_somebody_is_signed_in_to() {
    let clinic = Clinic::open().await;
    let (id, given) = lee(&clinic).await;
    let first = cookie(&sign_in(&clinic, "lee", &given).await);
    let second = cookie(&change(&clinic, &first, &given, OWN, OWN).await);
    let organisation = clinic.organisation().await;
    clinic.state.store.reset_user(organisation, id).await.unwrap();
    assert_eq!(clinic.get("/app/patients", &second).await.status, StatusCode::SEE_OTHER);
    assert_eq!(sign_in(&clinic, "lee", OWN).await.status, StatusCode::UNAUTHORIZED);
    clinic.state.store.disable_user(organisation, id).await.unwrap();
    let (_, again) = (id, sign_in(&clinic, "lee", OWN).await);
    assert_eq!(again.status, StatusCode::UNAUTHORIZED);
}

#[tokio::test]
async fn no_other_site_changes_a_password_and_a_key_has_none() {
    let clinic = Clinic::open().await;
    let (_, given) = lee(&clinic).await;
    let session = cookie(&sign_in(&clinic, "lee", &given).await);
    let body = format!("current={given}&new=a+quiet+garden+path&again=a+quiet+garden+path");
    for foreign in ["cross-site", "same-site", "none"] {
        let headers = [("cookie", session.as_str()), ("sec-fetch-site", foreign)];
        assert_eq!(clinic.form("/app/password", &headers, &body).await.status, StatusCode::FORBIDDEN, "{foreign}");
    }
    let signed_in = sign_in(&clinic, "lee", &given).await;
    assert_eq!(signed_in.status, StatusCode::SEE_OTHER, "the password is still the one that was given out");
    let of_key = clinic.cookie_of(&clinic.key).await;
    let answer = clinic.get("/app/password", &of_key).await;
    assert_eq!(answer.status, StatusCode::SEE_OTHER);
    assert!(answer.header("location").starts_with("/app/sign-in"));
    assert!(!clinic.get("/app/patients", &of_key).await.body.contains("/app/password"));
}

#[tokio::test]
async fn a_receiver_finds_shared_patients_on_the_first_page_and_reads_their_report() {
    let clinic = Clinic::open().await;
    let patient = clinic.made("/v1/patients", &serde_json::json!({"pseudonym": "P-77"})).await;
    let patient = patient["id"].as_str().unwrap();
    let receiver = clinic.key_of(Role::Clinician, true).await;
    let cookie = clinic.cookie_of(&receiver).await;
    let report = format!("/app/patients/{patient}");
    assert_eq!(clinic.get(&report, &cookie).await.status, StatusCode::NOT_FOUND);
    let me = clinic.get("/v1/me", &cookie).await.json();
    let until = time::OffsetDateTime::now_utc() + time::Duration::HOUR;
    let until = until.format(&time::format_description::well_known::Rfc3339).unwrap();
    let share = serde_json::json!({"receiver_id": me["id"], "expires_at": until});
    clinic.made(&format!("/v1/patients/{patient}/shares"), &share).await;
    let page = clinic.get("/app/patients", &cookie).await.body;
    assert!(page.contains("Shared with you") && page.contains("P-77") && page.contains(&report), "{page}");
    assert_eq!(clinic.get(&report, &cookie).await.status, StatusCode::OK);
}

#[tokio::test]
async fn who_opens_pages_too_often_is_told_so_on_a_page() {
    let clinic = Clinic::with_config(Config { requests_per_minute: 2, ..Config::default() }).await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    for _ in 0..2 {
        assert_eq!(clinic.get("/app/patients", &cookie).await.status, StatusCode::OK);
    }
    let refused = clinic.get("/app/patients", &cookie).await;
    assert_eq!(refused.status, StatusCode::TOO_MANY_REQUESTS);
    let wait: u64 = refused.header("retry-after").parse().unwrap();
    assert!((1..=31).contains(&wait) && refused.body.contains("<h1>"), "{wait}: {}", refused.body);
}

#[tokio::test]
async fn forms_of_strangers_are_counted_whatever_cookie_they_bring() {
    let clinic = Clinic::with_config(Config { anonymous_requests_per_minute: 2, ..Config::default() }).await;
    let headers = [("cookie", "surefoot_page=invented")];
    for _ in 0..2 {
        assert_eq!(clinic.form("/app/sign-out", &headers, "").await.status, StatusCode::SEE_OTHER);
    }
    for path in ["/app/sign-out", "/app/sign-in", "/app/password"] {
        assert_eq!(clinic.form(path, &headers, "").await.status, StatusCode::TOO_MANY_REQUESTS, "{path}");
    }
}
