//! A database of PostgreSQL.

use super::{Database, schema};
use crate::storage::StorageError;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{ConnectOptions, Connection};
use std::str::FromStr;
use std::time::Duration;

/// Connections of one process. A hundred processes stay below what a server takes with a pooler before it.
const CONNECTIONS: u32 = 16;
/// How long a question waits for a free connection before it fails.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(30);

static MIGRATIONS: sqlx::migrate::Migrator = sqlx::migrate!("migrations/postgres");

pub(super) async fn connect(url: &str) -> Result<Database, StorageError> {
    // What was committed survives a power cut of the server, whatever its default is.
    let options = PgConnectOptions::from_str(url)?
        .application_name("surefoot")
        .options([("synchronous_commit", "on"), ("default_transaction_isolation", "read committed")]);
    migrate(&options).await?;
    let pool = PgPoolOptions::new().max_connections(CONNECTIONS).acquire_timeout(ACQUIRE_TIMEOUT);
    Ok(Database::Postgres(pool.connect_with(options).await?))
}

/// Processes that start together take turns: the migrator holds a lock of the server. It lets go of it at the end, but not when it
/// has failed, so it has a connection of its own, with which the lock ends.
async fn migrate(options: &PgConnectOptions) -> Result<(), StorageError> {
    let mut connection = options.connect().await?;
    if let Err(error) = MIGRATIONS.run(&mut connection).await {
        // A database from before there was such a table reaches nowhere.
        let reach = sqlx::query_scalar(schema::REACH).fetch_optional(&mut connection).await.unwrap_or_default();
        schema::accept(error, &MIGRATIONS, reach)?;
    }
    connection.close().await?;
    Ok(())
}
