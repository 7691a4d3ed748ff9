//! Compressed answers, for clients that accept gzip.
//!
//! A strong ETag names bytes, so the compressed form of an answer has an ETag of its own: that of the answer with the
//! name of the compression. A client that sends it back has the answer, so the suffix is taken off again.

use super::etags::text_value;
use axum::Router;
use axum::extract::Request;
use axum::http::{HeaderMap, Response as HttpResponse, header};
use axum::middleware::{self, Next};
use axum::response::Response;
use tower_http::CompressionLevel;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{And, Predicate as _, SizeAbove};

/// Shorter answers are sent as they are \[bytes\].
const COMPRESSED_FROM: u16 = 512;
/// End of the ETag of a compressed answer.
const SUFFIX: &str = "-gzip\"";

/// Compresses the answers of a router that are text.
pub(super) fn with_compression<S: Clone + Send + Sync + 'static>(router: Router<S>) -> Router<S> {
    // Dashboards ask often, so speed counts more than size.
    let layer = CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(predicate());
    router.layer(layer).layer(middleware::from_fn(name_compression))
}

type Predicate =
    And<SizeAbove, fn(axum::http::StatusCode, axum::http::Version, &HeaderMap, &axum::http::Extensions) -> bool>;

fn predicate() -> Predicate {
    SizeAbove::new(COMPRESSED_FROM).and(|_, _, headers, _| {
        let content_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("");
        let is_text = content_type.starts_with("text/") && !content_type.starts_with("text/event-stream");
        is_text || content_type == "application/json" || content_type == "image/svg+xml"
    })
}

async fn name_compression(mut request: Request, next: Next) -> Response {
    let tags = request.headers().get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok());
    if let Some(tags) = tags {
        let plain = tags.replace(SUFFIX, "\"");
        request.headers_mut().insert(header::IF_NONE_MATCH, text_value(&plain));
    }
    named(next.run(request).await)
}

fn named<B>(mut response: HttpResponse<B>) -> HttpResponse<B> {
    let field = |name| response.headers().get(name).and_then(|value| value.to_str().ok());
    let etag = field(header::ETAG).and_then(|etag| etag.strip_suffix('"'));
    if let (Some("gzip"), Some(etag)) = (field(header::CONTENT_ENCODING), etag) {
        let value = text_value(&format!("{etag}{SUFFIX}"));
        response.headers_mut().insert(header::ETAG, value);
    }
    response
}
