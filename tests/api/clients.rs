use crate::support::{TestApp, text};
use axum::http::{Method, StatusCode};
use serde_json::json;
use surefoot::storage::Role;

#[tokio::test]
async fn a_key_is_shown_once_works_and_stops_working_when_revoked() {
    let app = TestApp::new().await;
    let new = json!({"role": "clinician", "label": "ward 3"});
    let made = app.post("/v1/clients").json(&new).send().await.expect(StatusCode::CREATED);
    let key = text(&made["key"]);
    app.get("/v1/patients").key(key).send().await.expect(StatusCode::OK);

    let listed = app.get("/v1/clients").send().await;
    assert!(!String::from_utf8_lossy(&listed.body).contains(key), "a list must not show keys");
    assert_eq!(listed.expect(StatusCode::OK)["items"].as_array().unwrap().len(), 2);

    let path = format!("/v1/clients/{}", text(&made["client"]["id"]));
    let revoked = app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert!(revoked["revoked_at"].is_string());
    let again = app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    assert_eq!(again["revoked_at"], revoked["revoked_at"], "revoking again changes nothing");
    app.get("/v1/patients").key(key).send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn only_an_admin_of_the_organisation_manages_its_keys() {
    let app = TestApp::new().await;
    for role in [Role::Device, Role::Clinician] {
        let key = app.key(role).await;
        app.get("/v1/clients").key(&key).send().await.refused(403, "forbidden");
        let new = json!({"role": "admin", "label": "me"});
        app.post("/v1/clients").key(&key).json(&new).send().await.refused(403, "forbidden");
    }
    let clients = app.get("/v1/clients").send().await.expect(StatusCode::OK);
    let path = format!("/v1/clients/{}", text(&clients["items"][1]["id"]));
    let elsewhere = app.stranger().await;
    app.request(Method::DELETE, &path).key(&elsewhere).send().await.refused(404, "not_found");
}

#[tokio::test]
async fn a_key_cannot_revoke_itself() {
    let app = TestApp::new().await;
    let clients = app.get("/v1/clients").send().await.expect(StatusCode::OK);
    let path = format!("/v1/clients/{}", text(&clients["items"][0]["id"]));
    app.request(Method::DELETE, &path).send().await.refused(409, "own_key");
}

#[tokio::test]
async fn a_role_that_does_not_exist_is_refused_by_its_path() {
    let app = TestApp::new().await;
    let new = json!({"role": "root", "label": "me"});
    let problem = app.post("/v1/clients").json(&new).send().await.refused(422, "invalid_body");
    assert_eq!(problem["errors"][0]["path"], "role");
}
