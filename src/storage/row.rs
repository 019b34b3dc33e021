//! From columns to values that the database has no type for.

use super::StorageError;
use super::clock::time_from_ms;
use super::database::Row;
use serde::Serialize;
use serde::de::DeserializeOwned;
use time::OffsetDateTime;

fn damaged(column: &str, reason: impl std::fmt::Display) -> StorageError {
    StorageError::Corrupt(format!("column `{column}`: {reason}"))
}

/// A wall-clock time.
pub(crate) fn time(row: &Row, column: &str) -> Result<OffsetDateTime, StorageError> {
    let ms: i64 = row.try_get(column)?;
    time_from_ms(ms).ok_or_else(|| damaged(column, format!("{ms} ms is beyond the calendar")))
}

/// A wall-clock time that may be absent.
pub(crate) fn optional_time(row: &Row, column: &str) -> Result<Option<OffsetDateTime>, StorageError> {
    let ms: Option<i64> = row.try_get(column)?;
    ms.map(|ms| time_from_ms(ms).ok_or_else(|| damaged(column, format!("{ms} ms is beyond the calendar")))).transpose()
}

/// A count.
pub(crate) fn count(row: &Row, column: &str) -> Result<u64, StorageError> {
    let number: i64 = row.try_get(column)?;
    u64::try_from(number).map_err(|_| damaged(column, format!("{number} is negative")))
}

/// A number of a narrow type: columns are 64 bits wide.
pub(crate) fn small<T: TryFrom<i64>>(row: &Row, column: &str) -> Result<T, StorageError> {
    let number: i64 = row.try_get(column)?;
    T::try_from(number).map_err(|_| damaged(column, format!("{number} is out of range")))
}

/// A number of a narrow type that may be absent.
pub(crate) fn optional_small<T: TryFrom<i64>>(row: &Row, column: &str) -> Result<Option<T>, StorageError> {
    let number: Option<i64> = row.try_get(column)?;
    let narrow = |number| T::try_from(number).map_err(|_| damaged(column, format!("{number} is out of range")));
    number.map(narrow).transpose()
}

/// A structured value.
pub(crate) fn json<T: DeserializeOwned>(row: &Row, column: &str) -> Result<T, StorageError> {
    let text: &str = row.try_get(column)?;
    serde_json::from_str(text).map_err(|error| damaged(column, error))
}

/// A structured value that may be absent.
pub(crate) fn optional_json<T: DeserializeOwned>(row: &Row, column: &str) -> Result<Option<T>, StorageError> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(|text| serde_json::from_str(text).map_err(|error| damaged(column, error))).transpose()
}

/// A value that is one word in the database, as it is in JSON.
pub(crate) fn word<T: DeserializeOwned>(row: &Row, column: &str) -> Result<T, StorageError> {
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
