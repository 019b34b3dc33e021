//! A question on its way to the database.

use super::{Bind, Column, Database, Row, Transaction, Value};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use sqlx::{Sqlite, SqliteConnection, SqlitePool};

/// The text of a question in the words of each database.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Text {
    pub(crate) sqlite: &'static str,
    #[cfg_attr(not(feature = "scaleout"), expect(dead_code, reason = "PostgreSQL comes with the feature"))]
    pub(crate) postgres: &'static str,
}

impl From<&'static str> for Text {
    fn from(text: &'static str) -> Self {
        Self { sqlite: text, postgres: text }
    }
}

/// One question in the words of both databases; either may be put together of parts, as by `concat!`.
macro_rules! dialects {
    (sqlite: $sqlite:expr, postgres: $postgres:expr $(,)?) => {
        crate::storage::database::Text { sqlite: $sqlite, postgres: $postgres }
    };
}
pub(crate) use dialects;

/// Where a question is asked.
pub(crate) enum Executor<'c> {
    SqlitePool(&'c SqlitePool),
    Sqlite(&'c mut SqliteConnection),
    #[cfg(feature = "scaleout")]
    PostgresPool(&'c sqlx::PgPool),
    #[cfg(feature = "scaleout")]
    Postgres(&'c mut sqlx::PgConnection),
}

/// Outside of a transaction, for reading.
impl<'c> From<&'c Database> for Executor<'c> {
    fn from(database: &'c Database) -> Self {
        match database {
            Database::Sqlite { readers, .. } => Self::SqlitePool(readers),
            #[cfg(feature = "scaleout")]
            Database::Postgres(pool) => Self::PostgresPool(pool),
        }
    }
}

impl<'c> From<&'c mut Transaction> for Executor<'c> {
    fn from(transaction: &'c mut Transaction) -> Self {
        match transaction {
            Transaction::Sqlite(transaction) => Self::Sqlite(transaction),
            #[cfg(feature = "scaleout")]
            Transaction::Postgres(transaction) => Self::Postgres(transaction),
        }
    }
}

/// A question and the values of its parameters.
#[derive(Debug)]
pub(crate) struct Query<'q> {
    text: Text,
    values: Vec<Value<'q>>,
}

/// A question without values yet.
pub(crate) fn query<'q>(text: impl Into<Text>) -> Query<'q> {
    Query { text: text.into(), values: Vec::new() }
}

/// Gives the values to a question of the driver.
macro_rules! with_values {
    ($query:expr, $values:expr) => {
        $values.into_iter().fold($query, |query, value| match value {
            Value::Integer(value) => query.bind(value),
            Value::Real(value) => query.bind(value),
            Value::Truth(value) => query.bind(value),
            Value::Id(value) => query.bind(value),
            Value::Text(value) => query.bind(value),
            Value::Bytes(value) => query.bind(value),
        })
    };
}

/// A question to PostgreSQL. One for all columns is not kept prepared: the plan would break when a newer version adds a column
/// while this process runs.
#[cfg(feature = "scaleout")]
fn to_postgres<'q>(text: &'static str) -> sqlx::query::Query<'q, sqlx::Postgres, sqlx::postgres::PgArguments> {
    sqlx::query(text).persistent(!text.contains('*'))
}

/// Asks the driver of the database at hand.
macro_rules! ask {
    ($self:ident, $on:expr, $method:ident, $sqlite:expr, $postgres:expr) => {
        match $on.into() {
            Executor::SqlitePool(pool) => {
                $sqlite(with_values!(sqlx::query::<Sqlite>($self.text.sqlite), $self.values).$method(pool).await?)
            }
            Executor::Sqlite(connection) => {
                $sqlite(with_values!(sqlx::query::<Sqlite>($self.text.sqlite), $self.values).$method(connection).await?)
            }
            #[cfg(feature = "scaleout")]
            Executor::PostgresPool(pool) => {
                $postgres(with_values!(to_postgres($self.text.postgres), $self.values).$method(pool).await?)
            }
            #[cfg(feature = "scaleout")]
            Executor::Postgres(connection) => {
                $postgres(with_values!(to_postgres($self.text.postgres), $self.values).$method(connection).await?)
            }
        }
    };
}

impl<'q> Query<'q> {
    /// The value of the next parameter.
    pub(crate) fn bind(mut self, value: impl Bind<'q>) -> Self {
        self.values.push(value.value());
        self
    }

    /// Carries out; the number of rows that were changed.
    pub(crate) async fn execute<'c>(self, on: impl Into<Executor<'c>>) -> Result<u64, sqlx::Error> {
        Ok(ask!(
            self,
            on,
            execute,
            |done: sqlx::sqlite::SqliteQueryResult| done.rows_affected(),
            |done: sqlx::postgres::PgQueryResult| done.rows_affected()
        ))
    }

    /// Every row of the answer.
    pub(crate) async fn fetch_all<'c>(self, on: impl Into<Executor<'c>>) -> Result<Vec<Row>, sqlx::Error> {
        Ok(ask!(self, on, fetch_all, |rows: Vec<_>| rows.into_iter().map(Row::Sqlite).collect(), |rows: Vec<_>| rows
            .into_iter()
            .map(Row::Postgres)
            .collect()))
    }

    /// The rows of the answer one after another, however many they are.
    pub(crate) fn fetch(self, on: &'q Database) -> BoxStream<'q, Result<Row, sqlx::Error>> {
        match on {
            Database::Sqlite { readers, .. } => {
                let query = with_values!(sqlx::query::<Sqlite>(self.text.sqlite), self.values);
                query.fetch(readers).map_ok(Row::Sqlite).boxed()
            }
            #[cfg(feature = "scaleout")]
            Database::Postgres(pool) => {
                let query = with_values!(to_postgres(self.text.postgres), self.values);
                query.fetch(pool).map_ok(Row::Postgres).boxed()
            }
        }
    }

    /// The row of an answer that has at most one.
    pub(crate) async fn fetch_optional<'c>(self, on: impl Into<Executor<'c>>) -> Result<Option<Row>, sqlx::Error> {
        Ok(ask!(self, on, fetch_optional, |row: Option<_>| row.map(Row::Sqlite), |row: Option<_>| row
            .map(Row::Postgres)))
    }

    /// The row of an answer that has one.
    pub(crate) async fn fetch_one<'c>(self, on: impl Into<Executor<'c>>) -> Result<Row, sqlx::Error> {
        self.fetch_optional(on).await?.ok_or(sqlx::Error::RowNotFound)
    }

    /// The first column of every row.
    pub(crate) async fn fetch_values<'c, T>(self, on: impl Into<Executor<'c>>) -> Result<Vec<T>, sqlx::Error>
    where
        T: for<'r> Column<'r>,
    {
        self.fetch_all(on).await?.iter().map(Row::first).collect()
    }

    /// The first column of an answer that has at most one row.
    pub(crate) async fn fetch_optional_value<'c, T>(self, on: impl Into<Executor<'c>>) -> Result<Option<T>, sqlx::Error>
    where
        T: for<'r> Column<'r>,
    {
        self.fetch_optional(on).await?.as_ref().map(Row::first).transpose()
    }

    /// The first column of an answer that has one row.
    pub(crate) async fn fetch_value<'c, T>(self, on: impl Into<Executor<'c>>) -> Result<T, sqlx::Error>
    where
        T: for<'r> Column<'r>,
    {
        self.fetch_one(on).await?.first()
    }
}
