//! From columns to values that the database has no type for.

use super::StorageError;
use super::clock::time_from_ms;
use serde::Serialize;
use serde::de::DeserializeOwned;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;
use time::OffsetDateTime;

fn damaged(column: &str, reason: impl std::fmt::Display) -> StorageError {
    StorageError::Corrupt(format!("column `{column}`: {reason}"))
}

/// A wall-clock time.
pub(crate) fn time(row: &SqliteRow, column: &str) -> Result<OffsetDateTime, StorageError> {
    let ms: i64 = row.try_get(column)?;
    time_from_ms(ms).ok_or_else(|| damaged(column, format!("{ms} ms is beyond the calendar")))
}

/// A wall-clock time that may be absent.
pub(crate) fn optional_time(row: &SqliteRow, column: &str) -> Result<Option<OffsetDateTime>, StorageError> {
    let ms: Option<i64> = row.try_get(column)?;
    ms.map(|ms| time_from_ms(ms).ok_or_else(|| damaged(column, format!("{ms} ms is beyond the calendar")))).transpose()
}

/// A count.
pub(crate) fn count(row: &SqliteRow, column: &str) -> Result<u64, StorageError> {
    let number: i64 = row.try_get(column)?;
    u64::try_from(number).map_err(|_| damaged(column, format!("{number} is negative")))
}

/// A small count.
pub(crate) fn small_count(row: &SqliteRow, column: &str) -> Result<u32, StorageError> {
    let number: i64 = row.try_get(column)?;
    u32::try_from(number).map_err(|_| damaged(column, format!("{number} is out of range")))
}

/// A structured value.
pub(crate) fn json<T: DeserializeOwned>(row: &SqliteRow, column: &str) -> Result<T, StorageError> {
    let text: &str = row.try_get(column)?;
    serde_json::from_str(text).map_err(|error| damaged(column, error))
}

/// A structured value that may be absent.
pub(crate) fn optional_json<T: DeserializeOwned>(row: &SqliteRow, column: &str) -> Result<Option<T>, StorageError> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(|text| serde_json::from_str(text).map_err(|error| damaged(column, error))).transpose()
}

/// A value that is one word in the database, as it is in JSON.
pub(crate) fn word<T: DeserializeOwned>(row: &SqliteRow, column: &str) -> Result<T, StorageError> {
    let text: &str = row.try_get(column)?;
    word_from_text(text).map_err(|error| damaged(column, error))
}

/// The value that a word stands for.
pub(crate) fn word_from_text<T: DeserializeOwned>(text: &str) -> Result<T, serde_json::Error> {
    serde_json::from_value(serde_json::Value::from(text))
}

/// JSON of a value that is certain to be read back: a NaN, which JSON does not have, is refused here and not when
/// somebody asks for the result.
pub(crate) fn readable_json<T: Serialize + DeserializeOwned>(what: &str, value: &T) -> Result<String, StorageError> {
    let unreadable = |error: serde_json::Error| StorageError::Corrupt(format!("{what} cannot be stored: {error}"));
    let text = serde_json::to_string(value).map_err(unreadable)?;
    serde_json::from_str::<T>(&text).map_err(unreadable)?;
    Ok(text)
}
