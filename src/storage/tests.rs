//! The questions, asked of a real database.

use super::*;
use crate::recording::Header;
use crate::recording::decode::{Format, Inspection};
use tempfile::TempDir;
use time::macros::datetime;

/// A store with one organisation, an admin and a device in it, and one session of the admin's.
pub(super) struct Clinic {
    pub(super) dir: TempDir,
    places: Places,
    pub(super) clock: ManualClock,
    pub(super) store: Store,
    pub(super) admin: Access,
    pub(super) device: Access,
    pub(super) patient: PatientId,
    pub(super) session: SessionId,
}

impl Clinic {
    pub(super) async fn open() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let clock = ManualClock::at(datetime!(2026-11-22 08:00 UTC));
        let places = empty_places(dir.path()).await;
        let store = Store::open_at(&places, Arc::new(clock.clone())).await.unwrap();
        let organisation = store.create_organisation("clinic").await.unwrap().id;
        let admin = store.create_client(organisation, Role::Admin, "admin").await.unwrap().0.access();
        let device = store.create_client(organisation, Role::Device, "camera").await.unwrap().0.access();
        let patient = store.create_patient(&admin, &new_patient("P-1")).await.unwrap().id;
        let session = store.create_session(&admin, &new_session(patient)).await.unwrap().id;
        Self { dir, places, clock, store, admin, device, patient, session }
    }

    /// The same store as another process opens it.
    pub(super) async fn reopen(&self) -> Store {
        Store::open_at(&self.places, Arc::new(self.clock.clone())).await.unwrap()
    }

    /// True where a test that looks into SQLite's file has nothing to look into.
    pub(super) fn rows_are_elsewhere(&self) -> bool {
        let elsewhere = self.places.database_url.is_some();
        if elsewhere {
            println!("skipped: the rows are in PostgreSQL, and this test looks into SQLite's file");
        }
        elsewhere
    }

    /// Stores a recording as the upload does, without a job.
    pub(super) async fn insert_recording(
        &self,
        access: &Access,
        session: SessionId,
    ) -> Result<StoredRecording, StorageError> {
        let new = new_recording(&self.store, session).await;
        let mut transaction = self.store.begin().await?;
        let recording = recordings::insert(&mut transaction, access, &new, self.store.now()).await?;
        transaction.commit().await?;
        Ok(recording)
    }

    async fn stranger(&self) -> Access {
        let organisation = self.store.create_organisation("elsewhere").await.unwrap().id;
        self.store.create_client(organisation, Role::Admin, "stranger").await.unwrap().0.access()
    }
}

/// An empty place: a directory, and, where the variable `SUREFOOT_TEST_POSTGRES` names a server, a new database there.
async fn empty_places(dir: &Path) -> Places {
    let mut places = Places::in_directory(dir);
    if cfg!(feature = "scaleout")
        && let Ok(server) = std::env::var("SUREFOOT_TEST_POSTGRES")
    {
        places.database_url = Some(new_postgres_database(&server).await);
    }
    places
}

#[cfg(feature = "scaleout")]
async fn new_postgres_database(server: &str) -> String {
    use sqlx::{Connection, Executor};

    let name = format!("surefoot_test_{}", uuid::Uuid::now_v7().simple());
    let mut connection = sqlx::PgConnection::connect(server).await.unwrap();
    connection.execute(sqlx::AssertSqlSafe(format!("CREATE DATABASE {name}"))).await.unwrap();
    let (address, _) = server.rsplit_once('/').unwrap();
    format!("{address}/{name}")
}

#[cfg(not(feature = "scaleout"))]
async fn new_postgres_database(_: &str) -> String {
    unreachable!("asked for with the feature alone")
}

fn new_patient(pseudonym: &str) -> NewPatient {
    NewPatient { pseudonym: pseudonym.into(), ..NewPatient::default() }
}

fn new_session(patient_id: PatientId) -> NewSession {
    let started_at = datetime!(2026-11-22 07:00:00.123 UTC);
    NewSession { patient_id, started_at, protocol: Some("sit_front_knee".into()), notes: None, noise_model: None }
}

