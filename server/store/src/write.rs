//! Write transactions.

use super::changes::Change;
use super::{Store, StoreError};
use futures::future::BoxFuture;
use lightpath_fail_points as fail;
use sqlx::pool::PoolConnection;
use sqlx::{Sqlite, SqliteConnection};

/// A transaction that reads first and writes later fails with BUSY however long it waits, unless it begins so.
const BEGIN: &str = "begin immediate";

/// A write transaction, and what it will announce once it is on disk.
#[derive(Debug)]
pub(super) struct Write {
    connection: PoolConnection<Sqlite>,
    changes: Vec<Change>,
}

impl Write {
    pub(super) fn sql(&mut self) -> &mut SqliteConnection {
        &mut self.connection
    }

    /// Begins. SQLite ends some transactions that fail by itself (on a full disk, say) and leaves others open, so both are
    /// expected here; sqlx's own transactions fail the next one for it.
    async fn begin(mut connection: PoolConnection<Sqlite>) -> Result<Self, StoreError> {
        if sqlx::query(BEGIN).execute(&mut *connection).await.is_err() {
            // A panic has left one open, or somebody else holds the database: then this tells.
            drop(sqlx::query("rollback").execute(&mut *connection).await);
            sqlx::query(BEGIN).execute(&mut *connection).await?;
        }
        Ok(Self { connection, changes: Vec::new() })
    }

    async fn commit(&mut self) -> Result<(), StoreError> {
        fail::point("commit").map_err(sqlx::Error::Io)?;
        sqlx::query("commit").execute(self.sql()).await?;
        // What is on disk is done, whoever fails to tell.
        drop(fail::point("committed"));
        Ok(())
    }

    async fn undo(&mut self) {
        // What fails here has been undone already.
        drop(sqlx::query("rollback").execute(self.sql()).await);
    }

    pub(super) fn announce(&mut self, change: Change) {
        self.changes.push(change);
    }
}

impl Store {
    /// Waits until nobody writes, and writes nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] where somebody else holds the database for too long.
    pub async fn take_turn(&self) -> Result<(), StoreError> {
        self.write(|_| Box::pin(async { Ok(()) })).await
    }

    /// Runs `work` in a transaction of its own task: whole or not at all, even where the caller goes away.
    pub(super) async fn write<T, W>(&self, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'w> FnOnce(&'w mut Write) -> BoxFuture<'w, Result<T, StoreError>> + Send + 'static,
    {
        let store = self.clone();
        let task = tokio::spawn(async move {
            let mut write = Write::begin(store.inner.writer.acquire().await?).await?;
            let outcome = match work(&mut write).await {
                Ok(value) => write.commit().await.map(|()| value),
                Err(error) => Err(error),
            };
            match &outcome {
                Ok(_) => store.inner.changes.publish(write.changes),
                Err(_) => write.undo().await,
            }
            outcome
        });
        match task.await {
            Ok(outcome) => outcome,
            Err(error) => match error.try_into_panic() {
                Ok(panic) => std::panic::resume_unwind(panic),
                Err(_) => Err(StoreError::Stopping),
            },
        }
    }
}
