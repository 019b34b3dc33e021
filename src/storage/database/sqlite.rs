//! A file of SQLite.

use super::{Database, schema};
use crate::storage::{StorageError, maintenance};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Connection, Sqlite, SqlitePool, Transaction};
use std::path::Path;
use std::time::Duration;

/// Connections that read at the same time. More than the cores of a small server gain nothing.
const READERS: u32 = 8;
/// How long SQLite waits for another process that holds the database.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);
/// How long a question waits for a free connection before it fails.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(30);

static MIGRATIONS: sqlx::migrate::Migrator = sqlx::migrate!();

pub(super) async fn open(path: &Path) -> Result<Database, StorageError> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .busy_timeout(BUSY_TIMEOUT)
        .foreign_keys(true)
        // What a deleted row stood in is overwritten.
        .pragma("secure_delete", "ON");
    let pool = || SqlitePoolOptions::new().acquire_timeout(ACQUIRE_TIMEOUT).test_before_acquire(false);
    // A transaction that SQLite itself gave up, as on a disk that is full, cannot be rolled back once more, and the driver goes on
    // to count it as open. Such a connection gives way to a new one before anyone else meets it.
    let writer = pool()
        .max_connections(1)
        .before_acquire(|connection, _| Box::pin(std::future::ready(Ok(!connection.is_in_transaction()))))
        .connect_with(options.clone())
        .await?;
    if let Err(error) = MIGRATIONS.run(&writer).await {
        // A database from before there was such a table reaches nowhere.
        let reach = sqlx::query_scalar(schema::REACH).fetch_optional(&writer).await.unwrap_or_default();
        schema::accept(error, &MIGRATIONS, reach)?;
    }
    maintenance::clean_once(&writer).await?;
    let readers = pool().max_connections(READERS).connect_with(options.pragma("query_only", "ON")).await?;
    Ok(Database::Sqlite { writer, readers })
}

/// Begins to write: other processes that write are waited for here, not in the middle of the transaction.
pub(super) async fn begin(writer: &SqlitePool) -> Result<Transaction<'static, Sqlite>, sqlx::Error> {
    writer.begin_with("BEGIN IMMEDIATE").await
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::{Access, ClientId, DATABASE_FILE, OrganisationId, PatientId, Store};
    use sqlx::{ConnectOptions, SqliteConnection};
    use time::macros::datetime;

    #[tokio::test]
    async fn the_database_is_durable_strict_and_keeps_references() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        store.create_organisation("clinic").await.unwrap();
        let mut writer = store.database.sqlite_writer().unwrap().acquire().await.unwrap();
        let pragma = async |question: &'static str, connection: &mut SqliteConnection| {
            sqlx::query_scalar::<_, i64>(question).fetch_one(connection).await.unwrap()
        };
        assert_eq!(pragma("PRAGMA synchronous", &mut writer).await, 2, "FULL");
        assert_eq!(pragma("PRAGMA foreign_keys", &mut writer).await, 1);
        assert_eq!(pragma("PRAGMA busy_timeout", &mut writer).await, 5000);
        let mode: String = sqlx::query_scalar("PRAGMA journal_mode").fetch_one(&mut *writer).await.unwrap();
        assert_eq!(mode, "wal");
        let lax: Vec<String> = sqlx::query_scalar(
            "SELECT name FROM pragma_table_list WHERE schema = 'main' AND NOT strict
               AND name NOT LIKE 'sqlite_%' AND name NOT LIKE '\\_sqlx%' ESCAPE '\\'",
        )
        .fetch_all(&mut *writer)
        .await
        .unwrap();
        assert_eq!(lax, [""; 0]);
        assert!(sqlx::query("INSERT INTO patients (id, organisation_id, pseudonym, created_at) VALUES (zeroblob(16), zeroblob(16), 'p', 0)").execute(&mut *writer).await.is_err());
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn writers_never_meet_a_connection_whose_transaction_was_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let database = open(&folder.path().join(DATABASE_FILE)).await.unwrap();
        let writer = database.sqlite_writer().unwrap();
        let writes: Vec<_> = (0..40)
            .map(|number| {
                let writer = writer.clone();
                tokio::spawn(async move {
                    let mut transaction = begin(&writer).await.unwrap();
                    if number % 2 == 0 {
                        // No page more than there are: the connection's own full disk.
                        sqlx::query("PRAGMA max_page_count = 1").execute(&mut *transaction).await.unwrap();
                        let refused = sqlx::query("CREATE TABLE too_much AS SELECT zeroblob(100000)");
                        let error = refused.execute(&mut *transaction).await.unwrap_err();
                        assert_eq!(error.as_database_error().unwrap().code().as_deref(), Some("13"), "{error}");
                    }
                })
            })
            .collect();
        for write in writes {
            write.await.unwrap();
        }
    }

    #[tokio::test]
    async fn results_of_tests_from_before_there_were_measures_become_measures() {
        let folder = tempfile::tempdir().unwrap();
        let options = SqliteConnectOptions::new().filename(folder.path().join(DATABASE_FILE)).create_if_missing(true);
        let mut connection = options.connect().await.unwrap();
        let before = MIGRATIONS.iter().filter(|migration| migration.version < 5).cloned().collect();
        sqlx::migrate::Migrator::with_migrations(before).run(&mut connection).await.unwrap();
        for statement in [
            "INSERT INTO organisations VALUES (zeroblob(16), 'o', 0)",
            "INSERT INTO clients (id, organisation_id, role, label, key_sha256, created_at)
             VALUES (zeroblob(16), zeroblob(16), 'admin', 'a', zeroblob(32), 0)",
            "INSERT INTO patients (id, organisation_id, pseudonym, created_at) VALUES (zeroblob(16), zeroblob(16), 'p', 0)",
            r#"INSERT INTO measurements VALUES (randomblob(16), zeroblob(16), zeroblob(16), zeroblob(16), 5,
               '{"usual_speed_mps": {"value": 1.5, "standard_error": 0.1}, "timed_up_and_go_s": {"value": 9}}', 7)"#,
        ] {
            sqlx::query(statement).execute(&mut connection).await.unwrap();
        }
        connection.close().await.unwrap();

        let store = Store::open(folder.path()).await.unwrap();
        let nobody = uuid::Uuid::nil();
        let access = Access {
            organisation: OrganisationId(nobody),
            client: ClientId(nobody),
            own_sessions_only: false,
            reaches_shared: true,
        };
        let found = store.newest_measures(&access, PatientId(nobody), datetime!(2026-01-01 0:00 UTC)).await.unwrap();
        let values: Vec<_> = found.iter().map(|m| (m.name.as_str(), m.value, m.standard_error)).collect();
        assert_eq!(values, [("timed_up_and_go_s", 9.0, None), ("usual_speed_mps", 1.5, Some(0.1))]);
    }
}
