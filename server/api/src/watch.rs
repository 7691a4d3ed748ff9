//! Streams that follow something that changes.
//!
//! Such a stream reads the present state whenever it is polled after a change. The transport polls it only when the
//! client has room, so a slow client skips states instead of piling them up here, and always gets the latest one.
//! Between two reads nothing is held, no transaction and no connection.

use crate::call::Answers;
use crate::error::ApiError;
use futures::StreamExt as _;
use futures::stream;
use tokio::sync::OwnedSemaphorePermit;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::{RecvError, TryRecvError};
use tokio_util::sync::CancellationToken;

/// What is followed.
pub(crate) trait Watch: Send + Sync + 'static {
    /// Its state.
    type Item: PartialEq + Send + Sync + 'static;
    /// What announces that something changed.
    type Change: Clone + Send + 'static;
    /// What clients get.
    type Message: Send + 'static;

    /// The present state.
    fn read(&self) -> impl Future<Output = Result<Self::Item, ApiError>> + Send;
    /// Whether this change is one of what is followed.
    fn concerns(&self, change: &Self::Change) -> bool;
    /// Whether nothing will change any more.
    fn is_last(&self, item: &Self::Item) -> bool;
    /// The state as clients see it.
    fn message(&self, item: &Self::Item) -> Self::Message;
}

struct Follower<W: Watch> {
    source: W,
    changes: Receiver<W::Change>,
    stopping: CancellationToken,
    /// Sent last; `None` before the first.
    sent: Option<W::Item>,
    first: Option<W::Item>,
    ended: bool,
    _permit: OwnedSemaphorePermit,
}

/// `first`, then every state that differs from the one before, to the last one. UNAVAILABLE ends the stream when the
/// server stops. `changes` must be older than `first`.
pub(crate) fn stream<W: Watch>(
    source: W,
    first: W::Item,
    changes: Receiver<W::Change>,
    stopping: CancellationToken,
    permit: OwnedSemaphorePermit,
) -> Answers<W::Message> {
    let first = Some(first);
    let follower = Follower { source, changes, stopping, sent: None, first, ended: false, _permit: permit };
    stream::unfold(follower, |mut follower| async move {
        if follower.ended {
            return None;
        }
        let next = follower.next().await;
        follower.ended |= next.is_err();
        Some((next, follower))
    })
    .boxed()
}

impl<W: Watch> Follower<W> {
    async fn next(&mut self) -> Result<W::Message, ApiError> {
        loop {
            let item = match self.first.take() {
                Some(first) => first,
                None => {
                    self.changed().await?;
                    self.source.read().await?
                }
            };
            if self.sent.as_ref() == Some(&item) {
                continue;
            }
            self.ended = self.source.is_last(&item);
            let message = self.source.message(&item);
            self.sent = Some(item);
            return Ok(message);
        }
    }

    /// Waits for a change of what is followed, and takes all that have come by then as one.
    async fn changed(&mut self) -> Result<(), ApiError> {
        loop {
            let change = tokio::select! {
                biased;
                () = self.stopping.cancelled() => return Err(ApiError::Stopping),
                change = self.changes.recv() => change,
            };
            match change {
                Ok(change) if !self.source.concerns(&change) => {}
                // Among the announcements that were missed may have been one of this.
                Ok(_) | Err(RecvError::Lagged(_)) => break,
                Err(RecvError::Closed) => return Err(ApiError::Stopping),
            }
        }
        while let Ok(_) | Err(TryRecvError::Lagged(_)) = self.changes.try_recv() {}
        Ok(())
    }
}
