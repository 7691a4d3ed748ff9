//! The handle to the database, and what it holds.

use super::changes::Changes;
use super::database_time::DatabaseTime;
use super::living::Living;
use super::sql::Pool;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio_util::task::AbortOnDropHandle;
use uuid::Uuid;

/// A handle to the database; see the documentation of the crate.
#[derive(Clone, Debug)]
pub struct Store {
    pub(super) inner: Arc<Inner>,
}

#[derive(Debug)]
pub(super) struct Inner {
    pub(super) writers: Pool,
    pub(super) readers: Pool,
    pub(super) changes: Changes,
    /// The file of SQLite.
    pub(super) path: Option<PathBuf>,
    pub(super) time: DatabaseTime,
    pub(super) living: Living,
    /// Name of this handle for others, so that it does not hear itself.
    pub(super) process: String,
    /// The task that hears of the changes of other processes.
    pub(super) listener: Mutex<Option<AbortOnDropHandle<()>>>,
}

impl Store {
    pub(super) fn of(writers: Pool, readers: Pool, path: Option<PathBuf>) -> Self {
        let (changes, process) = (Changes::default(), Uuid::now_v7().to_string());
        let (time, living) = (DatabaseTime::default(), Living::default());
        let listener = Mutex::default();
        Self { inner: Arc::new(Inner { writers, readers, changes, path, time, living, process, listener }) }
    }

    /// Waits for operations in progress and closes the database. Later calls fail.
    pub async fn close(&self) {
        drop(self.inner.listener.lock().unwrap_or_else(PoisonError::into_inner).take());
        self.inner.readers.close().await;
        self.inner.writers.close().await;
    }

    pub(super) fn readers(&self) -> &Pool {
        &self.inner.readers
    }

    /// Present time \[ms since 1970\]: of PostgreSQL's clock, or of the system's clock for SQLite.
    #[must_use]
    pub fn now_ms(&self) -> i64 {
        self.inner.time.now_ms()
    }

    /// Whether other processes may work on the same database.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        self.readers().is_postgres()
    }

    /// Time since PostgreSQL's clock was seen to be set; `None` if it was not, and for SQLite.
    #[must_use]
    pub fn since_time_jump(&self) -> Option<Duration> {
        self.inner.time.since_jump()
    }
}