pub(super) async fn new_recording(store: &Store, session_id: SessionId) -> NewRecording {
    let mut writer = store.blobs().writer().await.unwrap();
    writer.write("recording".into()).await.unwrap();
    let blob = writer.seal().await.unwrap().keep().await.unwrap();
    let inspection = Inspection {
        format: Format::Json,
        header: Header { protocol: Some("sit_front_knee".into()), ..Header::default() },
        n_frames: 600,
        duration_s: 19.97,
        joints: vec![crate::body::Joint::Head],
        has_orientations: false,
        inertial_units: vec![],
        depth: None,
        reference_channels: vec![],
        ignored_channels: vec![],
    };
    NewRecording { session_id, blob, inspection }
}

fn is_absent<T: std::fmt::Debug>(answer: Result<T, StorageError>, what: &str) {
    assert!(matches!(&answer, Err(StorageError::NotFound { what: w }) if *w == what), "{what}: {answer:?}");
}

#[tokio::test]
async fn a_store_opens_again_with_what_was_committed() {
    let clinic = Clinic::open().await;
    clinic.store.close().await;
    let store = clinic.reopen().await;
    store.check_ready().await.unwrap();
    assert_eq!(store.session(&clinic.admin, clinic.session).await.unwrap().patient_id, clinic.patient);
}

#[tokio::test]
async fn a_schema_that_a_newer_version_extended_is_used_while_it_reaches_back_and_refused_after() {
    let clinic = Clinic::open().await;
    let mut transaction = clinic.store.begin().await.unwrap();
    query("ALTER TABLE sessions ADD COLUMN colour TEXT NOT NULL DEFAULT 'none'")
        .execute(&mut transaction)
        .await
        .unwrap();
    query(
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'later', TRUE, $1, 0)",
    )
    .bind(&[0u8; 48][..])
    .execute(&mut transaction)
    .await
    .unwrap();
    transaction.commit().await.unwrap();
    let store = clinic.reopen().await;
    store.create_session(&clinic.admin, &new_session(clinic.patient)).await.unwrap();

    let mut transaction = store.begin().await.unwrap();
    query("UPDATE schema_reach SET oldest_migration = 9999").execute(&mut transaction).await.unwrap();
    transaction.commit().await.unwrap();
    let refused = Store::open_at(&clinic.places, Arc::new(clinic.clock.clone())).await;
    assert!(matches!(refused, Err(StorageError::Conflict { code: "schema_too_new", .. })), "{refused:?}");
}

#[tokio::test]
async fn the_first_start_makes_one_admin_and_shows_the_key_once() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path()).await.unwrap();
    let key = store.ensure_first_admin().await.unwrap().unwrap();
    assert_eq!(store.ensure_first_admin().await.unwrap(), None);
    let client = store.client_of_key(&key).await.unwrap().unwrap();
    assert_eq!((client.role, client.access().own_sessions_only), (Role::Admin, false));
    let again = ApiKey::from_text(key.reveal());
    assert_eq!(store.client_of_key(&again).await.unwrap().map(|c| c.id), Some(client.id));
    assert!(!format!("{key:?}").contains(&key.reveal()[9..]));
}

#[tokio::test]
async fn an_unknown_or_revoked_key_is_nobodys() {
    let clinic = Clinic::open().await;
    let organisation = clinic.admin.organisation;
    let (client, key) = clinic.store.create_client(organisation, Role::Clinician, "ward 3").await.unwrap();
    assert_eq!(clinic.store.client_of_key(&ApiKey::from_text("surefoot_00")).await.unwrap(), None);
    let stranger = clinic.stranger().await;
    is_absent(clinic.store.revoke_client(stranger.organisation, client.id).await, "client");
    assert!(clinic.store.client_of_key(&key).await.unwrap().is_some());
    let revoked = clinic.store.revoke_client(organisation, client.id).await.unwrap();
    clinic.clock.advance(time::Duration::HOUR);
    assert_eq!(clinic.store.revoke_client(organisation, client.id).await.unwrap().revoked_at, revoked.revoked_at);
    assert_eq!(clinic.store.client_of_key(&key).await.unwrap(), None);
    assert_eq!(clinic.store.clients(organisation).await.unwrap().len(), 3);
}

