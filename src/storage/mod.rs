//! Rows and blobs of bytes: SQLite and a folder, or PostgreSQL and a bucket.
//!
//! Every question that is asked of the database is one method of [`Store`], in the file of its subject, with domain
//! types in and out: whoever asks never sees SQL, and `database` puts SQLite or PostgreSQL behind the same questions.
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
pub mod audit;
pub mod backup;
pub mod blobs;
pub mod clients;
pub mod clock;
pub mod consents;
pub(crate) mod database;
pub mod entries;
pub mod erasure;
pub mod error;
pub mod id;
pub mod idempotency;
pub mod joint_tracks;
pub mod key_rotation;
mod known_keys;
mod maintenance;
pub mod measures;
pub mod noise_models;
pub mod organisations;
pub mod page;
pub mod page_sessions;
pub mod patients;
mod places;
pub mod recent;
pub mod recordings;
pub mod resumable;
pub mod retention;
pub(crate) mod row;
pub mod series;
pub mod sessions;
pub mod shares;
pub mod sign_in_failures;
pub mod uploads;
pub mod users;

pub use access::Access;
pub use assessments::{AssessmentFilter, StoredAssessment};
pub use backup::{Ailment, BackupManifest, restore};
pub use blobs::{BlobReader, BlobStore, BlobWriter, SealedBlob, StoredBlob};
pub use clients::{ApiKey, Client, KeyHolder, Role};
pub use clock::{Clock, ManualClock, SystemClock};
pub use consents::{Consent, ConsentScope, ConsentState, NewConsent};
pub use entries::{Entry, Occasion};
pub use erasure::{ErasedBlob, Erasure, ErasureReason};
pub use error::StorageError;
pub use id::{
    AssessmentId, ClientId, ConsentId, ErasureId, JobId, MeasureId, MeasurementId, NoiseModelId, OrganisationId,
    PatientId, QuestionnaireId, RecordingId, ResumableUploadId, SessionId, ShareId, TrainingPlanId,
};
pub use idempotency::StoredResponse;
pub use key_rotation::Rotation;
pub use measures::MeasureFilter;
pub use noise_models::StoredNoiseModel;
pub use organisations::Organisation;
pub use page::{Page, PageRequest};
pub use page_sessions::PageToken;
pub use patients::{NewPatient, Patient, PatientFilter, Sex};
pub use places::Places;
pub use recordings::{NewRecording, RecordingFilter, StoredRecording};
pub use resumable::{PartialFiles, ResumableState, ResumableUpload, UploadStates};
pub use series::{Parts, SeriesQuery, SeriesSlice};
pub use sessions::{NewSession, Session, SessionFilter};
pub use shares::Share;
pub use uploads::{UploadUnderWay, Uploads};
pub use users::{NewUser, Password, Provided, SignIn, User};

use database::{Database, Transaction, query};
use known_keys::KnownKeys;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use time::OffsetDateTime;
use tokio::sync::Semaphore;

/// Name of the database file in the data directory.
const DATABASE_FILE: &str = "surefoot.sqlite";
/// Passwords that are looked at or changed at the same time.
const PASSWORDS_AT_ONCE: usize = 2;

/// The database and the blobs of one data directory. A clone is another handle to the same.
#[derive(Debug, Clone)]
pub struct Store {
    database: Database,
    blobs: BlobStore,
    clock: Arc<dyn Clock>,
    known_keys: KnownKeys,
    password_turns: Arc<Semaphore>,
    uploads: Uploads,
    audit_secret: audit::Secret,
    erasure_list: PathBuf,
    partial_files: PartialFiles,
}

impl Store {
    /// Opens the data directory, makes it when absent, and brings the schema up to date.
    ///
    /// # Errors
    /// When the directory cannot be written, the file is not a database, or a newer version of Surefoot made it.
    pub async fn open(data_dir: &Path) -> Result<Self, StorageError> {
        Self::open_at(&Places::in_directory(data_dir), Arc::new(SystemClock)).await
    }

    /// Like [`Store::open`], with a clock of the caller's choice.
    ///
    /// # Errors
    /// See [`Store::open`].
    pub async fn open_with_clock(data_dir: &Path, clock: Arc<dyn Clock>) -> Result<Self, StorageError> {
        Self::open_at(&Places::in_directory(data_dir), clock).await
    }

    /// Opens a store wherever its rows and blobs are, and brings the schema up to date.
    ///
    /// # Errors
    /// When a place cannot be reached or used, or a newer version of Surefoot made what is there.
    pub async fn open_at(places: &Places, clock: Arc<dyn Clock>) -> Result<Self, StorageError> {
        let blobs = places.open_blobs().await?;
        let database = places.open_database().await?;
        let mut transaction = database.begin().await?;
        let audit_secret = audit::Secret::of_database(&mut transaction).await?;
        transaction.commit().await?;
        Ok(Self {
            database,
            blobs,
            clock,
            known_keys: KnownKeys::default(),
            password_turns: Arc::new(Semaphore::new(PASSWORDS_AT_ONCE)),
            partial_files: PartialFiles::in_directory(&places.data_dir),
            uploads: Uploads::default(),
            audit_secret,
            erasure_list: places.data_dir.join(erasure::LIST_FILE),
        })
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
        query("SELECT 1").execute(self.reader()).await?;
        self.begin().await?.rollback().await
    }

    /// Closes every connection after the questions under way are answered.
    pub async fn close(&self) {
        self.database.close().await;
    }

    /// A transaction that may write.
    pub(crate) async fn begin(&self) -> Result<Transaction, StorageError> {
        self.database.begin().await
    }

    /// Where questions are asked that only read.
    pub(crate) fn reader(&self) -> &Database {
        &self.database
    }
}

#[cfg(test)]
mod tests;
