//! The task that turns announcements of the store into events.

use crate::event_log::EventLog;
use crate::jobs::to_wire;
use lightpath_domain::access::Caller;
use lightpath_proto::v1::event::{Change, Changed as Named, Reset};
use lightpath_service::Jobs;
use lightpath_store::{Changed, Store, StoreError};
use std::collections::HashSet;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::{RecvError, TryRecvError};
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// Time in which several changes of the same thing become one event.
const COLLECT: Duration = Duration::from_millis(100);

/// Fills the log until the server stops. The first changes are those after `changes` was subscribed.
pub(super) async fn publish(
    (store, jobs): (Store, Jobs),
    log: EventLog,
    changes: Receiver<Changed>,
    stopping: CancellationToken,
) {
    stopping.run_until_cancelled(fill(store, jobs, log, changes)).await;
}

async fn fill(store: Store, jobs: Jobs, log: EventLog, mut changes: Receiver<Changed>) {
    loop {
        let mut collected = Vec::new();
        let mut is_complete = true;
        match changes.recv().await {
            Ok(changed) => collected.push(changed),
            Err(RecvError::Lagged(_)) => is_complete = false,
            Err(RecvError::Closed) => return,
        }
        loop {
            match changes.try_recv() {
                Ok(changed) => collected.push(changed),
                Err(TryRecvError::Lagged(_)) => is_complete = false,
                Err(TryRecvError::Empty | TryRecvError::Closed) => break,
            }
        }
        let events = match is_complete {
            true => events(&store, &jobs, collected).await,
            false => None,
        };
        // Without announcements, or without the database, anything may have changed.
        log.append(events.unwrap_or_else(|| vec![(None, None, Change::Reset(Reset {}))]));
        sleep(COLLECT).await;
    }
}

/// One event for each thing that changed; `None`: the database cannot be read.
async fn events(
    store: &Store,
    jobs: &Jobs,
    changes: Vec<Changed>,
) -> Option<Vec<(Option<Changed>, Option<String>, Change)>> {
    let mut seen = HashSet::new();
    let mut events = Vec::new();
    for changed in changes {
        if !seen.insert(changed.clone()) {
            continue;
        }
        let (display, message) = match &changed {
            Changed::Job(id) => match store.job_summary(id).await {
                Ok(job) => {
                    // Everybody who may see the job reads the event, so it names only jobs on the same display.
                    let reader = Caller { displays: vec![job.display.clone()], ..Caller::without_token() };
                    let outlook = jobs.outlook(&reader, [(job.state, job.create_time_ms)]).await.ok()?;
                    (Some(job.display.clone()), Change::Job(to_wire::summary(&outlook, job)))
                }
                Err(StoreError::NotFound { .. }) => continue,
                Err(_) => return None,
            },
            Changed::Kernel(key) => (Some(key.display.clone()), Change::Kernel(named(key.to_string()))),
            Changed::Queue => (None, Change::Queue(named(String::new()))),
            Changed::Display(id) => (Some(id.clone()), Change::Display(named(format!("displays/{id}")))),
            Changed::Dataset { id, display } => {
                (Some(display.clone()), Change::Dataset(named(format!("datasets/{id}"))))
            }
            Changed::Device { display, id } => {
                (Some(display.clone()), Change::Device(named(format!("displays/{display}/devices/{id}"))))
            }
        };
        events.push((Some(changed), display, message));
    }
    Some(events)
}

fn named(name: String) -> Named {
    Named { name }
}
