//! Sign-in, the cookie, and sign-out.

use crate::support::Clinic;
use axum::body::Body;
use axum::http::{Method, StatusCode};
use surefoot::config::Config;
use surefoot::storage::Role;

#[tokio::test]
async fn a_clinician_signs_in_and_out() {
    let clinic = Clinic::open().await;
    let answer = clinic.sign_in(&clinic.key, &[]).await;
    assert_eq!((answer.status, answer.header("location")), (StatusCode::SEE_OTHER, "/app/patients"));
    let cookie = answer.header("set-cookie").to_owned();
    for part in ["HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=43200"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    assert!(!cookie.contains("Secure") && !cookie.contains(&clinic.key), "{cookie}");
    let cookie = cookie.split(';').next().unwrap();
    assert_eq!(clinic.get("/app/patients", cookie).await.status, StatusCode::OK);

    let headers = [("cookie", cookie), ("sec-fetch-site", "same-origin")];
    let out = clinic.send(Method::POST, "/app/sign-out", &headers, Body::empty()).await;
    assert_eq!((out.status, out.header("location")), (StatusCode::SEE_OTHER, "/app/sign-in"));
    assert!(out.header("set-cookie").contains("Max-Age=0"), "{}", out.header("set-cookie"));
    // The token is worth nothing any more, whoever kept it.
    assert_eq!(clinic.get("/app/patients", cookie).await.status, StatusCode::SEE_OTHER);
}

#[tokio::test]
async fn behind_tls_the_cookie_never_travels_without_it() {
    let clinic = Clinic::open().await;
    let answer = clinic.sign_in(&clinic.key, &[("x-forwarded-proto", "https")]).await;
    assert!(answer.header("set-cookie").ends_with("; Secure"), "{}", answer.header("set-cookie"));
    let clinic = Clinic::with_config(Config { behind_tls: true, ..Config::default() }).await;
    let answer = clinic.sign_in(&clinic.key, &[]).await;
    assert!(answer.header("set-cookie").ends_with("; Secure"), "{}", answer.header("set-cookie"));
}

#[tokio::test]
async fn wrong_keys_and_devices_are_refused_with_the_reason() {
    let clinic = Clinic::open().await;
    for wrong in ["x", "surefoot_0000", "%00%FF"] {
        let answer = clinic.sign_in(wrong, &[]).await;
        assert_eq!(answer.status, StatusCode::UNAUTHORIZED, "{wrong}");
        assert!(answer.header("set-cookie").is_empty());
        assert!(answer.body.contains("unknown or was revoked") && answer.body.contains("<form"), "{}", answer.body);
    }
    let device = clinic.key_of(Role::Device, false).await;
    let answer = clinic.sign_in(&device, &[]).await;
    assert_eq!(answer.status, StatusCode::FORBIDDEN);
    assert!(answer.body.contains("key of a device"), "{}", answer.body);
    assert!(!answer.body.contains(&device), "the key stands in the page");
}

#[tokio::test]
async fn many_failures_make_the_next_sign_in_wait() {
    let clinic = Clinic::open().await;
    for _ in 0..21 {
        assert_eq!(clinic.sign_in("surefoot_guess", &[]).await.status, StatusCode::UNAUTHORIZED);
    }
    let answer = clinic.sign_in("surefoot_guess", &[]).await;
    assert_eq!(answer.status, StatusCode::TOO_MANY_REQUESTS);
    let wait: u64 = answer.header("retry-after").parse().unwrap();
    assert!((1..=31).contains(&wait), "{wait}");
    // Another address has nothing to do with it.
    let (from, far) = (("x-forwarded-for", "203.0.113.9"), std::net::SocketAddr::from(([198, 51, 100, 1], 1)));
    let answer = clinic.form_from(far, "/app/sign-in", &[from], &format!("key={}", clinic.key)).await;
    assert_eq!(answer.status, StatusCode::SEE_OTHER);
}

#[tokio::test]
async fn a_form_of_another_site_signs_nobody_in_or_out() {
    let clinic = Clinic::open().await;
    for foreign in ["cross-site", "same-site", "none"] {
        let headers = [("content-type", "application/x-www-form-urlencoded"), ("sec-fetch-site", foreign)];
        let answer = clinic.send(Method::POST, "/app/sign-in", &headers, format!("key={}", clinic.key)).await;
        assert_eq!((answer.status, answer.header("set-cookie")), (StatusCode::FORBIDDEN, ""), "{foreign}");
    }
    let cookie = clinic.cookie_of(&clinic.key).await;
    let headers = [("cookie", cookie.as_str()), ("origin", "http://elsewhere.example"), ("host", "127.0.0.1")];
    let out = clinic.send(Method::POST, "/app/sign-out", &headers, Body::empty()).await;
    assert_eq!(out.status, StatusCode::FORBIDDEN);
    assert_eq!(clinic.get("/app/patients", &cookie).await.status, StatusCode::OK);
    // A link cannot do it either.
    assert_eq!(clinic.get("/app/sign-out", &cookie).await.status, StatusCode::METHOD_NOT_ALLOWED);
}

#[tokio::test]
async fn a_page_without_a_session_leads_to_the_sign_in_and_back() {
    let clinic = Clinic::open().await;
    let path = "/app/patients?q=P-7";
    let answer = clinic.send(Method::GET, path, &[], Body::empty()).await;
    let sign_in = answer.header("location").to_owned();
    assert_eq!((answer.status, sign_in.as_str()), (StatusCode::SEE_OTHER, "/app/sign-in?next=/app/patients%3Fq%3DP-7"));
    let form = clinic.send(Method::GET, &sign_in, &[], Body::empty()).await;
    assert!(form.body.contains(r#"name="next" value="/app/patients?q=P-7""#), "{}", form.body);
    let form = clinic.send(Method::GET, "/app/sign-in?next=https://elsewhere.example", &[], Body::empty()).await;
    assert!(!form.body.contains("elsewhere"), "{}", form.body);
    assert_eq!(clinic.get(path, "surefoot_page=0123").await.status, StatusCode::SEE_OTHER);
}

#[tokio::test]
async fn a_revoked_key_ends_its_sessions() {
    let clinic = Clinic::open().await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    let clients = clinic.state.store.clients(clinic.organisation().await).await.unwrap();
    let own = clients.iter().find(|client| client.role == Role::Clinician).unwrap();
    clinic.state.store.revoke_client(own.organisation_id, own.id).await.unwrap();
    assert_eq!(clinic.get("/app/patients", &cookie).await.status, StatusCode::SEE_OTHER);
    assert_eq!(clinic.get("/v1/patients", &cookie).await.status, StatusCode::UNAUTHORIZED);
}
