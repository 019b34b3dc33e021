//! Why a question to the storage has no answer.

use super::ConsentState;

/// Failure of the storage, or an answer that the caller should pass on.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    /// There is no such thing within the caller's reach; another organisation's things count as absent.
    #[error("there is no such {what}")]
    NotFound {
        /// What was looked for, for example `patient`.
        what: &'static str,
    },
    /// The request contradicts what is stored.
    #[error("{sentence}")]
    Conflict {
        /// Stable code, for example `pseudonym_taken`.
        code: &'static str,
        /// One sentence for a person.
        sentence: String,
    },
    /// The patient's consent to it is missing, or over.
    #[error("the patient has no valid consent: {0:?}")]
    NoConsent(ConsentState),
    /// The database failed.
    #[error("the database failed: {0}")]
    Database(#[from] sqlx::Error),
    /// The stored schema could not be brought up to date.
    #[error("the database could not be migrated: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// The folder of blobs failed.
    #[error("the blob store failed while it was {doing}: {source}")]
    Blob {
        /// What was tried, for example `writing a part file`.
        doing: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// Stored bytes are not what was stored, or a value cannot be stored and read back.
    #[error("stored data is damaged: {0}")]
    Corrupt(String),
    /// The operating system gave no random bytes for a key.
    #[error("no random bytes for a key: {0}")]
    Randomness(String),
}

impl StorageError {
    /// Something that is absent, or out of the caller's reach.
    pub fn not_found(what: &'static str) -> Self {
        Self::NotFound { what }
    }

    /// True when the disk, or what stands for it, is full.
    pub fn is_out_of_space(&self) -> bool {
        match self {
            Self::Blob { source, .. } => {
                matches!(source.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded)
            }
            // SQLITE_FULL, and PostgreSQL's class for insufficient resources: disk_full.
            Self::Database(sqlx::Error::Database(error)) => {
                error.code().is_some_and(|code| code == "13" || code == "53100")
            }
            _ => false,
        }
    }

    pub(crate) fn blob(doing: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Blob { doing, source }
    }

    /// A broken uniqueness rule is the caller's conflict; everything else stays a failure of the database.
    pub(crate) fn conflict_if_not_unique(
        error: sqlx::Error,
        code: &'static str,
        sentence: impl FnOnce() -> String,
    ) -> Self {
        match &error {
            sqlx::Error::Database(database) if database.is_unique_violation() => {
                Self::Conflict { code, sentence: sentence() }
            }
            _ => Self::Database(error),
        }
    }
}
