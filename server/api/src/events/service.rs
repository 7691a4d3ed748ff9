//! Streams of events.

use super::publisher::publish;
use crate::accounts::{OpenStream, StreamKind};
use crate::api::Api;
use crate::call::{Answers, answers};
use crate::event_log::{Entry, EventLog, Since};
use futures::{StreamExt as _, stream};
use lightpath_domain::access::Caller;
use lightpath_proto::v1;
use lightpath_proto::v1::event::{Change, Reset};
use lightpath_proto::v1::event_service_server::EventService;
use lightpath_service::{Call, Result, ServiceError};
use std::collections::{HashSet, VecDeque};
use std::mem;
use std::sync::Arc;
use tokio::sync::watch;

answers! {
    EventService {}
    streams {
        watch_events(v1::WatchEventsRequest) -> v1::Event as WatchEventsStream;
    }
}

impl Api {
    pub(crate) async fn watch_events(
        &self,
        call: &Call,
        request: v1::WatchEventsRequest,
    ) -> Result<Answers<v1::Event>> {
        let open = self.streams.open(StreamKind::Watch, &call.client)?;
        let log = self.events.clone();
        log.start_once(|| {
            let changes = self.store.subscribe_changes();
            let on = (self.store.clone(), self.service.jobs.clone());
            drop(tokio::spawn(publish(on, log.clone(), changes, self.stopping.clone())));
        });
        let news = log.subscribe();
        let resumed =
            log.number(&request.last_event_id).filter(|number| matches!(log.since(*number), Since::Events(_)));
        let latest = *news.borrow();
        let follower = Follower {
            api: self.clone(),
            caller: call.caller.clone(),
            log,
            news,
            sent: resumed.unwrap_or(latest),
            must_reset: resumed.is_none(),
            waiting: VecDeque::new(),
            _open: open,
        };
        let events = stream::try_unfold(follower, |mut follower| async move {
            let event = follower.next().await?;
            Ok(Some((event, follower)))
        });
        Ok(events.boxed())
    }
}

/// A stream of events. The transport polls it only when the client can receive more. So a slow client skips states, and
/// needs no memory.
struct Follower {
    api: Api,
    caller: Caller,
    log: EventLog,
    news: watch::Receiver<u64>,
    /// Number of the latest event that `waiting` had.
    sent: u64,
    must_reset: bool,
    waiting: VecDeque<Arc<Entry>>,
    _open: OpenStream,
}

impl Follower {
    async fn next(&mut self) -> Result<v1::Event> {
        loop {
            if mem::take(&mut self.must_reset) {
                return Ok(self.event(self.sent, Change::Reset(Reset {})));
            }
            while let Some(entry) = self.waiting.pop_front() {
                if self.may_see(&entry) {
                    let change = self.seen(entry.message.clone()).await?;
                    return Ok(self.event(entry.number, change));
                }
            }
            self.fetch().await?;
        }
    }

    /// Waits for events after those sent, and takes the latest one about each thing.
    async fn fetch(&mut self) -> Result<()> {
        let sent = self.sent;
        let latest = tokio::select! {
            biased;
            () = self.api.stopping.cancelled() => return Err(ServiceError::Stopping),
            latest = self.news.wait_for(|latest| *latest > sent) => *latest.map_err(|_| ServiceError::Stopping)?,
        };
        match self.log.since(self.sent) {
            Since::Events(entries) => {
                let mut seen = HashSet::new();
                for entry in entries.into_iter().rev() {
                    self.sent = self.sent.max(entry.number);
                    if entry.changed.as_ref().is_none_or(|changed| seen.insert(changed.clone())) {
                        self.waiting.push_front(entry);
                    }
                }
            }
            Since::Missed => (self.sent, self.must_reset) = (latest, true),
        }
        Ok(())
    }

    fn may_see(&self, entry: &Entry) -> bool {
        let displays = &self.caller.displays;
        match (&entry.display, &entry.message) {
            _ if displays.is_empty() => true,
            (Some(display), _) => displays.contains(display),
            (None, message) => matches!(message, Change::Reset(_)),
        }
    }

    /// The change without the names of jobs that the caller may not see.
    async fn seen(&self, mut change: Change) -> Result<Change> {
        if let Change::Job(v1::JobSummary { error: Some(error), .. }) = &mut change {
            error.message = self.api.service.jobs.text_for(&self.caller, mem::take(&mut error.message)).await?;
        }
        Ok(change)
    }

    fn event(&self, number: u64, change: Change) -> v1::Event {
        v1::Event { id: self.log.id(number), change: Some(change) }
    }
}
