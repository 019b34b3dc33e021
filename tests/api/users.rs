//! Users, managed by administrators. How they sign in is a matter of the pages.

use crate::support::{TestApp, text};
use axum::http::{Method, StatusCode};
use serde_json::json;
use surefoot::storage::{Password, Role, SignIn};

const HERE: std::net::IpAddr = std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

#[tokio::test]
async fn an_admin_makes_resets_and_disables_a_user() {
    let app = TestApp::new().await;
    let new = json!({"name": "m.lee", "role": "clinician", "label": "Dr Lee"});
    let made = app.post("/v1/users").json(&new).send().await.expect(StatusCode::CREATED);
    assert_eq!((&made["user"]["must_change_password"], &made["user"]["role"]), (&json!(true), &json!("clinician")));
    let signs_in = async |password: &str| {
        let answer = app.state.store.sign_in("m.lee", &Password::from_text(password), HERE).await.unwrap();
        matches!(answer, SignIn::Welcome(_))
    };
    let first = text(&made["password"]);
    assert!(signs_in(first).await);

    let path = format!("/v1/users/{}", text(&made["user"]["id"]));
    let reset = app.post(&format!("{path}/reset")).send().await.expect(StatusCode::OK);
    assert!(!signs_in(first).await && signs_in(text(&reset["password"])).await);

    let disabled = app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert!(disabled["disabled_at"].is_string());
    assert!(!signs_in(text(&reset["password"])).await);
    app.post(&format!("{path}/reset")).send().await.refused(409, "user_disabled");
    let again = app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert_eq!(again["disabled_at"], disabled["disabled_at"], "disabling again changes nothing");

    let listed = app.get("/v1/users").send().await;
    assert!(!String::from_utf8_lossy(&listed.body).contains("argon2"), "a list shows no digest");
    assert_eq!(listed.expect(StatusCode::OK)["items"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn names_are_words_and_unique_and_users_are_no_devices() {
    let app = TestApp::new().await;
    let make = |name: &str, role: &str| app.post("/v1/users").json(&json!({"name": name, "role": role, "label": "x"}));
    for bad in ["Lee", "a", "-lee", "lee lee", &"x".repeat(65)] {
        let problem = make(bad, "admin").send().await.refused(422, "invalid_body");
        assert_eq!(problem["errors"][0]["path"], "name", "{bad}");
    }
    make("lee", "device").send().await.refused(422, "invalid_body");
    make("lee", "admin").send().await.expect(StatusCode::CREATED);
    make("lee", "clinician").send().await.refused(409, "user_name_taken");
    let elsewhere = app.stranger().await;
    make("lee", "clinician").key(&elsewhere).send().await.refused(409, "user_name_taken");
}

#[tokio::test]
async fn a_user_is_no_key_and_a_key_is_no_user() {
    let app = TestApp::new().await;
    let new = json!({"name": "m.lee", "role": "clinician", "label": "Dr Lee"});
    let made = app.post("/v1/users").json(&new).send().await.expect(StatusCode::CREATED);
    let user = text(&made["user"]["id"]);
    app.request(Method::DELETE, &format!("/v1/clients/{user}")).send().await.refused(404, "not_found");
    app.post(&format!("/v1/clients/{user}/rotate")).json(&json!({})).send().await.refused(404, "not_found");
    let me = app.get("/v1/me").send().await.expect(StatusCode::OK);
    assert_eq!(me["role"], "admin");
    app.request(Method::DELETE, &format!("/v1/users/{}", text(&me["id"]))).send().await.refused(409, "own_user");
    let key = app.key(Role::Device).await;
    let device = app.get("/v1/me").key(&key).send().await.expect(StatusCode::OK);
    app.request(Method::DELETE, &format!("/v1/users/{}", text(&device["id"]))).send().await.refused(404, "not_found");
}
