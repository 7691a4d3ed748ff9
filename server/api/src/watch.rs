//! Streams that follow the changes of a resource.
//!
//! Such a stream reads the present state when it is polled after a change. The transport polls it only when the client
//! can receive more. So a slow client skips states, and always receives the latest one. Between two reads the stream
//! holds no transaction and no connection.

use crate::accounts::OpenStream;
use crate::call::Answers;
use futures::StreamExt as _;
use futures::stream;
use lightpath_service::{Result, ServiceError};
use lightpath_store::for_client;
use std::pin::pin;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::{RecvError, TryRecvError};
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// A resource that clients follow.
pub(crate) trait Watch: Send + Sync + 'static {
    /// State of the resource.
    type Item: PartialEq + Send + Sync + 'static;
    /// Announcement of a change.
    type Change: Clone + Send + 'static;
    /// Message that clients receive.
    type Message: Send + 'static;

    /// Reads the present state.
    fn read(&self) -> impl Future<Output = Result<Self::Item>> + Send;
    /// Whether the change concerns this resource.
    fn concerns(&self, change: &Self::Change) -> bool;
    /// Whether the state is final.
    fn is_last(&self, item: &Self::Item) -> bool;
    /// Time after which the state is read again, although no change was announced; `None`: only announcements change it.
    fn again(&self, _item: &Self::Item) -> Option<Duration> {
        None
    }
    /// Converts the state into its message.
    fn message(&self, item: &Self::Item) -> Self::Message;
}

struct Follower<W: Watch> {
    source: W,
    changes: Receiver<W::Change>,
    stopping: CancellationToken,
    /// State that was sent last; `None` before the first.
    sent: Option<W::Item>,
    first: Option<W::Item>,
    has_ended: bool,
    open: OpenStream,
}

/// A stream of `first` and then of every different state, up to the final one. It ends with UNAVAILABLE when the server
/// stops. The caller must have subscribed to `changes` before reading `first`.
pub(crate) fn stream<W: Watch>(
    source: W,
    first: W::Item,
    changes: Receiver<W::Change>,
    stopping: CancellationToken,
    open: OpenStream,
) -> Answers<W::Message> {
    let first = Some(first);
    let follower = Follower { source, changes, stopping, sent: None, first, has_ended: false, open };
    stream::unfold(follower, |mut follower| async move {
        if follower.has_ended {
            return None;
        }
        let next = follower.next().await;
        follower.has_ended |= next.is_err();
        Some((next, follower))
    })
    .boxed()
}

impl<W: Watch> Follower<W> {
    async fn next(&mut self) -> Result<W::Message> {
        loop {
            let item = match self.first.take() {
                Some(first) => first,
                None => {
                    self.changed().await?;
                    for_client(self.open.client().line(), self.source.read()).await?
                }
            };
            if self.sent.as_ref() == Some(&item) {
                continue;
            }
            self.has_ended = self.source.is_last(&item);
            let message = self.source.message(&item);
            self.sent = Some(item);
            return Ok(message);
        }
    }

    /// Waits for a change of the resource or until it is to be read again, and removes all further announcements that have arrived.
    async fn changed(&mut self) -> Result<()> {
        let again = self.sent.as_ref().and_then(|item| self.source.again(item)).unwrap_or(Duration::MAX);
        let mut again = pin!(sleep(again));
        loop {
            let change = tokio::select! {
                biased;
                () = self.stopping.cancelled() => return Err(ServiceError::Stopping),
                () = &mut again => return Ok(()),
                change = self.changes.recv() => change,
            };
            match change {
                Ok(change) if !self.source.concerns(&change) => {}
                // A missed announcement may have concerned this resource.
                Ok(_) | Err(RecvError::Lagged(_)) => break,
                Err(RecvError::Closed) => return Err(ServiceError::Stopping),
            }
        }
        while let Ok(_) | Err(TryRecvError::Lagged(_)) = self.changes.try_recv() {}
        Ok(())
    }
}
