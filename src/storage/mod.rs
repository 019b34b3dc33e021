//! SQLite rows and blobs of bytes.
//!
//! Every question that is asked of the database is one method of [`Store`], in the file of its subject, with domain
//! types in and out: whoever asks never sees SQL, so another database can stand behind the same questions.
//!
//! A question by a client takes an [`Access`]. What lies outside of it does not exist for the client: the answer is
//! [`StorageError::NotFound`], never "forbidden", so that nobody learns of another organisation's rows.
//!
//! # Durability
//!
//! The database runs in WAL mode with `synchronous = FULL`: what was committed survives a power cut. There is one
//! connection for writing, so writers queue here and not in SQLite's busy handler, and several for reading, which WAL
//! lets read beside the writer. A blob is on the disk before the row that names it.

pub mod access;
pub mod assessments;
pub mod blobs;
pub mod clients;
pub mod clock;
pub mod entries;
pub mod error;
pub mod id;
pub mod idempotency;
pub mod joint_tracks;
mod known_keys;
pub mod measures;
pub mod noise_models;
pub mod organisations;
pub mod page;
pub mod page_sessions;
pub mod patients;
pub mod recent;
pub mod recordings;
pub(crate) mod row;
pub mod series;
pub mod sessions;

pub use access::Access;
pub use assessments::{AssessmentFilter, StoredAssessment};
pub use blobs::{BlobReader, BlobStore, BlobWriter, SealedBlob, StoredBlob};
pub use clients::{ApiKey, Client, Role};
pub use clock::{Clock, ManualClock, SystemClock};
pub use entries::{Entry, Occasion};
pub use error::StorageError;
pub use id::{
    AssessmentId, ClientId, JobId, MeasureId, MeasurementId, NoiseModelId, OrganisationId, PatientId, QuestionnaireId,
    RecordingId, SessionId, TrainingPlanId,
};
pub use idempotency::StoredResponse;
pub use measures::MeasureFilter;
pub use noise_models::StoredNoiseModel;
pub use organisations::Organisation;
pub use page::{Page, PageRequest};
pub use page_sessions::PageToken;
pub use patients::{NewPatient, Patient, PatientFilter, Sex};
pub use recordings::{NewRecording, RecordingFilter, StoredRecording};
pub use series::{Parts, SeriesQuery, SeriesSlice};
pub use sessions::{NewSession, Session, SessionFilter};

use known_keys::KnownKeys;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Sqlite, SqlitePool, Transaction};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use time::OffsetDateTime;

/// Name of the database file in the data directory.
const DATABASE_FILE: &str = "surefoot.sqlite";
/// Connections that read at the same time. More than the cores of a small server gain nothing.
const READERS: u32 = 8;
/// How long SQLite waits for another process that holds the database.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);
/// How long a question waits for a free connection before it fails.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(30);

static MIGRATIONS: sqlx::migrate::Migrator = sqlx::migrate!();

/// The database and the blobs of one data directory. A clone is another handle to the same.
#[derive(Debug, Clone)]
pub struct Store {
    writer: SqlitePool,
    readers: SqlitePool,
    blobs: BlobStore,
    clock: Arc<dyn Clock>,
    known_keys: KnownKeys,
}

impl Store {
    /// Opens the data directory, makes it when absent, and brings the schema up to date.
    ///
    /// # Errors
    /// When the directory cannot be written, the file is not a database, or a newer version of Surefoot made it.
    pub async fn open(data_dir: &Path) -> Result<Self, StorageError> {
        Self::open_with_clock(data_dir, Arc::new(SystemClock)).await
    }

    /// Like [`Store::open`], with a clock of the caller's choice.
    ///
    /// # Errors
    /// See [`Store::open`].
    pub async fn open_with_clock(data_dir: &Path, clock: Arc<dyn Clock>) -> Result<Self, StorageError> {
        let blobs = BlobStore::open(data_dir).await?;
        let options = SqliteConnectOptions::new()
            .filename(data_dir.join(DATABASE_FILE))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(BUSY_TIMEOUT)
            .foreign_keys(true);
        let pool = || SqlitePoolOptions::new().acquire_timeout(ACQUIRE_TIMEOUT).test_before_acquire(false);
        let writer = pool().max_connections(1).connect_with(options.clone()).await?;
        MIGRATIONS.run(&writer).await?;
        let readers = pool().max_connections(READERS).connect_with(options.pragma("query_only", "ON")).await?;
        Ok(Self { writer, readers, blobs, clock, known_keys: KnownKeys::default() })
    }

    /// The blobs.
    pub fn blobs(&self) -> &BlobStore {
        &self.blobs
    }

    /// The time by the store's clock.
    pub fn now(&self) -> OffsetDateTime {
        self.clock.now()
    }

    /// Succeeds when the database answers and can be written: the readiness check.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn check_ready(&self) -> Result<(), StorageError> {
        sqlx::query("SELECT 1").execute(&self.readers).await?;
        self.begin().await?.rollback().await?;
        Ok(())
    }

    /// Closes every connection after the questions under way are answered.
    pub async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }

    /// A transaction that holds the right to write from its beginning: it can wait, but not fail halfway because
    /// another writer was faster.
    pub(crate) async fn begin(&self) -> Result<Transaction<'static, Sqlite>, StorageError> {
        Ok(self.writer.begin_with("BEGIN IMMEDIATE").await?)
    }

    pub(crate) fn reader(&self) -> &SqlitePool {
        &self.readers
    }
}

#[cfg(test)]
mod tests;
