//! What the database answers.

use sqlx::sqlite::SqliteRow;
use sqlx::{Decode, Row as _, Sqlite, Type};

/// One row of an answer.
pub(crate) enum Row {
    Sqlite(SqliteRow),
    #[cfg(feature = "scaleout")]
    Postgres(sqlx::postgres::PgRow),
}

/// What a column can be read as, in both databases.
#[cfg(not(feature = "scaleout"))]
pub(crate) trait Column<'r>: Decode<'r, Sqlite> + Type<Sqlite> {}

#[cfg(not(feature = "scaleout"))]
impl<'r, T: Decode<'r, Sqlite> + Type<Sqlite>> Column<'r> for T {}

/// What a column can be read as, in both databases.
#[cfg(feature = "scaleout")]
pub(crate) trait Column<'r>:
    Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, sqlx::Postgres> + Type<sqlx::Postgres>
{
}

#[cfg(feature = "scaleout")]
impl<'r, T> Column<'r> for T where
    T: Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, sqlx::Postgres> + Type<sqlx::Postgres>
{
}

impl Row {
    /// The value of a column, by its name.
    pub(crate) fn try_get<'r, T: Column<'r>>(&'r self, column: &str) -> Result<T, sqlx::Error> {
        match self {
            Self::Sqlite(row) => row.try_get(column),
            #[cfg(feature = "scaleout")]
            Self::Postgres(row) => row.try_get(column),
        }
    }

    /// The value of the first column.
    pub(crate) fn first<'r, T: Column<'r>>(&'r self) -> Result<T, sqlx::Error> {
        match self {
            Self::Sqlite(row) => row.try_get(0),
            #[cfg(feature = "scaleout")]
            Self::Postgres(row) => row.try_get(0),
        }
    }
}
