//! What SQLite needs so that what was removed is gone from the files too. Nothing here is a question; another database has its
//! own ways.
//!
//! `secure_delete` overwrites what a deleted row stood in. It does not reach copies that a page left behind when it was split, nor
//! the write-ahead log. `VACUUM` builds every page anew from what is there, and a checkpoint that truncates empties the log.

use super::database::query;
use super::{StorageError, Store};
use sqlx::{Row, SqlitePool};
use std::time::Duration;

/// Version of the way rows are removed, kept in the database file: from 1 on with `secure_delete` from its beginning.
const CLEAN: i64 = 1;
/// Looks for a moment without a reader of the old state before it is left for later; each waits as long as SQLite waits for
/// another process, and nobody writes meanwhile.
const LOOKS: u32 = 2;
/// Pause between two looks.
const PAUSE: Duration = Duration::from_millis(100);

/// Rids a database of an older version of what its deletions have left behind, once. When another process is in the way it is
/// left to the next start.
pub(in crate::storage) async fn clean_once(writer: &SqlitePool) -> Result<(), StorageError> {
    let version: i64 = sqlx::query_scalar("PRAGMA user_version").fetch_one(writer).await?;
    if version >= CLEAN {
        return Ok(());
    }
    let is_used: i64 = sqlx::query_scalar("SELECT count(*) FROM patients").fetch_one(writer).await?;
    if is_used > 0
        && let Err(error) = sqlx::query("VACUUM").execute(writer).await
    {
        tracing::warn!(%error, "what was deleted before this version is still in free pages; the next start tries again");
        return Ok(());
    }
    sqlx::query("PRAGMA user_version = 1").execute(writer).await?;
    Ok(())
}

impl Store {
    /// Rids the database file and its write-ahead log of everything that no row holds any more. False when somebody has read an
    /// older state all the while, so that the log could not be emptied: try again later. PostgreSQL forgets deleted rows by its
    /// own `VACUUM`; what its pages and logs keep until they are used again is the server's.
    pub(super) async fn purge_remnants(&self) -> Result<bool, StorageError> {
        let Ok(writer) = self.reader().sqlite_writer() else {
            query("VACUUM").execute(self.reader()).await?;
            return Ok(true);
        };
        let mut writer = writer.acquire().await?;
        sqlx::query("VACUUM").execute(&mut *writer).await?;
        for _ in 0..LOOKS {
            let row = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(&mut *writer).await?;
            let is_busy: i64 = row.try_get(0)?;
            if is_busy == 0 {
                return Ok(true);
            }
            tokio::time::sleep(PAUSE).await;
        }
        Ok(false)
    }
}
