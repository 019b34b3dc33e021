//! How many requests are served, and of whom.

use crate::support::TestApp;
use axum::http::StatusCode;
use surefoot::config::Config;
use surefoot::storage::Role;

fn limits(requests_per_minute: u32, anonymous_requests_per_minute: u32) -> Config {
    Config { requests_per_minute, anonymous_requests_per_minute, ..Config::default() }
}

#[tokio::test]
async fn a_key_that_asks_too_often_waits_and_others_do_not() {
    let app = TestApp::with_config(limits(5, 0)).await;
    let other = app.key(Role::Clinician).await;
    for _ in 0..5 {
        app.get("/v1/patients").send().await.expect(StatusCode::OK);
    }
    let refused = app.get("/v1/patients").send().await;
    refused.refused(429, "too_many_requests");
    let wait: u64 = refused.header("retry-after").parse().unwrap();
    assert!((1..=13).contains(&wait), "{wait}");
    app.get("/v1/patients").key(&other).send().await.expect(StatusCode::OK);
    for path in ["/health/live", "/health/ready", "/metrics"] {
        assert_eq!(app.get(path).send().await.status, StatusCode::OK, "{path}");
    }
}

#[tokio::test]
async fn who_has_no_valid_key_is_counted_by_address() {
    let app = TestApp::with_config(limits(0, 4)).await;
    let ask = |from: &'static str| app.get("/v1/patients").from(from);
    for _ in 0..2 {
        ask("203.0.113.1:4000").without_key().send().await.refused(401, "unauthenticated");
        ask("203.0.113.1:4001").key("surefoot_guess").send().await.refused(401, "unauthenticated");
    }
    ask("203.0.113.1:4002").without_key().send().await.refused(429, "too_many_requests");
    ask("203.0.113.1:4002").key("surefoot_guess").send().await.refused(429, "too_many_requests");
    app.get("/openapi.json").from("203.0.113.1:1").without_key().send().await.refused(429, "too_many_requests");
    for _ in 0..50 {
        app.get("/health/live").from("203.0.113.1:1").without_key().send().await.expect(StatusCode::OK);
    }
    // Neither another address nor a valid key at the same one has to do with it.
    ask("203.0.113.2:4000").without_key().send().await.refused(401, "unauthenticated");
    ask("203.0.113.1:4000").send().await.expect(StatusCode::OK);
}

#[tokio::test]
async fn an_address_is_taken_from_a_trusted_proxy_only() {
    let trusted_proxies = vec!["10.0.0.1".to_owned().try_into().unwrap()];
    let app = TestApp::with_config(Config { trusted_proxies, ..limits(0, 1) }).await;
    let ask = async |from: &str, said: &str| {
        app.get("/v1/patients").from(from).header("x-forwarded-for", said).without_key().send().await.status.as_u16()
    };
    assert_eq!(ask("10.0.0.1:1", "203.0.113.1").await, 401);
    assert_eq!(ask("10.0.0.1:1", "203.0.113.1").await, 429);
    assert_eq!(ask("10.0.0.1:1", "203.0.113.2").await, 401);
    // Inventing what stands before does not help, nor does inventing all of it without the proxy.
    assert_eq!(ask("10.0.0.1:1", "192.0.2.7, 203.0.113.2").await, 429);
    assert_eq!(ask("198.51.100.1:1", "203.0.113.3").await, 401);
    assert_eq!(ask("198.51.100.1:1", "203.0.113.4").await, 429);
}

#[tokio::test]
async fn browsers_are_told_to_come_by_tls_where_the_operator_has_it() {
    let app = TestApp::with_config(Config { behind_tls: true, ..Config::default() }).await;
    for path in ["/health/live", "/nowhere", "/v1/patients"] {
        assert_eq!(app.get(path).send().await.header("strict-transport-security"), "max-age=31536000", "{path}");
    }
    let app = TestApp::new().await;
    assert_eq!(app.get("/health/live").send().await.header("strict-transport-security"), "");
}
