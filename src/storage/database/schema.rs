//! A schema that a newer version has brought further than this one knows.
//!
//! Processes of two versions share a database while a service is upgraded, and any of them may start again meanwhile. The newer
//! one has then run migrations that the older does not know; the table `schema_reach` says how far back they can be done without.

use crate::storage::StorageError;
use sqlx::migrate::{MigrateError, Migrator};

/// The newest migration that a process must know to use the schema.
pub(super) const REACH: &str = "SELECT oldest_migration FROM schema_reach WHERE id = 1";

/// What becomes of a start whose migrations ended with this error: nothing is amiss when the schema reaches back to what this
/// version knows.
pub(super) fn accept(error: MigrateError, known: &Migrator, reach: Option<i64>) -> Result<(), StorageError> {
    let MigrateError::VersionMissing(newer) = error else { return Err(error.into()) };
    let newest = known.iter().map(|migration| migration.version).max().unwrap_or(0);
    if reach.is_some_and(|oldest| oldest <= newest) {
        tracing::warn!(
            newer,
            newest,
            "a newer version of surefoot has extended the database; this one works beside it"
        );
        return Ok(());
    }
    Err(StorageError::Conflict {
        code: "schema_too_new",
        sentence: format!(
            "a newer version of surefoot made the database (migration {newer}, this one knows up to {newest}); run that version, \
             or restore the backup from before the upgrade"
        ),
    })
}
