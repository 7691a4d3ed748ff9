//! Tells webhooks what happened: each event at least once, signed, and only to addresses that the operator allows.
//!
//! The transaction of an event also writes its deliveries, so none is lost. A delivery waits until the receiver accepts
//! it. When the program dies between an answer and its note, the next start repeats the attempt with the same id.
//!
//! # Layout
//!
//! - this file: the loop that finds what is due. `schedule`: when there is another attempt. `message`: the body and its
//!   signature. `sender`: one attempt over HTTP.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod message;
mod schedule;
mod sender;

use lightpath_domain::origin::Origins;
use lightpath_store::{Store, StoreError};
use message::Message;
use sender::{Answer, Sender};
use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;

/// Least time between two searches for what is due, so that many events at once are one search.
const SEARCH_INTERVAL: Duration = Duration::from_millis(50);
/// Longest time between two searches, in case the clock was set.
const SEARCH_INTERVAL_MAX: Duration = Duration::from_secs(30);
/// Time for which other processes do not tell a webhook that this one tells \[ms\]: longer than an attempt takes.
const HOLD_MS: i64 = 30_000;
/// Longest time for letting go of the webhooks at the end.
const RELEASE_MAX: Duration = Duration::from_secs(2);
/// Pause after an error of the database, or while another process tells a webhook.
const PAUSE_AFTER_ERROR: Duration = Duration::from_secs(5);

/// Sends what webhooks are to learn until `stopping` is cancelled. A slow receiver delays its own webhook only. Of
/// the processes that share a database, one at a time tells a webhook; at the end this one lets go of those it tells.
pub async fn run(store: Store, origins: Origins, stopping: CancellationToken) {
    let deliverer = Arc::new(Deliverer { store, origins, sender: Sender::new() });
    let mut busy = HashSet::new();
    stopping.run_until_cancelled(deliver(&deliverer, &mut busy)).await;
    // Without the database, the holds end by themselves.
    drop(timeout(RELEASE_MAX, deliverer.release(busy)).await);
}

#[derive(Debug)]
struct Deliverer {
    store: Store,
    origins: Origins,
    sender: Sender,
}

/// Starts a task for each webhook that something is due for. `busy` has those that have one.
async fn deliver(deliverer: &Arc<Deliverer>, busy: &mut HashSet<String>) {
    let news = deliverer.store.deliverable();
    // Each task tells one webhook everything that is due.
    let mut tasks = JoinSet::<String>::new();
    loop {
        while let Some(ended) = tasks.try_join_next() {
            // A task that panicked keeps its webhook busy, which stops a loop of panics until the next start.
            if let Ok(id) = ended {
                busy.remove(&id);
            }
        }
        let wait = match deliverer.store.webhooks_due(deliverer.store.now_ms()).await {
            Ok(due) => {
                for id in due {
                    if busy.insert(id.clone()) {
                        tasks.spawn(tell(Arc::clone(deliverer), id));
                    }
                }
                deliverer.until_next().await
            }
            Err(error) => {
                tracing::error!(error = &error as &dyn std::error::Error, "webhooks could not be read; trying again");
                PAUSE_AFTER_ERROR
            }
        };
        sleep(SEARCH_INTERVAL).await;
        tokio::select! {
            () = sleep(wait) => {}
            () = news.notified() => {}
            Some(ended) = tasks.join_next() => if let Ok(id) = ended {
                busy.remove(&id);
            },
        }
    }
}

/// Tells a webhook everything that is due. Returns its id.
async fn tell(deliverer: Arc<Deliverer>, webhook: String) -> String {
    let told = deliverer.tell(&webhook).await;
    let released = deliverer.store.release_webhook(&webhook).await;
    if let Err(error) = told.and(released) {
        // The delivery still waits, and the next search finds it.
        tracing::error!(
            error = &error as &dyn std::error::Error,
            webhook,
            "the webhook could not be told; trying again"
        );
        sleep(PAUSE_AFTER_ERROR).await;
    }
    webhook
}

impl Deliverer {
    /// Lets go of webhooks whose tasks have been ended, so that another process need not wait until the holds end.
    async fn release(&self, webhooks: HashSet<String>) {
        for id in webhooks {
            if let Err(error) = self.store.release_webhook(&id).await {
                let error: &dyn std::error::Error = &error;
                tracing::warn!(error, webhook = id, "the webhook is told by others only after {HOLD_MS} ms");
            }
        }
    }

    async fn until_next(&self) -> Duration {
        match self.store.next_attempt_ms().await {
            Ok(Some(next_ms)) => {
                let wait_ms = next_ms.saturating_sub(self.store.now_ms()).max(0).unsigned_abs();
                // What is due already is being told, and its task wakes the loop.
                let wait = if wait_ms == 0 { SEARCH_INTERVAL_MAX } else { Duration::from_millis(wait_ms) };
                wait.min(SEARCH_INTERVAL_MAX)
            }
            Ok(None) => SEARCH_INTERVAL_MAX,
            Err(_) => PAUSE_AFTER_ERROR,
        }
    }

    async fn tell(&self, id: &str) -> Result<(), StoreError> {
        loop {
            if !self.store.hold_webhook(id, self.store.now_ms(), HOLD_MS).await? {
                // Another process sends the webhook's events, or died while it did.
                sleep(PAUSE_AFTER_ERROR).await;
                return Ok(());
            }
            // Read after that, because another process may have told everything before it let go.
            let Some(delivery) = self.store.due_delivery(id, self.store.now_ms()).await? else { return Ok(()) };
            let webhook = match self.store.webhook(id).await {
                // It was deleted meanwhile, with its deliveries.
                Err(StoreError::NotFound { .. }) => return Ok(()),
                other => other?,
            };
            let answer = if self.origins.contains(webhook.url.origin()) {
                let message = Message::of(&delivery, &self.store.webhook_secret(id).await?, self.store.now_ms());
                self.sender.send(webhook.url.as_str(), message).await
            } else {
                Answer::refused(format!("the setting webhook_origins does not allow {}", webhook.url.origin()))
            };
            let attempt = schedule::after(&delivery, &answer, self.store.now_ms());
            lightpath_metrics::webhook_attempt(answer.is_accepted());
            tracing::debug!(webhook = id, delivery = delivery.id, answer = answer.text(), "told a webhook");
            self.store.note_attempt(&delivery, attempt, answer.text()).await?;
        }
    }
}
