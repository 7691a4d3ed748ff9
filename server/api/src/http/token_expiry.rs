//! Ends the calls of tokens that are no longer accepted: uploads, downloads, and streams that follow changes.
//!
//! Another process revokes tokens in the database, so the server must check them regularly. All calls share one check.

use super::checked_body::{FrameCheck, Last, checked};
use super::refusal::closing_frame;
use crate::status;
use axum::response::Response;
use futures::future::{BoxFuture, FutureExt as _, pending};
use lightpath_service::ServiceError;
use lightpath_store::{Store, StoreError};
use std::collections::HashSet;
use std::sync::Arc;
use std::task::{Context, Poll};
use tokio::sync::watch;

/// Names of the tokens that the last check found revoked or expired. A name is never used for another token.
#[derive(Clone, Debug, Default)]
pub struct EndedTokens(Arc<watch::Sender<HashSet<String>>>);

impl EndedTokens {
    /// Reads from the database which tokens have been revoked or have expired.
    pub async fn update(&self, store: &Store, now_ms: i64) -> Result<(), StoreError> {
        let tokens = store.tokens().await?.into_iter().filter(|token| !token.is_valid(now_ms));
        let names: HashSet<String> = tokens.map(|token| token.caller.name).collect();
        self.0.send_if_modified(|known| {
            let is_changed = *known != names;
            *known = names;
            is_changed
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
pub(super) fn not_accepted() -> ServiceError {
    ServiceError::Unauthenticated(
        "the token is unknown, has expired or was revoked; ask an admin for a new one".to_owned(),
    )
}

/// Wraps the answer to a call, which ends with UNAUTHENTICATED if `expiry` ends first.
pub(super) fn ending_at_expiry(response: Response, expiry: BoxFuture<'static, ()>, is_grpc: bool) -> Response {
    response.map(|body| checked(body, Expiry { ended: expiry, is_grpc }))
}

/// Ends when the token of the call is no longer accepted.
struct Expiry {
    ended: BoxFuture<'static, ()>,
    is_grpc: bool,
}

impl FrameCheck for Expiry {
    fn poll_end(&mut self, cx: &mut Context<'_>) -> Poll<Last> {
        let is_grpc = self.is_grpc;
        self.ended.poll_unpin(cx).map(|()| closing_frame(status::of(not_accepted()), is_grpc))
    }
}
