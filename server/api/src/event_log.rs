//! The latest events, in memory.

use lightpath_proto::v1::event::Change;
use lightpath_store::Changed;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};
use tokio::sync::watch;

/// Events kept for clients that come back. The largest has about 700 bytes.
const EVENTS_KEPT: usize = 4096;

/// An event.
#[derive(Debug)]
pub(crate) struct Entry {
    /// Number of the event.
    pub(crate) number: u64,
    /// What changed; `None`: announcements were missed, so anything may have changed.
    pub(crate) changed: Option<Changed>,
    /// Id of the display that the change concerns; `None`: all displays.
    pub(crate) display: Option<String>,
    /// The change as a message.
    pub(crate) message: Change,
}

/// The latest events. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct EventLog(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    /// Start of the log \[ms since 1970\]. With it, the events of an earlier process of the server are recognized.
    start_ms: u128,
    entries: Mutex<VecDeque<Arc<Entry>>>,
    /// Number of the latest event; 0: none yet.
    latest: watch::Sender<u64>,
    publisher: Once,
}

/// Events after another one.
#[derive(Debug)]
pub(crate) enum Since {
    /// All events after it, the oldest first.
    Events(Vec<Arc<Entry>>),
    /// Some of them are no longer known.
    Missed,
}

impl Default for EventLog {
    fn default() -> Self {
        let start_ms = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis();
        let latest = watch::Sender::new(0);
        Self(Arc::new(Inner { start_ms, entries: Mutex::default(), latest, publisher: Once::new() }))
    }
}

impl EventLog {
    /// Runs `start` at the first call.
    pub(crate) fn start_once(&self, start: impl FnOnce()) {
        self.0.publisher.call_once(start);
    }

    /// Appends events, each with what changed, its display and its message.
    pub(crate) fn append(&self, events: Vec<(Option<Changed>, Option<String>, Change)>) {
        if events.is_empty() {
            return;
        }
        let mut entries = self.entries();
        let mut number = *self.0.latest.borrow();
        for (changed, display, message) in events {
            number += 1;
            if entries.len() == EVENTS_KEPT {
                entries.pop_front();
            }
            entries.push_back(Arc::new(Entry { number, changed, display, message }));
        }
        // Listeners wake only after the lock is dropped, so that they don't wait for it.
        drop(entries);
        self.0.latest.send_replace(number);
    }

    /// The events after the one with this number.
    pub(crate) fn since(&self, number: u64) -> Since {
        let entries = self.entries();
        let latest = entries.back().map_or(0, |entry| entry.number);
        let oldest = entries.front().map_or(1, |entry| entry.number);
        if number > latest || number + 1 < oldest {
            return Since::Missed;
        }
        Since::Events(entries.range((number + 1 - oldest) as usize..).cloned().collect())
    }

    /// Learns of every new event, by the number of the latest one.
    pub(crate) fn subscribe(&self) -> watch::Receiver<u64> {
        self.0.latest.subscribe()
    }

    /// The id of the event with this number.
    pub(crate) fn id(&self, number: u64) -> String {
        format!("{}-{number}", self.0.start_ms)
    }

    /// The number in an id; `None`: the id is not of this log.
    pub(crate) fn number(&self, id: &str) -> Option<u64> {
        let (start_ms, number) = id.split_once('-')?;
        (start_ms.parse() == Ok(self.0.start_ms)).then(|| number.parse().ok())?
    }

    fn entries(&self) -> MutexGuard<'_, VecDeque<Arc<Entry>>> {
        self.0.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_proto::v1::event::Reset;

    fn numbers(log: &EventLog, after: u64) -> Option<Vec<u64>> {
        match log.since(after) {
            Since::Events(entries) => Some(entries.iter().map(|entry| entry.number).collect()),
            Since::Missed => None,
        }
    }

    #[test]
    fn events_are_kept_up_to_a_limit() {
        let log = EventLog::default();
        assert_eq!(numbers(&log, 0), Some(vec![]));
        let add = |count| log.append((0..count).map(|_| (None, None, Change::Reset(Reset {}))).collect());
        add(3);
        assert_eq!(
            (numbers(&log, 0), numbers(&log, 2), numbers(&log, 3)),
            (Some(vec![1, 2, 3]), Some(vec![3]), Some(vec![]))
        );
        assert_eq!(numbers(&log, 4), None, "an event that does not exist yet");
        add(EVENTS_KEPT);
        assert_eq!(numbers(&log, 2), None);
        assert_eq!(numbers(&log, 3).unwrap().len(), EVENTS_KEPT);
        assert_eq!(*log.subscribe().borrow(), 3 + EVENTS_KEPT as u64);
    }

    #[test]
    fn ids_of_other_processes_are_unknown() {
        let log = EventLog::default();
        assert_eq!(log.number(&log.id(17)), Some(17));
        for id in ["", "17", "5-17", &format!("{}x", log.id(17)), &log.id(17).replace('-', " ")] {
            assert_eq!(log.number(id), None, "{id}");
        }
    }
}
