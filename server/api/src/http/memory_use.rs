//! Measures the memory that unfinished calls use.
//!
//! Messages, streams and connections have limits of their own, but one client could multiply them: 400 connections with
//! 256 streams of 4 MiB each make 400 GiB. So each call takes memory from a budget: for itself, for the received part
//! of its request until it is answered, and for the pieces of its answer that the client has not received yet. The
//! memory for computations has limits in the handlers.

use super::checked_body::{FrameCheck, Last, checked};
use super::protocol::is_grpc;
use super::refusal::{closing_frame, refuse};
use crate::accounts::{MemoryBudget, Share};
use crate::connections::Peer;
use crate::routes::MESSAGE_BYTES_MAX;
use crate::status;
use axum::Extension;
use axum::extract::{Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::Response;
use http_body::Frame;
use lightpath_service::{Client, Result, ServiceError};
use prost::bytes::Bytes;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Memory of a call besides its messages \[bytes\]: headers (at most 16 KiB) and tasks.
const CALL_BYTES: usize = 32 << 10;
/// Memory that compresses one answer \[bytes\]: its window, tables and buffers take about 330 kB.
const COMPRESSOR_BYTES: usize = 384 << 10;
/// Path of the health check. It is not counted, so that a supervisor does not mistake a busy server for a dead one.
const HEALTH: &str = "/healthz";
/// Pieces of an answer that may wait for the client: one in the connection and one behind it.
const PIECES: usize = 2;

/// Takes memory for a call, and refuses the call if the budget is spent.
pub(super) async fn with_memory_limit(
    State(budget): State<Arc<MemoryBudget>>,
    peer: Option<Extension<Peer>>,
    request: Request,
    next: Next,
) -> Response {
    if request.uri().path() == HEALTH {
        return next.run(request).await;
    }
    let is_grpc = is_grpc(request.uri().path());
    // The token is checked later, because this limit holds for calls with wrong tokens, too.
    let client = Client::at(peer.map(|Extension(peer)| peer.ip()));
    let shares = budget.take(&client, CALL_BYTES).and_then(|call| Ok((call, budget.take(&client, 0)?)));
    let (call, message) = match shares {
        Ok((call, message)) => (Holding::new(call), Holding::new(message)),
        Err(error) => return refuse(status::of(error), is_grpc),
    };
    // The share is kept until the answer: the handler still uses a message after it was read.
    let message_share = message.clone();
    let mut request = request.map(|body| checked(body, ReceivedBytes { message, counted_bytes: 0 }));
    request.extensions_mut().insert(call.clone());
    let response = next.run(request).await;
    drop(message_share);
    if response.headers().contains_key(header::CONTENT_ENCODING)
        && let Err(error) = call.grow(COMPRESSOR_BYTES)
    {
        return refuse(status::of(error), is_grpc);
    }
    response.map(|body| checked(body, AnswerBytes { call, is_grpc }))
}

/// Takes memory for the pieces of an answer before they are compressed: a whole piece waits until the client has
/// received its compressed form, of which [`with_memory_limit`] sees small pieces only.
pub(super) async fn with_uncompressed_counted(request: Request, next: Next) -> Response {
    let call = request.extensions().get::<Holding>().cloned();
    let response = next.run(request).await;
    match call {
        Some(call) => response.map(|body| checked(body, AnswerBytes { call, is_grpc: false })),
        None => response,
    }
}

/// A share of the budget with several holders. It is released when the last one is dropped.
#[derive(Clone, Debug)]
struct Holding(Arc<Mutex<Held>>);

#[derive(Debug)]
struct Held {
    share: Share,
    /// Size of the largest piece of the answer so far.
    piece_bytes: usize,
}

impl Holding {
    fn new(share: Share) -> Self {
        Self(Arc::new(Mutex::new(Held { share, piece_bytes: 0 })))
    }

    fn grow(&self, bytes: usize) -> Result<()> {
        self.held().share.grow(bytes)
    }

    /// Takes memory for pieces of this size, unless there were larger ones.
    fn grow_for_piece(&self, bytes: usize) -> Result<()> {
        let mut held = self.held();
        let more = bytes.saturating_sub(held.piece_bytes);
        held.share.grow(PIECES * more)?;
        held.piece_bytes += more;
        Ok(())
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Counts the memory of a request. At most one message of it is in memory, even if the stream is long.
struct ReceivedBytes {
    message: Holding,
    counted_bytes: usize,
}

impl FrameCheck for ReceivedBytes {
    fn check(&mut self, frame: Frame<Bytes>) -> Result<Frame<Bytes>, Last> {
        let received = frame.data_ref().map_or(0, Bytes::len);
        let more = received.min(MESSAGE_BYTES_MAX - self.counted_bytes);
        if more > 0 {
            let refused = |error| Err(axum::Error::new(status::of(error)));
            self.message.grow(more).map_err(refused)?;
            self.counted_bytes += more;
        }
        Ok(frame)
    }
}

/// Counts the memory of an answer. Memory for its largest pieces is kept until its end, so that later pieces of the
/// same size are never refused.
struct AnswerBytes {
    call: Holding,
    is_grpc: bool,
}

impl FrameCheck for AnswerBytes {
    fn check(&mut self, frame: Frame<Bytes>) -> Result<Frame<Bytes>, Last> {
        let piece = match frame.into_data() {
            Ok(piece) => piece,
            Err(trailers) => return Ok(trailers),
        };
        let refused = |error: ServiceError| closing_frame(status::of(error), self.is_grpc);
        self.call.grow_for_piece(piece.len()).map_err(refused)?;
        // The connection keeps the piece until the client receives it, which may be after this body is dropped.
        Ok(Frame::data(Bytes::from_owner(Piece { bytes: piece, _call: self.call.clone() })))
    }
}

/// A piece of an answer, with its share of the budget.
struct Piece {
    bytes: Bytes,
    _call: Holding,
}

impl AsRef<[u8]> for Piece {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}
