//! The two databases of a transfer: how they are opened and locked, and what marks the target.

use super::{Side, Table, TransferError};
use crate::StoreError;
use crate::connect::{connect_once, connect_options, create_private, postgres_options};
use crate::inspect::Inspection;
use crate::migrations::{MIGRATIONS, migration_error, migrator};
use crate::rows::{from_json, to_json};
use crate::sql::{Builder, Connection, query, run_all, scalar};
use crate::write::turn;
use sqlx::{ConnectOptions as _, PgConnection, SqliteConnection};
use std::cmp::Ordering;
use std::path::Path;
use std::time::Duration;

/// Number of looks for connections of a server, and time between two.
const CLOSING_CHECKS: u32 = 10;
const CLOSING_PAUSE: Duration = Duration::from_millis(200);

impl Side {
    /// Opens the database from which rows are copied.
    pub(super) async fn open_source(&self) -> Result<Connection, TransferError> {
        let mut inspection = match self {
            Self::File(path) => Inspection::open(path).await?,
            Self::Server(url) => Inspection::connect(url).await?,
        };
        let steps = inspection.steps().await?.len();
        inspection.close().await?;
        match steps.cmp(&MIGRATIONS.len()) {
            Ordering::Less => return Err(StoreError::OlderDatabase.into()),
            Ordering::Equal => {}
            Ordering::Greater => return Err(StoreError::NewerDatabase { step: MIGRATIONS.len() as i64 + 1 }.into()),
        }
        match self {
            Self::File(path) => Ok(Connection::SqliteFile(connect_file(path).await?)),
            Self::Server(url) => Ok(Connection::PostgresServer(connect_alone(url).await?)),
        }
    }

    /// Opens the database into which rows are copied, and makes its tables.
    pub(super) async fn open_target(&self) -> Result<Connection, TransferError> {
        match self {
            Self::File(path) => {
                if !path.exists() {
                    create_private(path)?;
                }
                let mut connection = connect_file(path).await?;
                let migrator = migrator(MIGRATIONS.len(), |step| step.sqlite);
                migrator.run(&mut connection).await.map_err(migration_error)?;
                Ok(Connection::SqliteFile(connection))
            }
            Self::Server(url) => {
                let mut connection = connect_alone(url).await?;
                let migrator = migrator(MIGRATIONS.len(), |step| step.postgres);
                migrator.run(&mut connection).await.map_err(migration_error)?;
                Ok(Connection::PostgresServer(connection))
            }
        }
    }
}

async fn connect_file(path: &Path) -> Result<SqliteConnection, TransferError> {
    Ok(connect_options(path).create_if_missing(false).connect().await?)
}

/// Connects to a database of PostgreSQL and takes the turn of its writers, which then wait until the connection ends.
async fn connect_alone(url: &str) -> Result<PgConnection, TransferError> {
    let options = postgres_options(url)?.application_name("lightpath migrate");
    let mut connection = connect_once(&options).await?;
    let turn = concat!("select pg_try_advisory_lock(", turn!(), ")");
    let served = "select exists (select 1 from pg_stat_activity where datname = current_database() \
                  and application_name = 'lightpath')";
    // The connections of a server, or of an earlier move, that has just ended take a moment to close.
    let mut has_turn = false;
    for _ in 0..CLOSING_CHECKS {
        if !has_turn {
            has_turn = sqlx::query_scalar(turn).fetch_one(&mut connection).await?;
        }
        if has_turn && !sqlx::query_scalar::<_, bool>(served).fetch_one(&mut connection).await? {
            return Ok(connection);
        }
        tokio::time::sleep(CLOSING_PAUSE).await;
    }
    Err(TransferError::Served)
}

