//! Write transactions.

use super::changes::{Change, Changed};
use super::connect::POSTGRES_WRITERS;
use super::notices;
use super::sql::{Connection, Pool, for_same_client, query, run_all};
use super::{Result, Store, StoreError};
use lightpath_fail_points as fail;
use std::pin::Pin;
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::time::timeout;

/// In SQLite a transaction that reads first and writes later fails with BUSY however long it waits, unless it begins
/// `immediate`.
const BEGIN_SQLITE: &str = "begin immediate";

const BEGIN_POSTGRES: &str = "begin";

/// The advisory lock of PostgreSQL by which the writers of all processes take turns.
macro_rules! turn {
    () => {
        "7809632219837"
    };
}
pub(super) use turn;

/// Takes the lock in a statement of its own, so that the statements after it see what the writer before has committed.
const BEGIN_IN_TURN_POSTGRES: &str = concat!("begin; select pg_advisory_xact_lock(", turn!(), ")");

/// Longest time of a write in PostgreSQL, with the wait for its turn.
const WRITE_MAX: Duration = Duration::from_secs(60);

/// A write transaction, with the changes to announce after its commit.
#[derive(Debug)]
pub(super) struct Write {
    connection: Connection,
    changes: Vec<Change>,
    /// Whether the transaction was committed or rolled back.
    ended: bool,
}

impl Drop for Write {
    /// After a panic the transaction is still open. SQLite's next writer ends it, see [`Write::begin`]. In PostgreSQL it
    /// would keep the turn of all writers, so its connection does not return to the pool.
    fn drop(&mut self) {
        if !self.ended {
            self.connection.close_on_drop();
        }
    }
}

impl Write {
    pub(super) fn sql(&mut self) -> &mut Connection {
        &mut self.connection
    }

    async fn begin(writers: &Pool, in_turn: bool) -> Result<Self> {
        let connection = match writers.is_postgres() {
            true => begin_postgres(writers, in_turn).await?,
            false => begin_sqlite(writers).await?,
        };
        Ok(Self { connection, changes: Vec::new(), ended: false })
    }

    async fn commit(&mut self, process: &str) -> Result<()> {
        if self.connection.is_postgres() {
            for message in notices::messages(process, &self.changes)? {
                query(notices::NOTIFY).bind(message).execute(self.sql()).await?;
            }
        }
        fail::point("commit").map_err(|error| StoreError::Database(sqlx::Error::Io(error)))?;
        query("commit").execute(self.sql()).await?;
        self.ended = true;
        // The commit is on disk, so a failure after it is not an error.
        drop(fail::point("committed"));
        Ok(())
    }

    async fn undo(&mut self) {
        // If the rollback fails, SQLite has already ended the transaction.
        self.ended = query("rollback").execute(self.sql()).await.is_ok();
    }

    pub(super) fn announce(&mut self, change: Change) {
        self.changes.push(change);
    }

    /// Announces a change that only listeners who follow everything want to know.
    pub(super) fn announce_changed(&mut self, changed: Changed) {
        self.announce(Change::Other(changed));
    }
}

/// Begins a transaction. After an error (for example a full disk), SQLite ends some transactions by itself and leaves
/// others open. This function accepts both; a transaction of sqlx would make the next one fail.
async fn begin_sqlite(writers: &Pool) -> Result<Connection> {
    let mut connection = writers.acquire().await?;
    if query(BEGIN_SQLITE).execute(&mut connection).await.is_err() {
        // Either a panic left a transaction open, or another process holds the database. The second attempt shows
        // which.
        drop(query("rollback").execute(&mut connection).await);
        query(BEGIN_SQLITE).execute(&mut connection).await?;
    }
    Ok(connection)
}

/// Begins a transaction. The pool does not test its connections, because that takes another message. So after a restart of
/// the server the first statement fails on each connection, and another connection is taken.
async fn begin_postgres(writers: &Pool, in_turn: bool) -> Result<Connection> {
    let begin = if in_turn { BEGIN_IN_TURN_POSTGRES } else { BEGIN_POSTGRES };
    let mut spare = POSTGRES_WRITERS;
    loop {
        let mut connection = writers.acquire().await?;
        let Err(error) = run_all(begin, &mut connection).await else { return Ok(connection) };
        // The transaction may have begun, and would keep the turn of all writers.
        connection.close_on_drop();
        if spare == 0 {
            return Err(error.into());
        }
        spare -= 1;
    }
}

