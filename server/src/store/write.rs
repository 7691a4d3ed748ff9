//! Write transactions.

use super::changes::Change;
use super::{Store, StoreError};
use futures::future::BoxFuture;
use sqlx::{Sqlite, SqliteConnection, Transaction};

/// A write transaction, and what it will announce once it is on disk.
#[derive(Debug)]
pub(super) struct Write {
    transaction: Transaction<'static, Sqlite>,
    changes: Vec<Change>,
}

impl Write {
    pub(super) fn sql(&mut self) -> &mut SqliteConnection {
        &mut self.transaction
    }

    pub(super) fn announce(&mut self, change: Change) {
        self.changes.push(change);
    }
}

impl Store {
    /// Runs `work` in a transaction of its own task: whole or not at all, even where the caller goes away.
    pub(super) async fn write<T, W>(&self, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'w> FnOnce(&'w mut Write) -> BoxFuture<'w, Result<T, StoreError>> + Send + 'static,
    {
        let store = self.clone();
        let task = tokio::spawn(async move {
            let transaction = store.inner.writer.begin_with("begin immediate").await?;
            let mut write = Write { transaction, changes: Vec::new() };
            let value = work(&mut write).await?;
            write.transaction.commit().await?;
            store.inner.changes.publish(write.changes);
            Ok(value)
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
