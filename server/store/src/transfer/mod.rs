//! Copies all tables of a database to another one, of SQLite or of PostgreSQL.
//!
//! The target has the marker `unfinished_transfer` from the first step to the last, and no server opens it meanwhile. Its
//! triggers are off: what they would write is copied. Rows are copied in the order of their primary keys, in pages, so
//! the last row of a table says how far a killed transfer came. In the end each side is read again for the number of
//! rows and the digest of each table.
//!
//! # Layout
//!
//! - `table`: columns, pages and digests. `side`: the two databases: locks, triggers, marker, numbers.

mod side;
mod table;

#[cfg(test)]
pub(super) use table::TABLES;

use super::StoreError;
use crate::migrations::marked_source;
use crate::sql::{Builder, Connection, scalar};
use std::fmt;
use std::path::PathBuf;
use table::Table;

/// Why a database could not be copied; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum TransferError {
    #[error("a server is connected to the database, or another move of it is in progress: end it first")]
    Served,
    /// The target has content that this transfer did not put there.
    #[error("the target is not empty: it holds {holds}; give an empty database")]
    NotEmpty { holds: String },
    #[error(
        "the table {table} differs after the copy ({source_rows} rows in the source, {target_rows} in the target), because \
         one of them was changed meanwhile: empty the target and begin again"
    )]
    Different { table: &'static str, source_rows: u64, target_rows: u64 },
    /// A database could not be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl From<sqlx::Error> for TransferError {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(error.into())
    }
}

/// A database of a transfer.
#[derive(Clone, PartialEq, Eq)]
pub enum Side {
    /// A file of SQLite.
    File(PathBuf),
    /// URL of a database of PostgreSQL.
    Server(String),
}

impl fmt::Debug for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            // The URL may contain a password.
            Self::Server(_) => f.write_str("PostgreSQL"),
        }
    }
}

/// What was compared of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ComparedTable {
    /// Name of the table.
    pub name: &'static str,
    /// Number of its rows on both sides.
    pub rows: u64,
    /// SHA-256 of its rows on both sides, as hexadecimal digits.
    pub digest: String,
}

/// A copy of all tables, from its beginning to its end. The caller makes sure that no server uses either database.
#[derive(Debug)]
pub struct Transfer {
    from: Connection,
    to: Connection,
    tables: Vec<Table>,
}

impl Transfer {
    /// Prepares the target, or continues an earlier transfer from the same `source`, a name that stays the same.
    ///
    /// # Errors
    ///
    /// [`StoreError::OlderDatabase`] and [`StoreError::NewerDatabase`] if the source has other tables than this version;
    /// [`TransferError::Served`] if a server is connected; [`StoreError::Unfinished`] if the source is itself the target of
    /// an unfinished transfer; [`TransferError::NotEmpty`] if the target has rows, and none of an earlier transfer from this
    /// source; [`TransferError::Store`].
    pub async fn begin(from: &Side, to: &Side, source: &str) -> Result<Self, TransferError> {
        let mut from = from.open_source().await?;
        let mut to = to.open_target().await?;
        let mut tables = Vec::new();
        for name in table::TABLES {
            let (here, there) = (Table::of(name, &mut from).await?, Table::of(name, &mut to).await?);
            if here != there {
                return Err(StoreError::OlderDatabase.into());
            }
            tables.push(here);
        }
        match marked_source(&mut to).await? {
            Some(marked) if marked == source => {}
            Some(other) => {
                return Err(TransferError::NotEmpty { holds: format!("a part of another database ({other})") });
            }
            None => {
                require_empty(&mut to, &tables).await?;
                side::mark(&mut to, source, &tables).await?;
            }
        }
        Ok(Self { from, to, tables })
    }

    /// Copies the rows that the target lacks. `progress` gets the number of rows of the target so far and that of the
    /// source.
    ///
    /// # Errors
    ///
    /// [`TransferError::Store`].
    pub async fn copy(&mut self, mut progress: impl FnMut(u64, u64)) -> Result<(), TransferError> {
        let (all, mut done) = (self.count(true).await?, self.count(false).await?);
        progress(done, all);
        for table in &self.tables {
            loop {
                let copied = table.copy_page(&mut self.from, &mut self.to).await?;
                if copied == 0 {
                    break;
                }
                done += copied;
                progress(done, all);
            }
        }
        Table::copy_late(&mut self.from, &mut self.to).await?;
        for table in &self.tables {
            if let Some(column) = table.numbered() {
                let last = side::last_number(&mut self.from, table.name, column).await?;
                side::set_last_number(&mut self.to, table.name, column, last).await?;
            }
        }
        Ok(())
    }

    /// Reads all rows of both sides and compares them. `progress` gets the number of compared rows and that of all rows.
    ///
    /// # Errors
    ///
    /// [`TransferError::Different`] if a table differs; [`TransferError::Store`].
    pub async fn verify(&mut self, mut progress: impl FnMut(u64, u64)) -> Result<Vec<ComparedTable>, TransferError> {
        let (all, mut done) = (self.count(true).await?, 0);
        let mut compared = Vec::new();
        for table in &self.tables {
            let here = table.content(&mut self.from).await?;
            let there = table.content(&mut self.to).await?;
            let (last, given) = match table.numbered() {
                Some(column) => (
                    side::last_number(&mut self.from, table.name, column).await?,
                    side::last_number(&mut self.to, table.name, column).await?,
                ),
                None => (0, 0),
            };
            if here != there || last != given {
                return Err(TransferError::Different {
                    table: table.name,
                    source_rows: here.rows,
                    target_rows: there.rows,
                });
            }
            done += here.rows;
            progress(done, all);
            compared.push(ComparedTable { name: table.name, rows: here.rows, digest: here.digest });
        }
        Ok(compared)
    }

    /// Digests of the artifacts and then of the checkpoints that the source names.
    ///
    /// # Errors
    ///
    /// [`TransferError::Store`].
    pub async fn blobs(&mut self) -> Result<(Vec<String>, Vec<String>), TransferError> {
        let artifacts = scalar("select digest from artifact order by digest").fetch_all(&mut self.from).await?;
        let checkpoints = scalar("select distinct checkpoint from job where checkpoint is not null order by 1");
        Ok((artifacts, checkpoints.fetch_all(&mut self.from).await?))
    }

    /// Turns the triggers on, records where the artifacts are, and removes the marker: servers accept the target then.
    ///
    /// # Errors
    ///
    /// [`TransferError::Store`].
    pub async fn finish(mut self, artifact_place: Option<&str>) -> Result<(), TransferError> {
        side::unmark(&mut self.to, artifact_place, &self.tables).await?;
        self.to.close().await?;
        self.from.close().await?;
        Ok(())
    }

    async fn count(&mut self, of_source: bool) -> Result<u64, TransferError> {
        let side = if of_source { &mut self.from } else { &mut self.to };
        let mut count = 0;
        for table in &self.tables {
            count += rows_of(table.name, side).await?;
        }
        Ok(count)
    }
}

async fn rows_of(table: &str, connection: &mut Connection) -> Result<u64, TransferError> {
    let row = Builder::new(format!("select count(*) from {table}")).build().fetch_one(connection).await?;
    Ok(row.try_get(0)?)
}

async fn require_empty(to: &mut Connection, tables: &[Table]) -> Result<(), TransferError> {
    for name in tables.iter().map(|table| table.name).chain(["artifact_place"]) {
        if rows_of(name, to).await? > 0 {
            return Err(TransferError::NotEmpty { holds: format!("rows in the table {name}") });
        }
    }
    Ok(())
}
