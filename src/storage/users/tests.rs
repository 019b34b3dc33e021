//! Users, asked of a real database.

use super::*;
use crate::storage::tests::Clinic;
use std::net::IpAddr;
use time::Duration;

const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

fn lee() -> NewUser {
    NewUser { name: "lee".into(), role: Role::Clinician, label: "Dr Lee".into() }
}

fn is_conflict<T: std::fmt::Debug>(answer: Result<T, StorageError>, code: &str) {
    assert!(matches!(&answer, Err(StorageError::Conflict { code: c, .. }) if *c == code), "{code}: {answer:?}");
}

#[tokio::test]
async fn a_user_signs_in_with_the_password_and_names_are_not_case_sensitive() {
    let clinic = Clinic::open().await;
    let (user, password) = clinic.store.create_user(clinic.admin.organisation, &lee()).await.unwrap();
    assert!(user.must_change_password && user.client.role == Role::Clinician);
    let SignIn::Welcome(welcomed) = clinic.store.sign_in(" Lee ", &password, HERE).await.unwrap() else {
        panic!("name and password are right")
    };
    assert_eq!(welcomed.client.id, user.client.id);
    let wrong = Password::from_text("not the password");
    assert_eq!(clinic.store.sign_in("lee", &wrong, HERE).await.unwrap(), SignIn::Refused);
    assert_eq!(clinic.store.sign_in("nobody", &password, HERE).await.unwrap(), SignIn::Refused);
    is_conflict(clinic.store.create_user(clinic.admin.organisation, &lee()).await, "user_name_taken");
    // A user is no holder of a key, and the list of those does not show one.
    let clients = clinic.store.clients(clinic.admin.organisation).await.unwrap();
    assert!(clients.iter().all(|client| client.id != user.client.id));
    let revoked = clinic.store.revoke_client(clinic.admin.organisation, user.client.id).await;
    assert!(matches!(revoked, Err(StorageError::NotFound { .. })));
}

#[tokio::test]
async fn a_reset_and_a_disabling_end_sessions_at_once() {
    let clinic = Clinic::open().await;
    let organisation = clinic.admin.organisation;
    let (user, first) = clinic.store.create_user(organisation, &lee()).await.unwrap();
    let id = user.client.id;
    clinic.store.set_password(id, &Password::from_text("a quiet garden path"), false).await.unwrap();
    assert_eq!(clinic.store.sign_in("lee", &first, HERE).await.unwrap(), SignIn::Refused);
    let token = clinic.store.begin_page_session(id).await.unwrap();
    assert!(clinic.store.client_of_page_session(&token).await.unwrap().is_some());

    let (_, second) = clinic.store.reset_user(organisation, id).await.unwrap();
    assert!(clinic.store.client_of_page_session(&token).await.unwrap().is_none());
    assert!(matches!(clinic.store.sign_in("lee", &second, HERE).await.unwrap(), SignIn::Welcome(_)));
    // Until the password is changed, a session is good for nothing but the change.
    let token = clinic.store.begin_page_session(id).await.unwrap();
    assert!(clinic.store.client_of_page_session(&token).await.unwrap().is_none());
    assert!(clinic.store.user_of_page_session(&token).await.unwrap().is_some());

    clinic.store.disable_user(organisation, id).await.unwrap();
    assert!(clinic.store.user_of_page_session(&token).await.unwrap().is_none());
    assert_eq!(clinic.store.sign_in("lee", &second, HERE).await.unwrap(), SignIn::Refused);
    is_conflict(clinic.store.reset_user(organisation, id).await, "user_disabled");
    assert_eq!(clinic.store.users(organisation).await.unwrap().len(), 1);
}

#[tokio::test]
async fn failures_lock_a_name_whether_it_is_somebodys_or_not() {
    let clinic = Clinic::open().await;
    let (_, password) = clinic.store.create_user(clinic.admin.organisation, &lee()).await.unwrap();
    let wrong = Password::from_text("not the password");
    for name in ["lee", "nobody"] {
        for _ in 0..6 {
            assert_eq!(clinic.store.sign_in(name, &wrong, HERE).await.unwrap(), SignIn::Refused, "{name}");
        }
        let wait = SignIn::Wait(Duration::seconds(30));
        assert_eq!(clinic.store.sign_in(name, &password, HERE).await.unwrap(), wait, "{name}");
    }
    clinic.clock.advance(Duration::seconds(30));
    assert!(matches!(clinic.store.sign_in("lee", &password, HERE).await.unwrap(), SignIn::Welcome(_)));
}

#[tokio::test]
async fn a_token_makes_its_user_known_once_and_its_role_follows() {
    let clinic = Clinic::open().await;
    let mut provided = Provided {
        issuer: "https://id.example".into(),
        subject: "42".into(),
        organisation: "clinic".into(),
        role: Role::Clinician,
        label: "Dr Kim".into(),
    };
    let first = clinic.store.user_of_token(&provided).await.unwrap().unwrap();
    assert_eq!((first.organisation_id, first.role), (clinic.admin.organisation, Role::Clinician));
    provided.role = Role::Admin;
    let again = clinic.store.user_of_token(&provided).await.unwrap().unwrap();
    assert_eq!((again.id, again.role), (first.id, Role::Admin));
    let foreign = Provided { organisation: "nowhere".into(), ..provided.clone() };
    assert_eq!(clinic.store.user_of_token(&foreign).await.unwrap(), None);
    is_conflict(clinic.store.reset_user(clinic.admin.organisation, first.id).await, "user_without_password");
    clinic.store.disable_user(clinic.admin.organisation, first.id).await.unwrap();
    assert_eq!(clinic.store.user_of_token(&provided).await.unwrap(), None);
}