#[tokio::test]
async fn the_last_use_of_a_key_is_kept_to_the_minute() {
    let clinic = Clinic::open().await;
    let (client, key) = clinic.store.create_client(clinic.admin.organisation, Role::Device, "x").await.unwrap();
    let last_use = async || {
        let clients = clinic.store.clients(clinic.admin.organisation).await.unwrap();
        clients.into_iter().find(|c| c.id == client.id).unwrap().last_used_at
    };
    assert_eq!(last_use().await, None);
    clinic.store.client_of_key(&key).await.unwrap();
    assert_eq!(last_use().await, Some(clinic.store.now()));
    clinic.clock.advance(time::Duration::seconds(59));
    clinic.store.client_of_key(&key).await.unwrap();
    assert_eq!(last_use().await, Some(clinic.store.now() - time::Duration::seconds(59)));
    clinic.clock.advance(time::Duration::seconds(1));
    clinic.store.client_of_key(&key).await.unwrap();
    assert_eq!(last_use().await, Some(clinic.store.now()));
}

#[tokio::test]
async fn a_patient_comes_back_as_it_was_made_and_its_pseudonym_is_taken() {
    let clinic = Clinic::open().await;
    let new = NewPatient {
        pseudonym: "Ä-17".into(),
        birth_year: Some(1941),
        sex: Some(Sex::Female),
        height_m: Some(1.62),
        uses_walking_aid: Some(true),
    };
    let made = clinic.store.create_patient(&clinic.admin, &new).await.unwrap();
    assert_eq!(clinic.store.patient(&clinic.admin, made.id).await.unwrap(), made);
    assert_eq!((made.birth_year, made.sex, made.uses_walking_aid), (Some(1941), Some(Sex::Female), Some(true)));
    let taken = clinic.store.create_patient(&clinic.admin, &new).await;
    assert!(matches!(taken, Err(StorageError::Conflict { code: "pseudonym_taken", .. })), "{taken:?}");
    clinic.store.create_patient(&clinic.stranger().await, &new).await.unwrap();
}

#[tokio::test]
async fn patients_are_paged_newest_first_and_found_by_the_beginning_of_their_pseudonym() {
    let clinic = Clinic::open().await;
    for number in 2..=7 {
        let pseudonym = format!("{}-{number}", if number % 2 == 0 { "50%_" } else { "P" });
        clinic.store.create_patient(&clinic.admin, &new_patient(&pseudonym)).await.unwrap();
    }
    let all = PatientFilter::default();
    let (mut seen, mut page) = (Vec::new(), PageRequest::first(3));
    loop {
        let found = clinic.store.patients(&clinic.admin, &all, &page).await.unwrap();
        seen.extend(found.items.into_iter().map(|p| p.pseudonym));
        page.after = found.next;
        if page.after.is_none() {
            break;
        }
    }
    assert_eq!(seen, ["P-7", "50%_-6", "P-5", "50%_-4", "P-3", "50%_-2", "P-1"]);
    let prefixed = PatientFilter { pseudonym_prefix: Some("50%_".into()), ..PatientFilter::default() };
    let found = clinic.store.patients(&clinic.admin, &prefixed, &PageRequest::first(9)).await.unwrap();
    assert_eq!((found.items.len(), found.next), (3, None));
}

