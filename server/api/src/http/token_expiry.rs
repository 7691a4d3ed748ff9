//! Ends the calls of tokens that are no longer accepted: uploads, downloads, and streams that follow changes.
//!
//! Another process revokes tokens in the database, so the server must check them regularly. All calls share one check.

use super::refusal::closing_frame;
use crate::error::ApiError;
use axum::body::Body;
use axum::response::Response;
use futures::future::{BoxFuture, FutureExt as _, pending};
use http_body::{Frame, SizeHint};
use lightpath_store::{Store, StoreError};
use prost::bytes::Bytes;
use std::collections::HashSet;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use tokio::sync::watch;

/// Names of the tokens that the last check found revoked or expired. A name is never used for another token.
#[derive(Clone, Debug, Default)]
pub struct EndedTokens(Arc<watch::Sender<HashSet<String>>>);

impl EndedTokens {
    /// Checks which tokens have been revoked or have expired.
    pub async fn look(&self, store: &Store, now_ms: i64) -> Result<(), StoreError> {
        let tokens = store.tokens().await?.into_iter().filter(|token| !token.is_valid(now_ms));
        let names: HashSet<String> = tokens.map(|token| token.caller.name).collect();
        self.0.send_if_modified(|known| {
            let is_news = *known != names;
            *known = names;
            is_news
        });
        Ok(())
    }

    /// A future that ends when the token with this name is no longer accepted. Without a token (an empty name) it never
    /// ends.
    pub(super) fn when_ended(&self, name: &str) -> BoxFuture<'static, ()> {
        if name.is_empty() {
            return pending().boxed();
        }
        let (mut names, name) = (self.0.subscribe(), name.to_owned());
        async move {
            // The sender is dropped only when the server ends.
            if names.wait_for(|ended| ended.contains(&name)).await.is_err() {
                pending().await
            }
        }
        .boxed()
    }
}

/// The error for a token that is not accepted. It does not reveal the reason.
pub(super) fn not_accepted() -> ApiError {
    ApiError::Unauthenticated("the token is not known, has expired or was revoked; ask for another".to_owned())
}

/// Wraps the answer to a gRPC call, which ends with UNAUTHENTICATED if `expiry` ends first.
pub(super) fn ending_at_expiry(response: Response, expiry: BoxFuture<'static, ()>) -> Response {
    response.map(|body| Body::new(Answer { body, expiry, is_over: false }))
}

struct Answer {
    body: Body,
    expiry: BoxFuture<'static, ()>,
    is_over: bool,
}

impl http_body::Body for Answer {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if self.is_over {
            return Poll::Ready(None);
        }
        if self.expiry.poll_unpin(cx).is_ready() {
            self.is_over = true;
            return Poll::Ready(Some(closing_frame(not_accepted().into(), true)));
        }
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.is_over || self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
