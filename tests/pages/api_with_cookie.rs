//! What the cookie of the pages opens at the API: reading, and nothing else.

use crate::support::Clinic;
use axum::body::Body;
use axum::http::{Method, StatusCode};
use serde_json::json;

#[tokio::test]
async fn a_cookie_reads_the_api_as_its_key_does() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-7").await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    for path in ["/v1/patients".to_owned(), format!("/v1/patients/{patient}/report"), "/v1/jobs".to_owned()] {
        let answer = clinic.get(&path, &cookie).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}: {}", answer.body);
    }
    let head = clinic.send(Method::HEAD, "/v1/patients", &[("cookie", &cookie)], Body::empty()).await;
    assert_eq!(head.status, StatusCode::OK);
    assert_eq!(clinic.get("/v1/clients", &cookie).await.status, StatusCode::FORBIDDEN);
}

#[tokio::test]
async fn a_cookie_changes_nothing_at_the_api() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-7").await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    let headers =
        [("cookie", cookie.as_str()), ("content-type", "application/json"), ("sec-fetch-site", "same-origin")];
    for (method, path) in [
        (Method::POST, "/v1/patients".to_owned()),
        (Method::PATCH, format!("/v1/patients/{patient}")),
        (Method::POST, format!("/v1/patients/{patient}/measurements")),
        (Method::POST, "/v1/sessions".to_owned()),
        (Method::POST, "/v1/clients".to_owned()),
    ] {
        let body = json!({"pseudonym": "P-8"}).to_string();
        let answer = clinic.send(method.clone(), &path, &headers, body).await;
        assert_eq!(answer.status, StatusCode::UNAUTHORIZED, "{method} {path}");
    }
    let patients = clinic.get("/v1/patients", &cookie).await.json();
    assert_eq!(patients["items"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_read_that_another_site_caused_is_refused() {
    let clinic = Clinic::open().await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    for site in ["cross-site", "same-site"] {
        let headers = [("cookie", cookie.as_str()), ("sec-fetch-site", site)];
        let answer = clinic.send(Method::GET, "/v1/patients", &headers, Body::empty()).await;
        assert_eq!(answer.status, StatusCode::UNAUTHORIZED, "{site}");
    }
}
