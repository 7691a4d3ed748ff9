//! A table on both sides of a transfer: its columns, its rows in pages, and its digest.

use super::TransferError;
use crate::sql::{Builder, ColumnId, Connection, Row, Value, query};
use sha2::{Digest as _, Sha256};

/// The tables that are copied, each behind those to which it refers. `artifact_place` is none of them: where the artifacts
/// are is set anew. Nor is `process`: no process lives during a move. Nor is `older_programs`: migrations fill it.
pub(crate) const TABLES: &[&str] = &[
    "display",
    "artifact",
    "artifact_removal",
    "artifact_owner",
    "owner_bytes",
    "dataset",
    "pair",
    "kernel",
    "kernel_version",
    "kernel_alias",
    "kernel_move",
    "kernel_deprecation",
    "promotion_gate",
    "job",
    "job_event",
    "job_dependency",
    "job_artifact",
    "lane",
    "lane_needs",
    "job_count",
    "pause",
    "token",
    "keyring",
    "signing_key",
    "device",
    "device_kernel",
    "rollout",
    "rollout_event",
    "rollout_report",
    "made_by_request",
    "webhook",
    "webhook_delivery",
];

/// A row of `kernel` names a row of `kernel_version`, which names that row. So this column is set after both exist.
const LATE: (&str, &str) = ("kernel", "active_version");

/// Parameters of one statement; SQLite accepts 32,766.
const PARAMETERS_MAX: usize = 8000;

/// Rows of one page, so that a transaction ends soon.
const ROWS_MAX: usize = 500;

/// What a column stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Integer,
    Real,
    Text,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Column {
    name: String,
    kind: Kind,
}

/// A table with its columns by name, and the columns of its primary key in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Table {
    pub(super) name: &'static str,
    columns: Vec<Column>,
    key: Vec<String>,
}

/// Number of rows of a table, and the SHA-256 of all its values in the order of its primary key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Content {
    pub(super) rows: u64,
    pub(super) digest: String,
}

impl Table {
    /// Reads the definition of a table.
    pub(super) async fn of(name: &'static str, connection: &mut Connection) -> Result<Self, TransferError> {
        let sql = match connection.is_postgres() {
            true => {
                "select c.column_name::text as name, c.data_type::text as type, coalesce(array_position(i.indkey::int2[], \
                 c.ordinal_position::int2) + 1, 0)::bigint as key from information_schema.columns c \
                 join pg_index i on i.indrelid = to_regclass($1) and i.indisprimary \
                 where c.table_name = $1 and c.table_schema = current_schema() order by c.column_name::text collate \"C\""
            }
            false => "select name, type, pk as key from pragma_table_info($1) order by name",
        };
        let (mut columns, mut key) = (Vec::new(), Vec::new());
        for row in query(sql).bind(name).fetch_all(connection).await? {
            let (column, kind): (String, String) = (row.try_get("name")?, row.try_get("type")?);
            let kind = match kind.to_ascii_lowercase().as_str() {
                "integer" | "bigint" => Kind::Integer,
                "real" | "double precision" => Kind::Real,
                _ => Kind::Text,
            };
            let place: i64 = row.try_get("key")?;
            if place > 0 {
                key.push((place, column.clone()));
            }
            columns.push(Column { name: column, kind });
        }
        key.sort();
        Ok(Self { name, columns, key: key.into_iter().map(|(_, column)| column).collect() })
    }

    /// The column with numbers that the database gives, if the table has one.
    pub(super) fn numbered(&self) -> Option<&str> {
        match (self.name, self.key.as_slice()) {
            ("kernel", [id]) => Some(id),
            (_, [sequence]) if sequence == "sequence" => Some(sequence),
            _ => None,
        }
    }

    /// Copies the rows behind the last one that the target has, at most a page of them, in a transaction of their own.
    /// Returns their number.
    pub(super) async fn copy_page(&self, from: &mut Connection, to: &mut Connection) -> Result<u64, TransferError> {
        let after = self.last(to).await?;
        let rows = self.page(from, after.as_deref()).await?;
        if rows.is_empty() {
            return Ok(0);
        }
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let mut insert = Builder::new(format!("insert into {} ({}) values ", self.name, names.join(", ")));
        for (n, row) in rows.iter().enumerate() {
            insert.push(if n == 0 { "(" } else { ", (" });
            for (place, column) in self.columns.iter().enumerate() {
                insert.push(if place == 0 { "" } else { ", " });
                let is_late = (self.name, column.name.as_str()) == LATE;
                insert.push_bind(if is_late { Value::Integer(None) } else { value(row, place, column.kind)? });
            }
            insert.push(")");
        }
        insert.build().execute(to).await?;
        Ok(rows.len() as u64)
    }

