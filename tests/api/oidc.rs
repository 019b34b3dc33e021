//! Tokens of an identity provider that runs in the test: what counts, what does not, and how often it is asked for its keys.

use crate::support::{TestApp, text};
use axum::http::{Method, StatusCode};
use axum::routing::get;
use axum::{Json, Router};
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use jsonwebtoken::jwk::Jwk;
use jsonwebtoken::{Algorithm, EncodingKey, Header, encode};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use surefoot::config::{Config, OidcAlgorithm, OidcConfig};
use surefoot::storage::Role;

const AUDIENCE: &str = "surefoot";

fn es256() -> EncodingKey {
    EncodingKey::from_ec_pem(include_bytes!("keys/es256.pem")).unwrap()
}

fn other_es256() -> EncodingKey {
    EncodingKey::from_ec_pem(include_bytes!("keys/other_es256.pem")).unwrap()
}

fn rs256() -> EncodingKey {
    EncodingKey::from_rsa_pem(include_bytes!("keys/rs256.pem")).unwrap()
}

fn jwk(key: &EncodingKey, algorithm: Algorithm, id: &str) -> Value {
    let mut jwk = Jwk::from_encoding_key(key, algorithm).unwrap();
    jwk.common.key_id = Some(id.to_owned());
    serde_json::to_value(jwk).unwrap()
}

/// An issuer on a port of its own.
struct Provider {
    issuer: String,
    /// What it answers for its keys.
    keys: Arc<Mutex<Value>>,
    asked: Arc<AtomicUsize>,
}

impl Provider {
    async fn start() -> Self {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let issuer = format!("http://{}/realm", listener.local_addr().unwrap());
        let both = [jwk(&es256(), Algorithm::ES256, "es"), jwk(&rs256(), Algorithm::RS256, "rs")];
        let keys = Arc::new(Mutex::new(json!({"keys": both})));
        let asked = Arc::new(AtomicUsize::new(0));
        let description = json!({"issuer": issuer, "jwks_uri": format!("{issuer}/keys")});
        let (told, count) = (keys.clone(), asked.clone());
        let router = Router::new()
            .route("/realm/.well-known/openid-configuration", get(move || async move { Json(description) }))
            .route(
                "/realm/keys",
                get(move || async move {
                    count.fetch_add(1, Ordering::SeqCst);
                    Json(told.lock().unwrap().clone())
                }),
            );
        tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
        Self { issuer, keys, asked }
    }

    fn config(&self) -> Config {
        let oidc = OidcConfig { issuer: self.issuer.clone(), audience: AUDIENCE.to_owned(), ..OidcConfig::default() };
        Config { oidc, ..Config::default() }
    }

    async fn app(&self) -> TestApp {
        TestApp::with_config(self.config()).await
    }

    /// Claims of a clinician of the first organisation.
    fn claims(&self) -> Value {
        let now = time::OffsetDateTime::now_utc().unix_timestamp();
        json!({"iss": self.issuer, "aud": AUDIENCE, "sub": "42", "exp": now + 300, "iat": now, "roles": ["clinician"],
               "organisation": "default", "name": "Dr Kim"})
    }

    fn token(&self, change: Value) -> String {
        let mut claims = self.claims();
        for (name, value) in change.as_object().unwrap() {
            match value {
                Value::Null => drop(claims.as_object_mut().unwrap().remove(name)),
                value => claims[name] = value.clone(),
            }
        }
        signed(&claims, &es256(), Algorithm::ES256, Some("es"))
    }
}

fn signed(claims: &Value, key: &EncodingKey, algorithm: Algorithm, id: Option<&str>) -> String {
    let header = Header { kid: id.map(str::to_owned), ..Header::new(algorithm) };
    encode(&header, claims, key).unwrap()
}

