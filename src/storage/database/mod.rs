//! The database behind the questions: SQLite, or PostgreSQL where several machines share one.
//!
//! A question is one text for both. What they do not say alike (a value inside JSON, a list as a parameter, a lock on a row)
//! has two texts side by side, by [`dialects`]. Parameters are `$1`, `$2`, …; integers are 64 bits wide; truth values are
//! `TRUE` and `FALSE`; ids are UUIDs, which PostgreSQL has a type for and SQLite keeps as 16 bytes.
//!
//! SQLite lets one transaction write at a time, so what a transaction has read stays true until its end. PostgreSQL lets many:
//! where a decision rests on something that was read, the transaction asks for it [`exclusively`](Transaction::exclusively).

#[cfg(feature = "scaleout")]
mod postgres;
mod query;
mod row;
mod schema;
mod sqlite;
mod value;

pub(crate) use query::{Text, dialects, query};
pub(crate) use row::{Column, Row};
pub(crate) use value::{Bind, Value};

use super::StorageError;
use sqlx::{Sqlite, SqlitePool};
use std::path::Path;

/// An open database. A clone is another handle to the same.
#[derive(Debug, Clone)]
pub(crate) enum Database {
    /// A file of SQLite: one connection for writing, so that writers queue here and not in SQLite's busy handler, and several
    /// for reading.
    Sqlite { writer: SqlitePool, readers: SqlitePool },
    /// A database of PostgreSQL.
    #[cfg(feature = "scaleout")]
    Postgres(sqlx::PgPool),
}

impl Database {
    /// Opens the file of a data directory, made when absent, and brings its schema up to date.
    pub(crate) async fn open_file(path: &Path) -> Result<Self, StorageError> {
        sqlite::open(path).await
    }

    /// Connects to a server and brings the schema up to date.
    #[cfg(feature = "scaleout")]
    pub(crate) async fn connect(url: &str) -> Result<Self, StorageError> {
        postgres::connect(url).await
    }

    /// A transaction that may write. With SQLite it holds the right to write from its beginning: it can wait, but not fail
    /// halfway because another writer was faster.
    pub(crate) async fn begin(&self) -> Result<Transaction, StorageError> {
        Ok(match self {
            Self::Sqlite { writer, .. } => Transaction::Sqlite(sqlite::begin(writer).await?),
            #[cfg(feature = "scaleout")]
            Self::Postgres(pool) => Transaction::Postgres(pool.begin().await?),
        })
    }

    /// The connection for writing of SQLite's file, for its upkeep.
    ///
    /// # Errors
    /// `Conflict` when the database is a server, which has tools of its own for that.
    pub(crate) fn sqlite_writer(&self) -> Result<&SqlitePool, StorageError> {
        match self {
            Self::Sqlite { writer, .. } => Ok(writer),
            #[cfg(feature = "scaleout")]
            Self::Postgres(_) => Err(StorageError::Conflict {
                code: "not_sqlite",
                sentence: "the rows are in PostgreSQL, whose own tools do this: pg_dump, pg_restore, VACUUM".to_owned(),
            }),
        }
    }

    /// Closes every connection after the questions under way are answered.
    pub(crate) async fn close(&self) {
        match self {
            Self::Sqlite { writer, readers } => {
                readers.close().await;
                writer.close().await;
            }
            #[cfg(feature = "scaleout")]
            Self::Postgres(pool) => pool.close().await,
        }
    }
}

/// A transaction under way; dropped before its commit it leaves nothing.
#[derive(Debug)]
pub(crate) enum Transaction {
    Sqlite(sqlx::Transaction<'static, Sqlite>),
    #[cfg(feature = "scaleout")]
    Postgres(sqlx::Transaction<'static, sqlx::Postgres>),
}

impl Transaction {
    /// Makes what was done last.
    pub(crate) async fn commit(self) -> Result<(), StorageError> {
        match self {
            Self::Sqlite(transaction) => transaction.commit().await?,
            #[cfg(feature = "scaleout")]
            Self::Postgres(transaction) => transaction.commit().await?,
        }
        Ok(())
    }

    /// Leaves nothing of what was done.
    pub(crate) async fn rollback(self) -> Result<(), StorageError> {
        match self {
            Self::Sqlite(transaction) => transaction.rollback().await?,
            #[cfg(feature = "scaleout")]
            Self::Postgres(transaction) => transaction.rollback().await?,
        }
        Ok(())
    }

    /// Waits until no other transaction holds the same `subject`, and holds it to the end. SQLite's transactions are alone
    /// anyway.
    pub(crate) async fn exclusively(&mut self, subject: &str) -> Result<(), StorageError> {
        match self {
            Self::Sqlite(_) => {}
            #[cfg(feature = "scaleout")]
            Self::Postgres(_) => {
                query("SELECT pg_advisory_xact_lock(hashtextextended($1, 0))").bind(subject).execute(self).await?;
            }
        }
        #[cfg(not(feature = "scaleout"))]
        let _ = subject;
        Ok(())
    }
}
