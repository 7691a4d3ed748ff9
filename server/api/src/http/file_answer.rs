//! A file as an answer: whole or in ranges, in small pieces. What a path names never changes, so clients may keep it.

use super::byte_range::{RangeOutcome, requested_range};
use super::etags::{has, text_value};
use super::refusal::Refusal;
use crate::accounts::OpenStream;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures::stream;
use lightpath_artifacts::ArtifactReader;
use lightpath_service::ServiceError;

/// Size of the pieces of a file \[bytes\]. Many slow devices may fetch at once, and each holds a few pieces.
const PIECE_BYTES: usize = 32 << 10;
/// What a path names never changes.
pub(super) const IMMUTABLE: &str = "private, max-age=31536000, immutable";

/// A file that a client asks for.
pub(super) struct ServedFile {
    pub(super) etag: String,
    pub(super) size_bytes: u64,
    pub(super) content_type: &'static str,
}

impl ServedFile {
    /// The file or the part that the client asks for, or 304 if the client has it. `reader` opens a range (offset and
    /// length). The download is counted by `open` until its end.
    pub(super) async fn answer(
        self,
        headers: &HeaderMap,
        open: OpenStream,
        reader: impl AsyncFnOnce((u64, u64)) -> Result<ArtifactReader, ServiceError>,
    ) -> Result<Response, Refusal> {
        let Self { etag, size_bytes, content_type } = self;
        if has(headers, &etag) {
            let fields = [(header::ETAG, etag), (header::CACHE_CONTROL, IMMUTABLE.into())];
            return Ok((StatusCode::NOT_MODIFIED, fields).into_response());
        }
        let range = match requested_range(headers, &etag, size_bytes) {
            RangeOutcome::Whole => None,
            RangeOutcome::Part { first, last } => Some((first, last)),
            RangeOutcome::Unsatisfiable => {
                let range = format!("bytes */{size_bytes}");
                return Ok((StatusCode::RANGE_NOT_SATISFIABLE, [(header::CONTENT_RANGE, range)]).into_response());
            }
        };
        let (first, last) = range.unwrap_or((0, size_bytes.saturating_sub(1)));
        let length = if size_bytes == 0 { 0 } else { last - first + 1 };
        let reader = reader((first, length)).await?;
        let mut response = Response::new(Body::from_stream(pieces(reader, open)));
        let fields = response.headers_mut();
        fields.insert(header::CONTENT_TYPE, HeaderValue::from_static(content_type));
        // A browser must not guess another type, and so run what somebody uploaded.
        fields.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
        fields.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        fields.insert(header::CACHE_CONTROL, HeaderValue::from_static(IMMUTABLE));
        fields.insert(header::CONTENT_LENGTH, HeaderValue::from(length));
        fields.insert(header::ETAG, text_value(&etag));
        if range.is_some() {
            fields.insert(header::CONTENT_RANGE, text_value(&format!("bytes {first}-{last}/{size_bytes}")));
            *response.status_mut() = StatusCode::PARTIAL_CONTENT;
        }
        Ok(response)
    }
}

/// The bytes of a reader in small pieces. The download is counted until its end.
fn pieces(
    reader: ArtifactReader,
    open: OpenStream,
) -> impl futures::Stream<Item = Result<Bytes, ServiceError>> + Send + 'static {
    stream::try_unfold((reader, open), |(mut reader, open)| async move {
        let piece = reader.next_chunk(PIECE_BYTES).await?;
        Ok(piece.map(|piece| (Bytes::from(piece), (reader, open))))
    })
}
