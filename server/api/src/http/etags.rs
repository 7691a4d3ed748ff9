//! ETags: names of contents, with which clients ask whether something changed.

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;

/// What a path names never changes.
pub(super) const IMMUTABLE: &str = "private, max-age=31536000, immutable";
/// What a path names may change, so clients ask each time.
pub(super) const ASKED_AGAIN: &str = "private, no-cache";

/// The strong ETag of a content.
pub(super) fn etag(content: impl AsRef<[u8]>) -> String {
    let mut etag = String::from("\"");
    for byte in &Sha256::digest(content)[..16] {
        // Writing to a string cannot fail.
        let _ = write!(etag, "{byte:02x}");
    }
    etag + "\""
}

/// Whether the client has what the ETag names (RFC 9110, section 13.1.2).
pub(super) fn has(headers: &HeaderMap, etag: &str) -> bool {
    let fields = headers.get_all(header::IF_NONE_MATCH).into_iter().filter_map(|value| value.to_str().ok());
    let mut tags = fields.flat_map(|value| value.split(',')).map(str::trim);
    tags.any(|tag| tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == etag)
}

/// The content with its ETag and with how clients may keep it, or 304 without content if the client has it.
pub(super) fn unless_known(
    headers: &HeaderMap,
    etag: &str,
    cache: &'static str,
    content: impl IntoResponse,
) -> Response {
    let fields = [(header::ETAG, text_value(etag)), (header::CACHE_CONTROL, HeaderValue::from_static(cache))];
    match has(headers, etag) {
        true => (StatusCode::NOT_MODIFIED, fields).into_response(),
        false => (fields, content).into_response(),
    }
}

/// A header field with an ASCII text.
pub(super) fn text_value(text: &str) -> HeaderValue {
    HeaderValue::from_str(text).unwrap_or_else(|_| HeaderValue::from_static(""))
}
