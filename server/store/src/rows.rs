//! Conversion between columns and domain values: words, JSON, and values of several columns.

use super::sql::Row;
use super::{Result, StoreError};
use lightpath_domain::kernel::{Cause, KernelKey};
use lightpath_domain::units::{Distance, Wavelength};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Writes a value as JSON text.
pub(super) fn to_json<T: Serialize>(column: &'static str, value: &T) -> Result<String> {
    serde_json::to_string(value).map_err(|source| StoreError::Corrupt { column, source })
}

/// Parses JSON text.
pub(super) fn from_json<T: DeserializeOwned>(column: &'static str, text: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|source| StoreError::Corrupt { column, source })
}

/// Parses the JSON text of a column, which is named after its table: `job.spec`.
pub(super) fn json<T: DeserializeOwned>(row: &Row, column: &'static str) -> Result<T> {
    from_json(column, &row.try_get::<String>(in_row(column))?)
}

/// Parses the JSON text of a column, if there is any.
pub(super) fn json_option<T: DeserializeOwned>(row: &Row, column: &'static str) -> Result<Option<T>> {
    let text: Option<String> = row.try_get(in_row(column))?;
    text.map(|text| from_json(column, &text)).transpose()
}

/// Parses the word of a column as a unit variant.
pub(super) fn word<T: DeserializeOwned>(row: &Row, column: &'static str) -> Result<T> {
    from_word(column, row.try_get(in_row(column))?)
}

/// The name that a column `table.column` has in a row.
fn in_row(column: &'static str) -> &'static str {
    column.rsplit('.').next().unwrap_or(column)
}

/// Writes a unit variant as a word, for example `Encoding::Srgb` as `srgb`.
pub(super) fn to_word<T: Serialize>(column: &'static str, value: &T) -> Result<String> {
    match serde_json::to_value(value).map_err(|source| StoreError::Corrupt { column, source })? {
        Value::String(word) => Ok(word),
        other => Ok(other.to_string()),
    }
}

/// Parses a word as a unit variant.
pub(super) fn from_word<T: DeserializeOwned>(column: &'static str, word: String) -> Result<T> {
    serde_json::from_value(Value::String(word)).map_err(|source| StoreError::Corrupt { column, source })
}

/// The kernel that a row names.
pub(super) fn key_of(row: &Row) -> Result<KernelKey> {
    Ok(KernelKey {
        display: row.try_get("display")?,
        wavelength: Wavelength { pm: row.try_get("wavelength_pm")? },
        distance: Distance { nm: row.try_get("distance_nm")? },
    })
}

/// Who caused what a row tells, and why.
pub(super) fn cause_of(row: &Row) -> Result<Cause> {
    Ok(Cause { caller: row.try_get("caller")?, reason: row.try_get("reason")? })
}
