//! Where rows and blobs are kept: in a directory, or on servers that many machines share.

use super::database::Database;
use super::{BlobStore, DATABASE_FILE, StorageError};
use crate::config::Config;
use std::path::{Path, PathBuf};

/// Where a store's rows and blobs are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Places {
    /// Directory of the database file, the blobs, and the parts of uploads under way, as far as they are not elsewhere.
    pub data_dir: PathBuf,
    /// Address of a PostgreSQL database for the rows.
    pub database_url: Option<String>,
    /// Address of an S3 bucket for the blobs.
    pub blob_url: Option<String>,
}

impl Places {
    /// Everything in one directory.
    pub fn in_directory(data_dir: &Path) -> Self {
        Self { data_dir: data_dir.to_owned(), database_url: None, blob_url: None }
    }

    pub(super) async fn open_database(&self) -> Result<Database, StorageError> {
        match &self.database_url {
            None => Database::open_file(&self.data_dir.join(DATABASE_FILE)).await,
            #[cfg(feature = "scaleout")]
            Some(url) => Database::connect(url).await,
            #[cfg(not(feature = "scaleout"))]
            Some(_) => Err(needs_feature("database_url")),
        }
    }

    pub(super) async fn open_blobs(&self) -> Result<BlobStore, StorageError> {
        match &self.blob_url {
            None => BlobStore::open(&self.data_dir).await,
            #[cfg(feature = "scaleout")]
            Some(url) => BlobStore::in_bucket(&self.data_dir, url).await,
            #[cfg(not(feature = "scaleout"))]
            Some(_) => Err(needs_feature("blob_url")),
        }
    }
}

impl From<&Config> for Places {
    fn from(config: &Config) -> Self {
        Self {
            data_dir: config.data_dir.clone(),
            database_url: config.database_url.clone(),
            blob_url: config.blob_url.clone(),
        }
    }
}

#[cfg(not(feature = "scaleout"))]
fn needs_feature(setting: &str) -> StorageError {
    StorageError::Conflict {
        code: "feature_missing",
        sentence: format!("the setting `{setting}` needs a build with `--features scaleout`"),
    }
}