    /// Sets the column that [`Self::copy_page`] has left out.
    pub(super) async fn copy_late(from: &mut Connection, to: &mut Connection) -> Result<(), TransferError> {
        let rows = query("select id, active_version from kernel order by id").fetch_all(from).await?;
        for row in rows {
            let (id, version): (i64, Option<i64>) = (row.try_get(0)?, row.try_get(1)?);
            query("update kernel set active_version = $2 where id = $1").bind((id, version)).execute(&mut *to).await?;
        }
        Ok(())
    }

    /// Reads all rows.
    pub(super) async fn content(&self, connection: &mut Connection) -> Result<Content, TransferError> {
        let (mut hash, mut count, mut after) = (Sha256::new(), 0, None);
        loop {
            let rows = self.page(connection, after.as_deref()).await?;
            let Some(last) = rows.last() else { break };
            after = Some(self.key_of(last)?);
            count += rows.len() as u64;
            for row in &rows {
                for (place, column) in self.columns.iter().enumerate() {
                    add(&mut hash, &value(row, place, column.kind)?);
                }
            }
        }
        Ok(Content { rows: count, digest: hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect() })
    }

    /// The rows behind the one with the key `after`, in the order of their keys.
    async fn page(&self, connection: &mut Connection, after: Option<&[Value]>) -> Result<Vec<Row>, TransferError> {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let key = self.key.join(", ");
        let mut select = Builder::new(format!("select {} from {}", names.join(", "), self.name));
        if let Some(after) = after {
            select.push(format!(" where ({key}) > ("));
            for (n, value) in after.iter().enumerate() {
                select.push(if n == 0 { "" } else { ", " }).push_bind(value.clone());
            }
            select.push(")");
        }
        let rows = (PARAMETERS_MAX / names.len()).min(ROWS_MAX);
        Ok(select.push(format!(" order by {key} limit {rows}")).build().fetch_all(connection).await?)
    }

    /// The key of the last row; `None` if there is no row.
    async fn last(&self, connection: &mut Connection) -> Result<Option<Vec<Value>>, TransferError> {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let newest = self.key.join(" desc, ");
        let sql = format!("select {} from {} order by {newest} desc limit 1", names.join(", "), self.name);
        let row = Builder::new(sql).build().fetch_optional(connection).await?;
        row.map(|row| self.key_of(&row)).transpose()
    }

    fn key_of(&self, row: &Row) -> Result<Vec<Value>, TransferError> {
        let kind = |name: &String| self.columns.iter().find(|column| column.name == *name).map(|column| column.kind);
        self.key.iter().map(|name| value(row, name.as_str(), kind(name).unwrap_or(Kind::Text))).collect()
    }
}

fn value<'n>(row: &Row, column: impl Into<ColumnId<'n>>, kind: Kind) -> Result<Value, TransferError> {
    Ok(match kind {
        Kind::Integer => Value::Integer(row.try_get(column)?),
        Kind::Real => Value::Real(row.try_get(column)?),
        Kind::Text => Value::Text(row.try_get(column)?),
    })
}

/// Adds a value to a digest, so that no two rows of values give the same bytes.
fn add(hash: &mut Sha256, value: &Value) {
    match value {
        Value::Integer(Some(value)) => {
            hash.update(b"i");
            hash.update(value.to_le_bytes());
        }
        Value::Real(Some(value)) => {
            hash.update(b"r");
            hash.update(value.to_bits().to_le_bytes());
        }
        Value::Text(Some(value)) => {
            hash.update(b"t");
            hash.update((value.len() as u64).to_le_bytes());
            hash.update(value);
        }
        Value::Integer(None) | Value::Real(None) | Value::Text(None) => hash.update(b"n"),
    }
}
