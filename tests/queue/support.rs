//! A store in a temporary directory, a clock that is turned by hand, and computations made to order.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use surefoot::assessment::{Assessment, Provenance, Quality, Series, Settings};
use surefoot::pipeline::Inputs;
use surefoot::progress::Monitor;
use surefoot::queue::{Job, JobState, Queue, QueueSettings};
use surefoot::recording::Header;
use surefoot::recording::decode::{Format, Inspection, Limits};
use surefoot::storage::{
    Access, BlobReader, ConsentScope, JobId, ManualClock, NewConsent, NewPatient, NewRecording, NewSession, PatientId,
    Places, RecordingId, Role, SessionId, Store, StoredRecording,
};
use surefoot::worker::{Assess, AttemptError, Worker};
use tempfile::TempDir;
use time::macros::datetime;
use tokio_util::sync::CancellationToken;

/// So long that no heartbeat comes during a test.
pub const SILENT: Duration = Duration::from_secs(3600);
/// So short that a computation which waits for a request to stop hears it at once.
pub const EAGER: Duration = Duration::from_millis(1);

/// One data directory with one patient's session.
pub struct Bench {
    pub dir: TempDir,
    pub clock: ManualClock,
    pub queue: Queue,
    pub access: Access,
    pub session: SessionId,
    pub patient: PatientId,
}

impl Bench {
    pub async fn new() -> Self {
        let dir = temporary_directory();
        let clock = ManualClock::at(datetime!(2026-11-22 08:00 UTC));
        let queue = open(dir.path(), &clock).await;
        let store = queue.store();
        let organisation = store.create_organisation("clinic").await.unwrap();
        let (client, _) = store.create_client(organisation.id, Role::Admin, "test").await.unwrap();
        let access = client.access();
        let patient = NewPatient { pseudonym: "P-1".into(), ..NewPatient::default() };
        let patient = store.create_patient(&access, &patient).await.unwrap();
        store.record_consent(&access, patient.id, &consent()).await.unwrap();
        let session = NewSession {
            patient_id: patient.id,
            started_at: datetime!(2026-11-22 07:00 UTC),
            protocol: None,
            notes: None,
            noise_model: None,
        };
        let session = store.create_session(&access, &session).await.unwrap().id;
        Self { dir, clock, queue, access, session, patient: patient.id }
    }

    /// Stores a recording of these bytes and its job.
    pub async fn submit(&self, bytes: &'static [u8]) -> Job {
        let new = self.new_recording(bytes).await;
        self.queue.submit(&self.access, &new, &Settings::default()).await.unwrap().1
    }

    /// A recording of these bytes, to be submitted.
    pub async fn new_recording(&self, bytes: &'static [u8]) -> NewRecording {
        let mut writer = self.queue.store().blobs().writer().await.unwrap();
        writer.write(bytes.into()).await.unwrap();
        let blob = writer.seal().await.unwrap().keep().await.unwrap();
        NewRecording { session_id: self.session, blob, inspection: inspection() }
    }

    pub async fn enqueue(&self, recording: RecordingId) -> Job {
        self.queue.enqueue(&self.access, recording, &Settings::default()).await.unwrap()
    }

    pub async fn job(&self, id: JobId) -> Job {
        self.queue.job(&self.access, id).await.unwrap()
    }

    /// A worker with a computation made to order, which no heartbeat disturbs.
    pub fn worker(&self, assess: Arc<Assess>) -> Worker {
        self.worker_until(assess, CancellationToken::new())
    }

    pub fn worker_until(&self, assess: Arc<Assess>, shutdown: CancellationToken) -> Worker {
        Worker::new(self.queue.clone(), "worker", Limits::default(), shutdown)
            .with_assess(assess)
            .with_heartbeat(SILENT)
    }

    /// How many jobs are in each state that has any.
    pub async fn counts(&self) -> Vec<(JobState, u64)> {
        self.queue.counts().await.unwrap().into_iter().filter(|(_, count)| *count > 0).collect()
    }

    /// Lets the longest pause between two attempts, and every lease, pass.
    pub fn pass_time(&self) {
        self.clock.advance(time::Duration::minutes(10));
    }
}

/// A consent that holds on the day of the tests, and long before.
pub fn consent() -> NewConsent {
    NewConsent {
        scope: ConsentScope::Assessment,
        text_version: "test".into(),
        given_at: datetime!(2020-01-01 0:00 UTC),
        expires_at: None,
    }
}

/// In memory where the system has such a folder: every commit syncs the disk, and there are tens of thousands.
fn temporary_directory() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap()
}