#[tokio::test]
async fn a_token_makes_its_user_known_who_does_what_the_role_allows() {
    let provider = Provider::start().await;
    let app = provider.app().await;
    let token = provider.token(json!({}));
    let made = app.post("/v1/patients").key(&token).json(&json!({"pseudonym": "P-1"})).send().await;
    made.expect(StatusCode::CREATED);
    app.get("/v1/clients").key(&token).send().await.refused(403, "forbidden");
    let me = app.get("/v1/me").key(&token).send().await.expect(StatusCode::OK);
    assert_eq!((&me["label"], &me["role"]), (&json!("Dr Kim"), &json!("clinician")));
    // The same person again, now an administrator, by the other algorithm.
    let mut claims = provider.claims();
    claims["roles"] = json!("admin");
    let token = signed(&claims, &rs256(), Algorithm::RS256, Some("rs"));
    let users = app.get("/v1/users").key(&token).send().await.expect(StatusCode::OK);
    assert_eq!(users["items"].as_array().unwrap().len(), 1);
    assert_eq!((&users["items"][0]["id"], &users["items"][0]["role"]), (&me["id"], &json!("admin")));
    assert_eq!((&users["items"][0]["subject"], &users["items"][0]["name"]), (&json!("42"), &Value::Null));
    // One fetch of keys served all of it, and API keys still open.
    assert_eq!(provider.asked.load(Ordering::SeqCst), 1);
    app.get("/v1/patients").send().await.expect(StatusCode::OK);

    let path = format!("/v1/users/{}", text(&me["id"]));
    app.request(Method::DELETE, &path).send().await.expect(StatusCode::OK);
    app.get("/v1/patients").key(&token).send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn a_token_that_does_not_count_is_refused_with_the_reason() {
    let provider = Provider::start().await;
    let app = provider.app().await;
    let now = time::OffsetDateTime::now_utc().unix_timestamp();
    let refused = async |token: String, why: &str| {
        let problem = app.get("/v1/patients").key(&token).send().await.refused(401, "unauthenticated");
        assert!(text(&problem["detail"]).contains(why), "{why}: {problem:#}");
    };
    refused(provider.token(json!({"exp": now - 61})), "has expired").await;
    refused(provider.token(json!({"nbf": now + 120})), "not valid yet").await;
    refused(provider.token(json!({"aud": "another"})), "another service").await;
    refused(provider.token(json!({"iss": "https://elsewhere.example"})), "another issuer").await;
    for claim in ["exp", "aud", "iss", "sub"] {
        refused(provider.token(json!({claim: null})), "token").await;
    }
    refused(provider.token(json!({"organisation": "nowhere"})), "organisation is not known").await;
    // Signed by somebody else under the issuer's name for its key, and by a key that the issuer does not have.
    let claims = provider.claims();
    refused(signed(&claims, &other_es256(), Algorithm::ES256, Some("es")), "signature").await;
    refused(signed(&claims, &other_es256(), Algorithm::ES256, Some("new")), "not signed with a key").await;
    // The public key as a shared secret, no signature at all, a key of the other kind, an algorithm that is not pinned.
    let public = provider.keys.lock().unwrap().to_string();
    let secret = EncodingKey::from_secret(public.as_bytes());
    refused(signed(&claims, &secret, Algorithm::HS256, Some("es")), "algorithm").await;
    let none = URL_SAFE_NO_PAD.encode(r#"{"alg":"none","typ":"JWT"}"#);
    refused(format!("{none}.{}.", URL_SAFE_NO_PAD.encode(claims.to_string())), "cannot be read").await;
    refused(signed(&claims, &rs256(), Algorithm::RS256, Some("es")), "not signed with a key").await;
    refused(signed(&claims, &rs256(), Algorithm::RS512, Some("rs")), "algorithm").await;
    let changed = provider.token(json!({}));
    let [head, _, signature] = changed.split('.').collect::<Vec<_>>().try_into().unwrap();
    let mut admin = claims.clone();
    admin["roles"] = json!("admin");
    refused(format!("{head}.{}.{signature}", URL_SAFE_NO_PAD.encode(admin.to_string())), "signature").await;
    let long = "x".repeat(9000);
    refused(provider.token(json!({"name": long})), "cannot be read").await;
    refused("a.b.c".to_owned(), "cannot be read").await;
    // A good signature without a role opens nothing either.
    for (name, value) in [("roles", json!(["reader"])), ("roles", Value::Null), ("organisation", Value::Null)] {
        let token = provider.token(json!({name: value}));
        app.get("/v1/patients").key(&token).send().await.refused(403, "forbidden");
    }
    // Clocks may differ by a minute.
    app.get("/v1/patients").key(&provider.token(json!({"exp": now - 50}))).send().await.expect(StatusCode::OK);
    app.get("/v1/patients").key(&provider.token(json!({"nbf": now + 50}))).send().await.expect(StatusCode::OK);
}

#[tokio::test]
async fn an_invented_key_id_makes_the_service_ask_at_most_once_a_minute() {
    let provider = Provider::start().await;
    let app = provider.app().await;
    app.get("/v1/patients").key(&provider.token(json!({}))).send().await.expect(StatusCode::OK);
    for id in 0..10 {
        let token = signed(&provider.claims(), &other_es256(), Algorithm::ES256, Some(&format!("new-{id}")));
        app.get("/v1/patients").key(&token).send().await.refused(401, "unauthenticated");
    }
    assert_eq!(provider.asked.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn a_key_that_the_issuer_added_is_found_without_a_restart_and_one_alone_needs_no_name() {
    let provider = Provider::start().await;
    *provider.keys.lock().unwrap() = json!({"keys": [jwk(&other_es256(), Algorithm::ES256, "new")]});
    let app = provider.app().await;
    let claims = provider.claims();
    for id in [Some("new"), None] {
        let token = signed(&claims, &other_es256(), Algorithm::ES256, id);
        app.get("/v1/patients").key(&token).send().await.expect(StatusCode::OK);
    }
    let two = [jwk(&other_es256(), Algorithm::ES256, "new"), jwk(&es256(), Algorithm::ES256, "es")];
    *provider.keys.lock().unwrap() = json!({"keys": two});
    let app = provider.app().await;
    let token = signed(&claims, &other_es256(), Algorithm::ES256, None);
    app.get("/v1/patients").key(&token).send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn without_the_issuers_keys_tokens_wait_and_keys_do_not() {
    let provider = Provider::start().await;
    for keys in [json!({"no": "keys"}), json!({"keys": [], "padding": "x".repeat(300_000)})] {
        *provider.keys.lock().unwrap() = keys;
        let app = provider.app().await;
        app.get("/v1/patients").key(&provider.token(json!({}))).send().await.refused(503, "unavailable");
        app.get("/v1/patients").send().await.expect(StatusCode::OK);
    }
    // Nobody who has no provider takes tokens.
    let app = TestApp::new().await;
    app.get("/v1/patients").key(&provider.token(json!({}))).send().await.refused(401, "unauthenticated");
}

#[tokio::test]
async fn a_user_of_the_provider_receives_shared_patients_like_any_other() {
    let provider = Provider::start().await;
    let app = provider.app().await;
    let patient = app.patient("P-1").await;
    let elsewhere = app.state.store.create_organisation("elsewhere").await.unwrap().id;
    app.key_in(elsewhere, Role::Admin).await;
    let token = provider.token(json!({"organisation": "elsewhere"}));
    let me = app.get("/v1/me").key(&token).send().await.expect(StatusCode::OK);
    let path = format!("/v1/patients/{patient}");
    app.get(&path).key(&token).send().await.refused(404, "not_found");
    let until = time::OffsetDateTime::now_utc() + time::Duration::HOUR;
    let until = until.format(&time::format_description::well_known::Rfc3339).unwrap();
    let share = json!({"receiver_id": me["id"], "expires_at": until});
    app.post(&format!("{path}/shares")).json(&share).send().await.expect(StatusCode::CREATED);
    app.get(&path).key(&token).send().await.expect(StatusCode::OK);
}

#[tokio::test]
async fn settings_that_would_open_the_service_to_others_are_refused() {
    let provider = Provider::start().await;
    let good = provider.config().oidc;
    let refused = |change: &dyn Fn(&mut OidcConfig)| {
        let mut config = good.clone();
        change(&mut config);
        surefoot::api::oidc::Oidc::of(&config).is_err()
    };
    assert!(refused(&|config| config.audience.clear()));
    assert!(refused(&|config| config.algorithms.clear()));
    assert!(refused(&|config| config.issuer = "http://id.example".into()));
    assert!(refused(&|config| config.jwks_uri = "http://id.example/keys".into()));
    assert!(!refused(&|config| config.algorithms = vec![OidcAlgorithm::Es256]));
}