#[tokio::test]
async fn sessions_are_found_by_patient_time_and_protocol() {
    let clinic = Clinic::open().await;
    let other = clinic.store.create_patient(&clinic.admin, &new_patient("P-2")).await.unwrap().id;
    let later =
        NewSession { started_at: datetime!(2026-11-23 07:00 UTC), protocol: Some("walk".into()), ..new_session(other) };
    let later = clinic.store.create_session(&clinic.admin, &later).await.unwrap();
    let first = clinic.store.session(&clinic.admin, clinic.session).await.unwrap();
    assert_eq!(first.started_at, datetime!(2026-11-22 07:00:00.123 UTC));
    let list = async |filter: SessionFilter| {
        let page = clinic.store.sessions(&clinic.admin, &filter, &PageRequest::first(9)).await.unwrap();
        page.items.into_iter().map(|s| s.id).collect::<Vec<_>>()
    };
    let all = SessionFilter::default;
    assert_eq!(list(all()).await, [later.id, first.id]);
    assert_eq!(list(SessionFilter { patient_id: Some(other), ..all() }).await, [later.id]);
    assert_eq!(list(SessionFilter { protocol: Some("walk".into()), ..all() }).await, [later.id]);
    assert_eq!(list(SessionFilter { started_from: Some(later.started_at), ..all() }).await, [later.id]);
    assert_eq!(list(SessionFilter { started_before: Some(later.started_at), ..all() }).await, [first.id]);
}

#[tokio::test]
async fn nothing_of_another_organisation_exists() {
    let clinic = Clinic::open().await;
    let (store, stranger) = (&clinic.store, clinic.stranger().await);
    let recording = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
    is_absent(store.patient(&stranger, clinic.patient).await, "patient");
    is_absent(store.create_session(&stranger, &new_session(clinic.patient)).await, "patient");
    is_absent(store.session(&stranger, clinic.session).await, "session");
    is_absent(clinic.insert_recording(&stranger, clinic.session).await, "session");
    is_absent(store.recording(&stranger, recording.id).await, "recording");
    assert!(store.patients(&stranger, &Default::default(), &PageRequest::first(9)).await.unwrap().items.is_empty());
    assert!(store.sessions(&stranger, &Default::default(), &PageRequest::first(9)).await.unwrap().items.is_empty());
    assert!(store.recordings(&stranger, &Default::default(), &PageRequest::first(9)).await.unwrap().items.is_empty());
    let of_session = RecordingFilter { session_id: Some(clinic.session), ..RecordingFilter::default() };
    assert!(store.recordings(&stranger, &of_session, &PageRequest::first(9)).await.unwrap().items.is_empty());
}

#[tokio::test]
async fn a_device_sees_its_own_sessions_and_what_hangs_on_them_only() {
    let clinic = Clinic::open().await;
    let store = &clinic.store;
    let theirs = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
    is_absent(store.session(&clinic.device, clinic.session).await, "session");
    is_absent(clinic.insert_recording(&clinic.device, clinic.session).await, "session");
    is_absent(store.recording(&clinic.device, theirs.id).await, "recording");

    let own = store.create_session(&clinic.device, &new_session(clinic.patient)).await.unwrap().id;
    let recording = clinic.insert_recording(&clinic.device, own).await.unwrap();
    for access in [&clinic.device, &clinic.admin] {
        assert_eq!(store.recording(access, recording.id).await.unwrap(), recording);
    }
    let sessions = store.sessions(&clinic.device, &Default::default(), &PageRequest::first(9)).await.unwrap();
    assert_eq!(sessions.items.iter().map(|s| s.id).collect::<Vec<_>>(), [own]);
    let list = async |access: &Access, filter: RecordingFilter| {
        let page = store.recordings(access, &filter, &PageRequest::first(9)).await.unwrap();
        page.items.into_iter().map(|r| r.id).collect::<Vec<_>>()
    };
    let all = RecordingFilter::default();
    assert_eq!(list(&clinic.device, all).await, [recording.id]);
    assert_eq!(list(&clinic.admin, all).await, [recording.id, theirs.id]);
    assert_eq!(list(&clinic.admin, RecordingFilter { session_id: Some(own), ..all }).await, [recording.id]);
    let of_patient = RecordingFilter { patient_id: Some(clinic.patient), ..all };
    assert_eq!(list(&clinic.admin, of_patient).await, [recording.id, theirs.id]);
}
