//! The log on a real database, tampered with by the side door.

use super::*;
use crate::storage::database::query;
use crate::storage::tests::Clinic;
use crate::storage::{StorageError, Store};
use sqlx::{ConnectOptions, Connection};
use time::Duration;

fn event(store: &Store, clinic: &Clinic, action: &str) -> AuditEvent {
    let actor = Actor {
        kind: ActorKind::Client,
        id: Some(clinic.admin.client.0),
        role: "admin",
        organisation: Some(clinic.admin.organisation),
    };
    AuditEvent {
        happened_at: store.now(),
        actor,
        action: action.to_owned(),
        thing: Some(Thing { kind: ThingKind::Session, id: clinic.session.0 }),
        made: None,
        status: 200,
        request_id: "request-1".into(),
        detail: String::new(),
    }
}

async fn with_entries(n: usize) -> Clinic {
    let clinic = Clinic::open().await;
    for i in 0..n {
        let event = event(&clinic.store, &clinic, &format!("GET /{i}"));
        clinic.store.audit(&[event]).await.unwrap();
        clinic.clock.advance(Duration::days(1));
    }
    clinic
}

/// Does what no program of this project does.
async fn tamper(clinic: &Clinic, statements: &[&'static str]) {
    let file = clinic.dir.path().join("surefoot.sqlite");
    let mut connection = sqlx::sqlite::SqliteConnectOptions::new().filename(file).connect().await.unwrap();
    for statement in statements {
        sqlx::query(*statement).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
}

async fn first_broken(clinic: &Clinic) -> Option<i64> {
    clinic.store.verify_audit(None).await.unwrap().broken.map(|broken| broken.sequence)
}

const UNLOCK: [&str; 2] = ["DROP TRIGGER audit_entries_do_not_change", "DROP TRIGGER audit_entries_stay"];

#[tokio::test]
async fn an_entry_knows_the_patient_of_its_thing_and_holds_no_id() {
    let clinic = with_entries(2).await;
    let filter = AuditFilter { patient: Some(clinic.patient), ..AuditFilter::default() };
    let found = clinic.store.audit_entries(clinic.admin.organisation, &filter, None, 50).await.unwrap();
    assert_eq!(
        found.iter().map(|e| (e.sequence, e.action.as_str())).collect::<Vec<_>>(),
        [(2, "GET /1"), (1, "GET /0")]
    );
    let thing = found[0].thing.as_ref().unwrap();
    assert_eq!((thing.kind.as_str(), thing.id), ("session", Some(clinic.session.0)));
    assert_eq!(found[0].patient.as_ref().unwrap().id, None, "the patient itself was not acted on");
    let elsewhere = clinic.store.audit_entries(OrganisationId::new(), &filter, None, 50).await.unwrap();
    assert_eq!(elsewhere, []);
}

#[tokio::test]
async fn a_whole_chain_is_told_from_one_that_was_changed_removed_or_cut() {
    let clinic = with_entries(5).await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    let whole = clinic.store.verify_audit(None).await.unwrap();
    assert_eq!((whole.n_entries, whole.head_sequence, &whole.broken), (5, 5, &None));
    tamper(&clinic, &UNLOCK).await;
    tamper(&clinic, &["UPDATE audit_entries SET status = 404 WHERE sequence = 3"]).await;
    assert_eq!(first_broken(&clinic).await, Some(3));
    tamper(&clinic, &["UPDATE audit_entries SET status = 200 WHERE sequence = 3"]).await;
    assert_eq!(first_broken(&clinic).await, None);
    tamper(&clinic, &["DELETE FROM audit_entries WHERE sequence = 5"]).await;
    assert_eq!(first_broken(&clinic).await, Some(5));
    tamper(&clinic, &["DELETE FROM audit_entries WHERE sequence = 2"]).await;
    assert_eq!(first_broken(&clinic).await, Some(2));
}

#[tokio::test]
async fn a_head_that_was_noted_finds_a_chain_that_was_written_anew() {
    let clinic = with_entries(3).await;
    let noted = clinic.store.verify_audit(None).await.unwrap();
    let hash = Hash::from_bytes(&hex::decode(&noted.head_hash).unwrap()).unwrap();
    clinic.store.audit(&[event(&clinic.store, &clinic, "GET /more")]).await.unwrap();
    assert_eq!(clinic.store.verify_audit(Some((3, hash))).await.unwrap().broken, None);
    let other = clinic.store.verify_audit(Some((2, hash))).await.unwrap().broken.unwrap();
    assert_eq!(other.sequence, 2);
    assert!(clinic.store.verify_audit(Some((9, hash))).await.unwrap().broken.is_some());
}

#[tokio::test]
async fn entries_cannot_be_changed_or_removed_and_anchors_neither() {
    let clinic = with_entries(2).await;
    for statement in [
        "UPDATE audit_entries SET status = 1",
        "DELETE FROM audit_entries",
        "DELETE FROM audit_entries WHERE sequence = 2",
    ] {
        let mut transaction = clinic.store.begin().await.unwrap();
        let refused = query(statement).execute(&mut transaction).await;
        assert!(refused.unwrap_err().to_string().contains("append-only"), "{statement}");
    }
}

#[tokio::test]
async fn retention_removes_the_old_end_and_the_chain_holds_from_its_anchor_on() {
    let clinic = with_entries(5).await;
    if clinic.rows_are_elsewhere() {
        return;
    }
    let limit = clinic.store.now() - Duration::days(2) - Duration::hours(1);
    assert_eq!(clinic.store.count_audit_before(limit).await.unwrap(), 3);
    assert_eq!(clinic.store.remove_audit_before(limit, Actor::operator(None)).await.unwrap(), 3);
    assert_eq!(clinic.store.remove_audit_before(limit, Actor::operator(None)).await.unwrap(), 0);
    let after = clinic.store.verify_audit(None).await.unwrap();
    assert_eq!((after.n_entries, after.begins_after, after.head_sequence, &after.broken), (3, 3, 6, &None));
    let mut transaction = clinic.store.begin().await.unwrap();
    assert!(query("DELETE FROM audit_anchors").execute(&mut transaction).await.is_err());
    drop(transaction);
    tamper(&clinic, &["DROP TRIGGER audit_anchors_stay", "DELETE FROM audit_anchors"]).await;
    assert_eq!(first_broken(&clinic).await, Some(1), "without its anchor the old end is missing");
}

#[tokio::test]
async fn the_trail_writes_reads_together_and_a_change_before_it_returns() {
    let clinic = Clinic::open().await;
    let trail = AuditTrail::start(clinic.store.clone());
    for i in 0..1000 {
        trail.note(event(&clinic.store, &clinic, &format!("GET /{i}"))).await;
    }
    assert!(trail.enter(event(&clinic.store, &clinic, "POST /x")).await);
    let all = clinic.store.verify_audit(None).await.unwrap();
    assert_eq!((all.n_entries, all.broken), (1001, None));
    clinic.store.close().await;
    assert!(
        !trail.enter(event(&clinic.store, &clinic, "POST /y")).await,
        "a change without its entry is not acknowledged"
    );
}

#[tokio::test]
async fn two_processes_write_one_chain() {
    let clinic = Clinic::open().await;
    let other = clinic.reopen().await;
    let write = async |store: &Store| -> Result<(), StorageError> {
        for _ in 0..20 {
            store.audit(&[event(store, &clinic, "GET /")]).await?;
        }
        Ok(())
    };
    let (one, two) = tokio::join!(write(&clinic.store), write(&other));
    one.and(two).unwrap();
    let all = clinic.store.verify_audit(None).await.unwrap();
    assert_eq!((all.n_entries, all.broken), (40, None));
}
