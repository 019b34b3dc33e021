//! Consent on the report, and pages in the audit log.

use crate::support::{Clinic, text};
use axum::http::StatusCode;
use serde_json::json;
use surefoot::storage::audit::AuditFilter;

#[tokio::test]
async fn the_report_says_how_the_consent_stands() {
    let clinic = Clinic::open().await;
    let patient = clinic.followed_patient("P-1").await;
    let cookie = clinic.cookie_of(&clinic.key).await;
    let page = async || clinic.get(&format!("/app/patients/{patient}"), &cookie).await.body;
    assert!(page().await.contains("<dt>Consent to assessment</dt><dd>not recorded"));
    let consent = json!({"scope": "assessment", "text_version": "1"});
    clinic.made(&format!("/v1/patients/{patient}/consents"), &consent).await;
    assert!(page().await.contains("<dt>Consent to assessment</dt><dd>given</dd>"));
    clinic.made(&format!("/v1/patients/{patient}/consents/withdrawal"), &json!({"scope": "assessment"})).await;
    assert!(page().await.contains("<dt>Consent to assessment</dt><dd>withdrawn"));
}

#[tokio::test]
async fn sign_ins_that_work_or_fail_pages_that_are_read_and_sign_outs_are_entered() {
    let clinic = Clinic::open().await;
    let patient = text(&clinic.made("/v1/patients", &json!({"pseudonym": "P-1"})).await["id"]);
    assert_eq!(clinic.sign_in("surefoot_0000", &[]).await.status, StatusCode::UNAUTHORIZED);
    let cookie = clinic.cookie_of(&clinic.key).await;
    clinic.get(&format!("/app/patients/{patient}"), &cookie).await;
    clinic.get(&format!("/v1/patients/{patient}"), &cookie).await;
    clinic.get("/app/patients", "").await;
    let own = [("cookie", cookie.as_str()), ("sec-fetch-site", "same-origin")];
    clinic.send(axum::http::Method::POST, "/app/sign-out", &own, axum::body::Body::empty()).await;
    assert!(clinic.state.audit.flush().await);
    let organisation = clinic.organisation().await;
    let mut entries = clinic.state.store.audit_entries(organisation, &AuditFilter::default(), None, 50).await.unwrap();
    entries.reverse();
    let told: Vec<_> = entries.iter().map(|entry| (entry.action.as_str(), entry.status)).collect();
    assert_eq!(
        told,
        [
            ("POST /v1/patients", 201),
            ("POST /app/sign-in", 303),
            ("GET /app/patients/{id}", 200),
            ("GET /v1/patients/{id}", 200),
            ("POST /app/sign-out", 303),
        ]
    );
    let all = clinic.state.store.verify_audit(None).await.unwrap();
    assert_eq!((all.n_entries, all.broken), (6, None), "and the sign-in of nobody");
}
