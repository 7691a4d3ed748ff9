//! Changes by other processes that work on the same PostgreSQL database.
//!
//! A writer notifies the others in its transaction, so they hear of a change after its commit and of no other. A notice
//! is lost only together with the connection. When it is back, all that may have changed since is announced again, and
//! workers look into the queue from time to time in any case. So a lost notice delays, and no more.

use super::changes::Change;
use super::kernel_filter::KernelFilter;
use super::rows::to_json;
use super::sql::scalar;
use super::store::Inner;
use super::{Changed, Result, Store};
use serde::{Deserialize, Serialize};
use sqlx::postgres::PgListener;
use std::collections::HashSet;
use std::sync::{Arc, PoisonError, Weak};
use std::time::Duration;
use tokio::time::sleep;
use tokio_util::task::AbortOnDropHandle;

/// Sends a notice to all who listen.
pub(super) const NOTIFY: &str = "select pg_notify('lightpath', $1)";

/// Limit on the size of a notice \[bytes\]; that of PostgreSQL is 8000.
const NOTICE_BYTES_MAX: usize = 7000;

/// Longest time for which a job can be ready, or a webhook due, without anybody looking.
const LOOK_INTERVAL: Duration = Duration::from_secs(5);

/// Pause before another attempt to connect.
const RECONNECT_PAUSE: Duration = Duration::from_secs(1);

/// Jobs that are announced again after the connection was lost, the newest first.
const ANNOUNCED_AGAIN_MAX: i64 = 10_000;

#[derive(Debug, Serialize, Deserialize)]
struct Notice<C> {
    /// Who changed it.
    process: String,
    changes: Vec<C>,
}

/// The texts of the notices about these changes by `process`. Repeated changes are said once.
pub(super) fn messages(process: &str, changes: &[Change]) -> Result<Vec<String>> {
    let mut said = HashSet::new();
    let mut rest: Vec<&Change> = changes.iter().filter(|change| said.insert(*change)).collect();
    let mut messages = Vec::new();
    while !rest.is_empty() {
        let mut count = rest.len();
        loop {
            let notice = Notice { process: process.to_owned(), changes: rest[..count].to_vec() };
            let message = to_json("notice", &notice)?;
            if message.len() <= NOTICE_BYTES_MAX || count == 1 {
                messages.push(message);
                break;
            }
            count = count.div_ceil(2);
        }
        rest.drain(..count);
    }
    Ok(messages)
}

impl Store {
    /// Begins to hear of the changes of other processes.
    pub(super) async fn listen(&self, mut listener: PgListener) -> Result<()> {
        listener.listen("lightpath").await?;
        let inner = Arc::downgrade(&self.inner);
        let task = AbortOnDropHandle::new(tokio::spawn(async move {
            tokio::join!(hear(inner.clone(), listener), look(inner));
        }));
        *self.inner.listener.lock().unwrap_or_else(PoisonError::into_inner) = Some(task);
        Ok(())
    }

    /// Announces everything that may have changed while nobody listened.
    async fn announce_again(&self) -> Result<()> {
        let sql = "select id from job order by id desc limit $1";
        let jobs: Vec<String> = scalar(sql).bind(ANNOUNCED_AGAIN_MAX).fetch_all(self.readers()).await?;
        let mut changes: Vec<Change> = jobs.into_iter().map(Change::Job).collect();
        let cancelled: Vec<String> = scalar("select id from job where state = 'running' and cancel_requested = 1")
            .fetch_all(self.readers())
            .await?;
        changes.extend(cancelled.into_iter().map(Change::Cancel));
        let mut after = None;
        loop {
            let kernels = self.kernels(&KernelFilter::default(), after.as_deref(), super::LIMIT_MAX).await?;
            let Some(last) = kernels.last() else { break };
            after = Some(last.key.to_string());
            changes.extend(kernels.into_iter().map(|kernel| Change::Kernel(kernel.key)));
        }
        let displays: Vec<String> = scalar("select id from display").fetch_all(self.readers()).await?;
        changes.extend(displays.into_iter().map(|id| Change::Other(Changed::Display(id))));
        changes.extend([Change::Other(Changed::Queue), Change::Claimable, Change::Deliverable]);
        self.inner.changes.publish(changes);
        Ok(())
    }
}

/// Passes on what others announce, as long as the store is open.
async fn hear(inner: Weak<Inner>, mut listener: PgListener) {
    loop {
        let heard = listener.try_recv().await;
        let Some(store) = upgrade(&inner) else { return };
        match heard {
            Ok(Some(notice)) => match serde_json::from_str::<Notice<Change>>(notice.payload()) {
                Ok(notice) if notice.process == store.inner.process => continue,
                Ok(notice) => {
                    store.inner.changes.publish(notice.changes);
                    continue;
                }
                // It comes from another version of the program: look at everything.
                Err(_) => {}
            },
            // The connection was lost, and the listener makes a new one.
            Ok(None) => {}
            Err(_) => {
                drop(store);
                // Listens again on a new connection. What happened until then is announced below.
                while listener.listen("lightpath").await.is_err() {
                    sleep(RECONNECT_PAUSE).await;
                }
            }
        }
        while let Some(store) = upgrade(&inner) {
            if store.announce_again().await.is_ok() {
                break;
            }
            drop(store);
            sleep(RECONNECT_PAUSE).await;
        }
    }
}

fn upgrade(inner: &Weak<Inner>) -> Option<Store> {
    inner.upgrade().map(|inner| Store { inner })
}

/// Makes workers look into the queue from time to time, and asks for the database's time.
async fn look(inner: Weak<Inner>) {
    loop {
        sleep(LOOK_INTERVAL).await;
        let Some(inner) = inner.upgrade() else { return };
        // Without an answer the time counts on evenly.
        drop(inner.time.read(&inner.readers).await);
        inner.changes.publish(vec![Change::Claimable, Change::Deliverable]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notices_are_small_and_say_each_change_once() {
        let job = |n: u32| Change::Job(format!("0193{n:032}"));
        let changes: Vec<Change> = (0..1000).map(|n| job(n / 2)).chain([Change::Claimable]).collect();
        let messages = messages("me", &changes).unwrap();
        assert!(messages.len() > 1 && messages.iter().all(|message| message.len() <= NOTICE_BYTES_MAX));
        let read = messages.iter().flat_map(|message| serde_json::from_str::<Notice<Change>>(message).unwrap().changes);
        let expected: Vec<Change> = (0..500).map(job).chain([Change::Claimable]).collect();
        assert_eq!(read.collect::<Vec<_>>(), expected);
        assert!(super::messages("me", &[]).unwrap().is_empty());
    }
}
