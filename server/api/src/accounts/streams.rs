//! Limits on open streams and connections, for each client and for all clients together.

use lightpath_service::{Client, LimitReason, Result, ServiceError};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Limit on open connections. More clients wait in the backlog of the system. Each connection needs a file handle, and
/// processes commonly have 1024.
pub(crate) const CONNECTIONS_MAX: usize = 800;

/// Share of the transfers that one client may run at once, so that one client cannot keep out all others.
const TRANSFERS_SHARE: usize = 4;
/// Share of the streams that follow changes. A dashboard alone may follow hundreds of jobs.
const WATCHERS_SHARE: usize = 2;

/// Share of the connections. A client needs few: one connection carries many calls.
const CONNECTIONS_SHARE: usize = 8;

/// What a stream does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum StreamKind {
    /// Follows the changes of a job or a kernel. It needs a little memory, and a read of the database at every change.
    Watch,
    /// Receives an artifact. It may hold what its connection has received, about 2 MiB.
    Upload,
    /// Sends an artifact or a kernel. It holds an open file.
    Download,
    /// A connection itself. It holds a file handle.
    Connection,
}

impl StreamKind {
    /// Limit on the streams of all clients.
    fn all_max(self) -> usize {
        match self {
            Self::Watch => 1000,
            Self::Upload => 64,
            // Processes commonly have 1024 file handles, and connections need most of them.
            Self::Download => 128,
            Self::Connection => CONNECTIONS_MAX,
        }
    }

    /// Limit on the streams of one client.
    fn own_max(self) -> usize {
        match self {
            Self::Watch => self.all_max() / WATCHERS_SHARE,
            Self::Upload | Self::Download => self.all_max() / TRANSFERS_SHARE,
            Self::Connection => self.all_max() / CONNECTIONS_SHARE,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Watch => "streams that follow jobs and kernels",
            Self::Upload => "uploads",
            Self::Download => "downloads",
            Self::Connection => "connections",
        }
    }

    fn reason(self) -> LimitReason {
        match self {
            Self::Watch => LimitReason::TooManyWatchers,
            Self::Upload => LimitReason::TooManyUploads,
            Self::Download => LimitReason::TooManyDownloads,
            Self::Connection => LimitReason::TooManyConnections,
        }
    }

    /// Time after which a refused client may retry: watchers stay open for long, transfers end sooner.
    fn retry_after(self) -> Duration {
        match self {
            Self::Watch => Duration::from_secs(5),
            Self::Upload | Self::Download | Self::Connection => Duration::from_secs(1),
        }
    }
}

/// The open streams. Clones share them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Streams(Arc<Mutex<HashMap<StreamKind, Open>>>);

/// Numbers of the open streams of one kind.
#[derive(Debug, Default)]
struct Open {
    all: usize,
    by_client: HashMap<Client, usize>,
}

/// An open stream. It is counted until this is dropped.
#[derive(Debug)]
pub(crate) struct OpenStream {
    streams: Streams,
    kind: StreamKind,
    client: Client,
}

impl Streams {
    /// Counts a stream of a client.
    ///
    /// # Errors
    ///
    /// [`ServiceError::Exhausted`] if the client or all clients together have too many open streams of this kind.
    pub(crate) fn open(&self, kind: StreamKind, client: &Client) -> Result<OpenStream> {
        let (name, all_max, own_max) = (kind.name(), kind.all_max(), kind.own_max());
        let mut streams = self.lock();
        let open = streams.entry(kind).or_default();
        let own = open.by_client.get(client).copied().unwrap_or_default();
        let message = if own >= own_max {
            format!("{client} already has {own_max} {name}; end one, or retry when one has ended")
        } else if open.all >= all_max {
            format!("{all_max} {name} are already open; retry when one of them has ended")
        } else {
            open.all += 1;
            open.by_client.insert(client.clone(), own + 1);
            return Ok(OpenStream { streams: self.clone(), kind, client: client.clone() });
        };
        Err(ServiceError::Exhausted { reason: kind.reason(), message, retry_after: kind.retry_after() })
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<StreamKind, Open>> {
        // The counts are consistent even after a panic: nothing between their changes can panic.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl OpenStream {
    /// The client for which the stream is counted.
    pub(crate) fn client(&self) -> &Client {
        &self.client
    }
}

impl Drop for OpenStream {
    fn drop(&mut self) {
        let mut streams = self.streams.lock();
        let open = streams.entry(self.kind).or_default();
        open.all -= 1;
        if let Some(own) = open.by_client.get_mut(&self.client) {
            *own -= 1;
            if *own == 0 {
                open.by_client.remove(&self.client);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_client_leaves_streams_for_others() {
        let (streams, kind) = (Streams::default(), StreamKind::Upload);
        let client = |n: usize| Client::Token(format!("client-{n}"));
        let own_max = kind.own_max();
        let mut open: Vec<_> = (0..own_max).map(|_| streams.open(kind, &client(0)).unwrap()).collect();
        let refusal = streams.open(kind, &client(0)).unwrap_err().to_string();
        assert_eq!(refusal, "the token \"client-0\" already has 16 uploads; end one, or retry when one has ended");
        assert!(streams.open(StreamKind::Watch, &client(0)).is_ok(), "each kind is counted separately");
        for n in own_max..kind.all_max() {
            open.push(streams.open(kind, &client(n)).unwrap());
        }
        assert!(streams.open(kind, &client(1000)).is_err());
        open.clear();
        assert!(streams.lock().values().all(|open| open.all == 0 && open.by_client.is_empty()));
    }
}
