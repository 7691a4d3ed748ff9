//! Bounds on the bytes of answers: a bucket's server that is broken or hostile must not fill the memory.
//!
//! The client of the bucket reads answers whole: lists, and the texts of errors. It also takes the length that a server
//! announces for the memory that it needs. So the bounds are below it, where bytes arrive from the connection.

use super::PART_BYTES;
use futures::TryStreamExt as _;
use futures::future::{BoxFuture, FutureExt as _};
use http_body::{Body, Frame, SizeHint};
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpResponseBody, HttpService,
    ReqwestConnector,
};
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

/// Limit on an answer \[bytes\]: a part of a blob. A page of a list has at most 1000 keys of at most 1024 bytes, which
/// take about 7 MB if each byte of a key needs to be escaped.
pub(super) const ANSWER_BYTES_MAX: u64 = PART_BYTES as u64;
/// Limit on what is kept of the text of an error \[bytes\]. Those of S3 have some hundred bytes.
pub(super) const ERROR_BYTES_MAX: usize = 4 << 10;

/// Connects with a client that keeps to the bounds.
#[derive(Debug)]
pub(super) struct BoundedConnector;

/// A client that keeps to the bounds.
#[derive(Debug)]
struct BoundedClient {
    client: HttpClient,
}

impl HttpConnector for BoundedConnector {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        let client = ReqwestConnector::default().connect(options)?;
        Ok(HttpClient::new(BoundedClient { client }))
    }
}

impl HttpService for BoundedClient {
    fn call<'a, 'b>(&'a self, request: HttpRequest) -> BoxFuture<'b, Result<HttpResponse, HttpError>>
    where
        'a: 'b,
        Self: 'b,
    {
        async move {
            let (parts, body) = self.client.execute(request).await?.into_parts();
            let body = match parts.status.is_client_error() || parts.status.is_server_error() {
                true => beginning(body).await.into(),
                // Before anyone takes memory for the announced length.
                false if body.size_hint().lower() > ANSWER_BYTES_MAX => return Err(too_long()),
                false => HttpResponseBody::new(Bounded { body, left_bytes: ANSWER_BYTES_MAX }),
            };
            Ok(HttpResponse::from_parts(parts, body))
        }
        .boxed()
    }
}

/// The beginning of an error's text. The status says what happened, so that a connection that breaks, or a text that is
/// too long, hides nothing.
async fn beginning(body: HttpResponseBody) -> String {
    let mut pieces = body.bytes_stream();
    let mut bytes = Vec::new();
    while let Ok(Some(piece)) = pieces.try_next().await {
        let left_bytes = ERROR_BYTES_MAX - bytes.len();
        bytes.extend_from_slice(&piece[..piece.len().min(left_bytes)]);
        if piece.len() > left_bytes {
            let text = String::from_utf8_lossy(&bytes);
            return format!("{text}… (the text of the error exceeds {ERROR_BYTES_MAX} bytes)");
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// An error that no further request mends.
fn too_long() -> HttpError {
    let problem = format!("the server's answer exceeds {ANSWER_BYTES_MAX} bytes");
    HttpError::new(HttpErrorKind::Decode, io::Error::other(problem))
}

/// A body that fails when it has more bytes than it may.
struct Bounded {
    body: HttpResponseBody,
    left_bytes: u64,
}

impl Body for Bounded {
    type Data = <HttpResponseBody as Body>::Data;
    type Error = HttpError;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, HttpError>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        let bytes = match &frame {
            Some(Ok(frame)) => frame.data_ref().map_or(0, |data| data.len() as u64),
            _ => 0,
        };
        match self.left_bytes.checked_sub(bytes) {
            Some(left_bytes) => {
                self.left_bytes = left_bytes;
                Poll::Ready(frame)
            }
            None => Poll::Ready(Some(Err(too_long()))),
        }
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