/// Opens a data directory as a process does that has just started. Where the variable `SUREFOOT_TEST_POSTGRES` names a server,
/// the rows are in a database of the directory's own there.
pub async fn open(dir: &Path, clock: &ManualClock) -> Queue {
    let mut places = Places::in_directory(dir);
    if let Some(server) = postgres_server() {
        places.database_url = Some(postgres_database(&server, dir).await);
    }
    let store = Store::open_at(&places, Arc::new(clock.clone())).await.unwrap();
    Queue::new(store, QueueSettings::default())
}

fn postgres_server() -> Option<String> {
    std::env::var("SUREFOOT_TEST_POSTGRES").ok().filter(|_| cfg!(feature = "scaleout"))
}

/// True where a test that looks into SQLite's file has nothing to look into.
pub fn rows_are_elsewhere() -> bool {
    let elsewhere = postgres_server().is_some();
    if elsewhere {
        println!("skipped: the rows are in PostgreSQL, and this test looks into SQLite's file");
    }
    elsewhere
}

#[cfg(feature = "scaleout")]
async fn postgres_database(server: &str, dir: &Path) -> String {
    use sqlx::{Connection, Executor};

    let of_directory: String = dir.to_string_lossy().chars().filter(char::is_ascii_alphanumeric).collect();
    let name = format!("surefoot_test_{}_{}", std::process::id(), of_directory.to_lowercase());
    let mut connection = sqlx::PgConnection::connect(server).await.unwrap();
    // The second process finds it made.
    let _ = connection.execute(sqlx::AssertSqlSafe(format!("CREATE DATABASE {name}"))).await;
    let (address, _) = server.rsplit_once('/').unwrap();
    format!("{address}/{name}")
}

#[cfg(not(feature = "scaleout"))]
async fn postgres_database(_: &str, _: &Path) -> String {
    unreachable!("asked for with the feature alone")
}

fn inspection() -> Inspection {
    Inspection {
        format: Format::Mcap,
        header: Header::default(),
        n_frames: 3,
        duration_s: 0.1,
        joints: Vec::new(),
        has_orientations: false,
        inertial_units: Vec::new(),
        depth: None,
        reference_channels: Vec::new(),
        ignored_channels: Vec::new(),
    }
}

/// A small assessment whose samples come from `bytes`.
pub fn assessment(bytes: &[u8]) -> Assessment {
    let n = bytes.len();
    let mut series = Series::empty("right_knee_flexion_deg", n);
    series.value = bytes.iter().map(|b| f32::from(*b)).collect();
    Assessment {
        gait: None,
        joints: None,
        performance: None,
        pipeline: "joint_angles",
        time_ns: (0..n as i64).map(|i| i * 33_333_333).collect(),
        summary: vec![series.summarize()],
        series: vec![series],
        quality: Quality::default(),
        provenance: Provenance { method: "iekf".into(), ..Provenance::default() },
    }
}

/// The computation that turns the recording's bytes into samples.
pub fn plain() -> Arc<Assess> {
    computation(|mut reader, _, _| {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut reader, &mut bytes).unwrap();
        Ok(assessment(&bytes))
    })
}

/// A computation that begins, says so, and goes on until it is asked to stop.
pub fn endless(begun: &Arc<AtomicBool>) -> Arc<Assess> {
    let begun = begun.clone();
    computation(move |_, _, monitor| {
        begun.store(true, Ordering::SeqCst);
        while monitor.check().is_ok() {
            std::thread::yield_now();
        }
        Err(AttemptError::Cancelled)
    })
}

pub fn computation(
    compute: impl Fn(BlobReader, &StoredRecording, &Monitor) -> Result<Assessment, AttemptError> + Send + Sync + 'static,
) -> Arc<Assess> {
    Arc::new(move |reader: BlobReader, recording: &StoredRecording, _: &Settings, _: &Inputs, monitor: &Monitor| {
        compute(reader, recording, monitor)
    })
}

/// Lets other tasks run until the computation has begun.
pub async fn until(begun: &AtomicBool) {
    while !begun.load(Ordering::SeqCst) {
        tokio::task::yield_now().await;
    }
}

/// One connection beside the store, for a look at the rows themselves and for faults in the database.
pub async fn side_door(dir: &Path) -> sqlx::SqlitePool {
    let file = sqlx::sqlite::SqliteConnectOptions::new().filename(dir.join("surefoot.sqlite"));
    sqlx::sqlite::SqlitePoolOptions::new().max_connections(1).connect_with(file).await.unwrap()
}
