//! Reads the rest of a request that was answered before its body had arrived.
//!
//! Over HTTP/1 a server that answers early and closes the connection resets it under a client that still sends, and
//! then the answer is lost: the client reports a broken pipe where the answer names its mistake. So the rest is read
//! and dropped for a while. Over HTTP/2 the answer ends only its stream, and nothing is lost.
//!
//! A client that asks first whether it may send (`expect: 100-continue`) sends nothing as long as nobody reads.

use axum::body::Body;
use axum::extract::Request;
use axum::http::{Version, header};
use axum::middleware::Next;
use axum::response::Response;
use futures::StreamExt as _;
use http_body::{Body as _, Frame, SizeHint};
use prost::bytes::Bytes;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

/// Most bytes that are read and dropped.
const BYTES_MAX: usize = 16 << 20;
/// Longest time for which they are read.
const READ_FOR: Duration = Duration::from_secs(5);

/// Lets the client send the rest of a body that nobody has read to its end.
pub(super) async fn with_rest_read(request: Request, next: Next) -> Response {
    if matches!(request.version(), Version::HTTP_2 | Version::HTTP_3) {
        return next.run(request).await;
    }
    let sends = !request.headers().contains_key(header::EXPECT);
    next.run(request.map(|body| Body::new(WithRestRead { body, sends }))).await
}

/// A body whose rest is read when it is dropped.
struct WithRestRead {
    body: Body,
    /// Whether the client sends it: at once, or because somebody has begun to read.
    sends: bool,
}

impl http_body::Body for WithRestRead {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.sends = true;
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for WithRestRead {
    fn drop(&mut self) {
        if !self.sends || self.body.is_end_stream() {
            return;
        }
        // Without a runtime the server has ended, and with it the connection.
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(tokio::time::timeout(READ_FOR, read_rest(std::mem::take(&mut self.body))));
        }
    }
}

async fn read_rest(body: Body) {
    let (mut pieces, mut left) = (body.into_data_stream(), BYTES_MAX);
    while let Some(Ok(piece)) = pieces.next().await {
        let Some(rest) = left.checked_sub(piece.len()) else { return };
        left = rest;
    }
}
