//! The dashboard: its files, which hold no secrets. The page asks for data with the caller's token.

use super::etags::{etag, unless_known};
use super::refusal::refuse;
use crate::status;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use lightpath_dashboard::{INDEX, file, names};
use std::collections::HashMap;
use std::sync::LazyLock;
use tonic::Code;

/// The page runs only scripts of this server, asks only this server, and no other site can show it in a frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
                      form-action 'none'; base-uri 'none'; frame-ancestors 'none'";

static ETAGS: LazyLock<HashMap<&str, String>> =
    LazyLock::new(|| names().filter_map(|name| Some((name, etag(file(name)?.bytes)))).collect());

pub(super) async fn get_index(headers: HeaderMap) -> Response {
    answer(INDEX, &headers)
}

pub(super) async fn get_file(Path(name): Path<String>, headers: HeaderMap) -> Response {
    answer(&name, &headers)
}

fn answer(name: &str, headers: &HeaderMap) -> Response {
    let (Some(file), Some(etag)) = (file(name), ETAGS.get(name)) else {
        let message = format!("the page has no file {name:?}");
        return refuse(status::plain(Code::NotFound, "NO_SUCH_PATH", message, "load the page again"), false);
    };
    let fields = [
        (header::CONTENT_TYPE, HeaderValue::from_static(file.content_type)),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (HeaderName::from_static("cross-origin-opener-policy"), HeaderValue::from_static("same-origin")),
    ];
    (fields, unless_known(headers, etag, "no-cache", file.bytes)).into_response()
}