fn timed_out() -> StoreError {
    sqlx::Error::Io(std::io::ErrorKind::TimedOut.into()).into()
}

/// What a transaction does: an async closure.
pub(super) trait Work<T>: AsyncFnOnce(&mut Write) -> Result<T> + for<'w> Movable<'w, T> + 'static {}

impl<T, W: AsyncFnOnce(&mut Write) -> Result<T> + for<'w> Movable<'w, T> + 'static> Work<T> for W {}

/// An async closure that may move to another thread, with its future. A bound of an `AsyncFnOnce` cannot say this yet.
pub(super) trait Movable<'w, T>: FnOnce(&'w mut Write) -> Self::Future + Send {
    type Future: Future<Output = Result<T>> + Send + 'w;
}

impl<'w, T, W, F> Movable<'w, T> for W
where
    W: FnOnce(&'w mut Write) -> F + Send,
    F: Future<Output = Result<T>> + Send + 'w,
{
    type Future = F;
}

/// The same without its types. So all transactions are one task, which is compiled once and not in each crate that
/// writes.
type BoxedWork = Box<dyn for<'w> FnOnce(&'w mut Write) -> BoxedFuture<'w> + Send>;
type BoxedFuture<'w> = Pin<Box<dyn Future<Output = Result<()>> + Send + 'w>>;

/// Boxes `work`, which then sends its value to the receiver.
fn boxed<T: Send + 'static>(work: impl Work<T>) -> (BoxedWork, oneshot::Receiver<T>) {
    // A closure alone is not taken for one that works for every lifetime.
    fn for_any_lifetime(work: impl for<'w> FnOnce(&'w mut Write) -> BoxedFuture<'w> + Send + 'static) -> BoxedWork {
        Box::new(work)
    }
    let (give, value) = oneshot::channel();
    let work = for_any_lifetime(|write| {
        let work = work(write);
        Box::pin(async {
            drop(give.send(work.await?));
            Ok(())
        })
    });
    (work, value)
}

impl Store {
    /// Waits until this call could write, and writes nothing. Earlier writes have ended then.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`] if another process holds the database for too long.
    pub async fn wait_for_writer(&self) -> Result<()> {
        self.write(async move |_| Ok(())).await
    }

    /// Runs `work` in a write transaction, in a task of its own. The transaction happens completely or not at all, even
    /// if the caller drops the future. Writers take turns.
    pub(super) async fn write<T: Send + 'static>(&self, work: impl Work<T>) -> Result<T> {
        let (work, value) = boxed(work);
        self.run_write(true, work).await?;
        value.await.map_err(|_| StoreError::Stopping)
    }

    /// Does the same for `work` that is one statement about one row. In PostgreSQL it does not wait for its turn: the
    /// lock of the row is enough.
    pub(super) async fn write_row<T: Send + 'static>(&self, work: impl Work<T>) -> Result<T> {
        let (work, value) = boxed(work);
        self.run_write(false, work).await?;
        value.await.map_err(|_| StoreError::Stopping)
    }

    async fn run_write(&self, in_turn: bool, work: BoxedWork) -> Result<()> {
        let store = self.clone();
        let is_postgres = self.inner.writers.is_postgres();
        let work = async move {
            let mut write = Write::begin(&store.inner.writers, in_turn).await?;
            let outcome = match work(&mut write).await {
                Ok(()) => write.commit(&store.inner.process).await,
                Err(error) => Err(error),
            };
            match &outcome {
                Ok(()) => store.inner.changes.publish(std::mem::take(&mut write.changes)),
                Err(error) => {
                    // The commit may have happened, and only its answer been lost. A needless announcement does no harm.
                    if matches!(error, StoreError::Unreachable(_)) {
                        store.inner.changes.publish(std::mem::take(&mut write.changes));
                    }
                    write.undo().await;
                }
            }
            outcome
        };
        let task = async move {
            // A network that swallows everything would keep the connection for a quarter of an hour.
            if is_postgres { timeout(WRITE_MAX, work).await.unwrap_or_else(|_| Err(timed_out())) } else { work.await }
        };
        match tokio::spawn(for_same_client(task)).await {
            Ok(outcome) => outcome,
            Err(error) => match error.try_into_panic() {
                Ok(panic) => std::panic::resume_unwind(panic),
                Err(_) => Err(StoreError::Stopping),
            },
        }
    }
}
