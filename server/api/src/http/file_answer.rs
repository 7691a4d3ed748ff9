//! A file as an answer: whole or in ranges, in small pieces.

use super::byte_range::{RangeOutcome, requested_range};
use super::etags::{has, text_value, unless_known};
use super::refusal::Refusal;
use crate::accounts::OpenStream;
use crate::artifacts::download::chunks;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lightpath_artifacts::ArtifactReader;
use lightpath_service::Result;
use tonic::Code;

/// Size of the pieces of a file \[bytes\]. Many slow devices may fetch at once, and each holds a few pieces.
const PIECE_BYTES: usize = 32 << 10;

/// A file that a client asks for.
pub(super) struct ServedFile {
    pub(super) etag: String,
    pub(super) size_bytes: u64,
    pub(super) content_type: &'static str,
    /// How clients may keep it.
    pub(super) cache: &'static str,
}

impl ServedFile {
    /// The file or the part that the client asks for, or 304 if the client has it. `reader` opens a range (offset and
    /// length). The download is counted by `open` until its end.
    pub(super) async fn answer(
        self,
        headers: &HeaderMap,
        open: OpenStream,
        reader: impl AsyncFnOnce((u64, u64)) -> Result<ArtifactReader>,
    ) -> Result<Response, Refusal> {
        let Self { etag, size_bytes, content_type, cache } = self;
        if has(headers, &etag) {
            return Ok(unless_known(headers, &etag, cache, ()));
        }
        let range = match requested_range(headers, &etag, size_bytes) {
            RangeOutcome::Whole => None,
            RangeOutcome::Part { first, last } => Some((first, last)),
            RangeOutcome::Unsatisfiable => return Ok(unsatisfiable(size_bytes)),
        };
        let (first, last) = range.unwrap_or((0, size_bytes.saturating_sub(1)));
        let length = if size_bytes == 0 { 0 } else { last - first + 1 };
        let reader = reader((first, length)).await?;
        let mut response = Response::new(Body::from_stream(chunks(reader, open, PIECE_BYTES)));
        let fields = response.headers_mut();
        fields.insert(header::CONTENT_TYPE, HeaderValue::from_static(content_type));
        // A browser must not guess another type, and so run what somebody uploaded.
        fields.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
        fields.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        fields.insert(header::CACHE_CONTROL, HeaderValue::from_static(cache));
        fields.insert(header::CONTENT_LENGTH, HeaderValue::from(length));
        fields.insert(header::ETAG, text_value(&etag));
        if range.is_some() {
            fields.insert(header::CONTENT_RANGE, text_value(&format!("bytes {first}-{last}/{size_bytes}")));
            *response.status_mut() = StatusCode::PARTIAL_CONTENT;
        }
        Ok(response)
    }
}

/// The refusal of a range that begins behind the end of a file.
fn unsatisfiable(size_bytes: u64) -> Response {
    let message = format!("the range begins behind the end of the file, which has {size_bytes} bytes; begin it inside");
    let fix = "begin the range inside the file";
    let refusal = Refusal::new(StatusCode::RANGE_NOT_SATISFIABLE, Code::OutOfRange, "OUT_OF_RANGE", message, fix);
    ([(header::CONTENT_RANGE, format!("bytes */{size_bytes}"))], refusal).into_response()
}
