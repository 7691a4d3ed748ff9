//! Bodies of requests and answers whose frames are checked on their way.

use axum::body::Body;
use http_body::{Frame, SizeHint};
use prost::bytes::Bytes;
use std::error::Error;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use tonic::Status;

/// The last that a body that did not pass a check passes on: a frame, or an error that breaks it off.
pub(super) type Last = Result<Frame<Bytes>, axum::Error>;

/// A check of the frames of a body.
pub(super) trait FrameCheck: Send + Unpin + 'static {
    /// Becomes ready when the body must end. It is polled before every frame.
    fn poll_end(&mut self, _: &mut Context<'_>) -> Poll<Last> {
        Poll::Pending
    }

    /// Checks a frame and returns what is passed on instead.
    ///
    /// # Errors
    ///
    /// The end of the body.
    fn check(&mut self, frame: Frame<Bytes>) -> Result<Frame<Bytes>, Last> {
        Ok(frame)
    }
}

/// The status with which a check ended a body; `None` if the body ended for another reason.
pub(super) fn status_of(error: &axum::Error) -> Option<Status> {
    let mut cause: Option<&(dyn Error + 'static)> = Some(error);
    while let Some(found) = cause {
        if let Some(status) = found.downcast_ref::<Status>() {
            return Some(status.clone());
        }
        cause = found.source();
    }
    None
}

/// Wraps a body, so that `check` sees each of its frames.
pub(super) fn checked(body: Body, check: impl FrameCheck) -> Body {
    Body::new(CheckedBody { body, check, is_over: false })
}

struct CheckedBody<C> {
    body: Body,
    check: C,
    is_over: bool,
}

impl<C: FrameCheck> http_body::Body for CheckedBody<C> {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = &mut *self;
        if this.is_over {
            return Poll::Ready(None);
        }
        if let Poll::Ready(last) = this.check.poll_end(cx) {
            this.is_over = true;
            return Poll::Ready(Some(last));
        }
        let Some(frame) = ready!(Pin::new(&mut this.body).poll_frame(cx)?) else { return Poll::Ready(None) };
        Poll::Ready(Some(this.check.check(frame).or_else(|last| {
            this.is_over = true;
            last
        })))
    }

    fn is_end_stream(&self) -> bool {
        self.is_over || self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
