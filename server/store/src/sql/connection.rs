//! Connections to either database.

use super::turns::{Turn, Turns};
use sqlx::pool::PoolConnection;
use sqlx::{Connection as _, PgConnection, PgPool, Postgres, Sqlite, SqliteConnection, SqlitePool, Transaction};

/// A connection to either database.
#[derive(Debug)]
pub(crate) enum Connection {
    /// One of a pool.
    Sqlite(Held<PoolConnection<Sqlite>>),
    /// One of a pool.
    Postgres(Held<PoolConnection<Postgres>>),
    /// One that belongs to no pool.
    SqliteFile(SqliteConnection),
    /// One that belongs to no pool.
    PostgresServer(PgConnection),
    /// A transaction that only reads, and sees one state of the database.
    SqliteSnapshot(Held<Transaction<'static, Sqlite>>),
    /// A transaction that only reads, and sees one state of the database.
    PostgresSnapshot(Held<Transaction<'static, Postgres>>),
}

/// What a client holds of a pool.
#[derive(Debug)]
pub(crate) struct Held<C> {
    connection: C,
    /// Dropped after the connection, so that the next client finds it.
    _turn: Turn,
}

/// Connections to either database, at which clients take turns.
#[derive(Clone, Debug)]
pub(crate) struct Pool {
    raw: RawPool,
    turns: Turns,
}

/// Connections as their database knows them.
#[derive(Clone, Debug)]
pub(crate) enum RawPool {
    Sqlite(SqlitePool),
    Postgres(PgPool),
}

/// A connection as its database knows it.
pub(super) enum Raw<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
}

/// Where a statement runs.
pub(crate) trait Target {
    /// The connection of the statement, which is returned to its pool afterwards if it has one.
    fn connect(&mut self) -> impl Future<Output = Result<Lent<'_>, sqlx::Error>> + Send;
}

/// A connection for one statement.
pub(crate) enum Lent<'c> {
    Borrowed(&'c mut Connection),
    Own(Box<Connection>),
}

impl Lent<'_> {
    pub(super) fn raw(&mut self) -> Raw<'_> {
        match self {
            Self::Borrowed(connection) => connection.raw(),
            Self::Own(connection) => connection.raw(),
        }
    }
}

impl Connection {
    pub(super) fn raw(&mut self) -> Raw<'_> {
        match self {
            Self::Sqlite(held) => Raw::Sqlite(&mut held.connection),
            Self::SqliteFile(connection) => Raw::Sqlite(connection),
            Self::Postgres(held) => Raw::Postgres(&mut held.connection),
            Self::PostgresServer(connection) => Raw::Postgres(connection),
            Self::SqliteSnapshot(held) => Raw::Sqlite(&mut held.connection),
            Self::PostgresSnapshot(held) => Raw::Postgres(&mut held.connection),
        }
    }

    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self, Self::Postgres(_) | Self::PostgresServer(_) | Self::PostgresSnapshot(_))
    }

    /// Closes a connection of a pool of PostgreSQL when it is dropped, so that its transaction ends with it.
    pub(crate) fn close_on_drop(&mut self) {
        if let Self::Postgres(held) = self {
            held.connection.close_on_drop();
        }
    }

    /// Closes a connection that belongs to no pool, and returns others to theirs.
    pub(crate) async fn close(self) -> Result<(), sqlx::Error> {
        match self {
            Self::SqliteFile(connection) => connection.close().await,
            Self::PostgresServer(connection) => connection.close().await,
            _ => Ok(()),
        }
    }
}

impl Pool {
    pub(crate) fn sqlite(pool: SqlitePool) -> Self {
        Self { turns: Turns::new(pool.options().get_max_connections()), raw: RawPool::Sqlite(pool) }
    }

    pub(crate) fn postgres(pool: PgPool) -> Self {
        Self { turns: Turns::new(pool.options().get_max_connections()), raw: RawPool::Postgres(pool) }
    }

    pub(crate) fn raw(&self) -> &RawPool {
        &self.raw
    }

    /// A connection for several statements, each of which sees the newest state.
    pub(crate) async fn acquire(&self) -> Result<Connection, sqlx::Error> {
        let turn = self.turns.wait().await?;
        match &self.raw {
            RawPool::Sqlite(pool) => Ok(Connection::Sqlite(Held { connection: pool.acquire().await?, _turn: turn })),
            RawPool::Postgres(pool) => {
                Ok(Connection::Postgres(Held { connection: pool.acquire().await?, _turn: turn }))
            }
        }
    }

    /// Begins a transaction that only reads, and sees one state of the database.
    pub(crate) async fn begin(&self) -> Result<Connection, sqlx::Error> {
        const BEGIN: &str = "begin isolation level repeatable read, read only";
        let turn = self.turns.wait().await?;
        match &self.raw {
            RawPool::Sqlite(pool) => {
                Ok(Connection::SqliteSnapshot(Held { connection: pool.begin().await?, _turn: turn }))
            }
            RawPool::Postgres(pool) => {
                Ok(Connection::PostgresSnapshot(Held { connection: pool.begin_with(BEGIN).await?, _turn: turn }))
            }
        }
    }

    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self.raw, RawPool::Postgres(_))
    }

    /// Waits for statements in progress and closes the connections.
    pub(crate) async fn close(&self) {
        match &self.raw {
            RawPool::Sqlite(pool) => pool.close().await,
            RawPool::Postgres(pool) => pool.close().await,
        }
    }
}

impl Target for &mut Connection {
    async fn connect(&mut self) -> Result<Lent<'_>, sqlx::Error> {
        Ok(Lent::Borrowed(self))
    }
}

impl Target for &Pool {
    async fn connect(&mut self) -> Result<Lent<'_>, sqlx::Error> {
        Ok(Lent::Own(Box::new(self.acquire().await?)))
    }
}