/// Marks the target and turns its triggers off, in one transaction.
pub(super) async fn mark(to: &mut Connection, source: &str, tables: &[Table]) -> Result<(), TransferError> {
    run_all("begin", to).await?;
    run_all("create table unfinished_transfer (source text not null, triggers text)", to).await?;
    // SQLite cannot turn a trigger off, so its text is kept.
    let mut triggers = Vec::new();
    if to.is_postgres() {
        for table in tables {
            run(to, format!("alter table {} disable trigger user", table.name)).await?;
        }
    } else {
        let found = query("select name, sql from sqlite_master where type = 'trigger' order by name");
        for row in found.fetch_all(&mut *to).await? {
            run(to, format!("drop trigger {}", row.try_get::<String>("name")?)).await?;
            triggers.push(row.try_get::<String>("sql")?);
        }
    }
    let triggers = to_json("unfinished_transfer.triggers", &triggers)?;
    let insert = query("insert into unfinished_transfer values ($1, $2)").bind((source, triggers));
    insert.execute(&mut *to).await?;
    run_all("commit", to).await?;
    Ok(())
}

/// Turns the triggers on, records the place of the artifacts, and removes the marker, in one transaction.
pub(super) async fn unmark(to: &mut Connection, place: Option<&str>, tables: &[Table]) -> Result<(), TransferError> {
    run_all("begin", to).await?;
    if to.is_postgres() {
        for table in tables {
            run(to, format!("alter table {} enable trigger user", table.name)).await?;
        }
    } else {
        let triggers: String = scalar("select triggers from unfinished_transfer").fetch_one(&mut *to).await?;
        let triggers: Vec<String> = from_json("unfinished_transfer.triggers", &triggers)?;
        for trigger in triggers {
            run(to, trigger).await?;
        }
    }
    if let Some(place) = place {
        query("insert into artifact_place values (1, $1)").bind(place).execute(&mut *to).await?;
    }
    run_all("drop table unfinished_transfer", to).await?;
    run_all("commit", to).await?;
    if to.is_postgres() {
        run_all("analyze", to).await?;
    }
    Ok(())
}

/// The last number that the database gave to a row of the table, which may be deleted; 0: none.
pub(super) async fn last_number(connection: &mut Connection, table: &str, column: &str) -> Result<i64, TransferError> {
    let given = match connection.is_postgres() {
        true => "select coalesce(pg_sequence_last_value(pg_get_serial_sequence($1, $2)::regclass), 0)",
        false => "select coalesce((select seq from sqlite_sequence where name = $1 and $2 <> ''), 0)",
    };
    // Kernels are never deleted, and numbers that PostgreSQL has left out may be given again in SQLite.
    let given: i64 = match table {
        "kernel" => 0,
        _ => scalar(given).bind((table, column)).fetch_one(&mut *connection).await?,
    };
    let stored = Builder::new(format!("select coalesce(max({column}), 0) from {table}")).build();
    let stored: i64 = stored.fetch_one(connection).await?.try_get(0)?;
    Ok(given.max(stored))
}

/// Makes the database continue behind this number.
pub(super) async fn set_last_number(
    connection: &mut Connection,
    table: &str,
    column: &str,
    last: i64,
) -> Result<(), TransferError> {
    if connection.is_postgres() {
        let set = "select setval(pg_get_serial_sequence($1, $2), max($3, 1), $3 > 0)";
        scalar::<i64>(set).bind((table, column, last)).fetch_one(connection).await?;
        return Ok(());
    }
    // Only tables that never give a number again are listed there.
    let counts = "select exists (select 1 from sqlite_master where name = $1 and sql like '%autoincrement%')";
    if last > 0 && scalar(counts).bind(table).fetch_one(&mut *connection).await? {
        query("delete from sqlite_sequence where name = $1").bind(table).execute(&mut *connection).await?;
        let set = query("insert into sqlite_sequence (name, seq) values ($1, $2)").bind((table, last));
        set.execute(connection).await?;
    }
    Ok(())
}

async fn run(connection: &mut Connection, statement: String) -> Result<(), TransferError> {
    Builder::new(statement).build().execute(connection).await?;
    Ok(())
}
