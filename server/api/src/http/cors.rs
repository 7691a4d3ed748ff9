//! Pages of other sites that an operator allows to call the server (CORS).
//!
//! A browser asks the server before it sends most calls of such a page (a *preflight*), and hands an answer to the page
//! only if the server names the page's origin. The server names the origins of the setting `cors_origins`, each by
//! itself. It never accepts cookies or other credentials that a browser adds: a page sends its token itself.

use axum::extract::{Request, State};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use lightpath_domain::origin::Origins;

const METHODS: &str = "GET, HEAD, POST, PUT, PATCH, DELETE";
/// Fields that calls of the API and of gRPC-Web have, besides those that browsers always allow.
const REQUEST_FIELDS: &str = "authorization, content-type, content-range, grpc-timeout, idempotency-key, if-match, \
                              if-none-match, last-event-id, range, x-grpc-web, x-user-agent";
/// Fields of answers that pages may read, besides those that browsers always show.
const ANSWER_FIELDS: &str = "accept-ranges, content-range, etag, grpc-message, grpc-status, grpc-status-details-bin, \
                             picture-psnr, picture-psnr-with-offset, picture-size, retry-after, x-request-id";
/// Time for which a browser may remember the answer to a preflight \[s\]. A changed setting counts after it.
const REMEMBERED_S: &str = "600";

/// Answers the preflights of allowed pages, and lets their browsers hand them the answers to their calls. Other requests
/// pass as they are: admission refuses those of other pages.
pub(super) async fn with_cors(State(origins): State<Origins>, request: Request, next: Next) -> Response {
    let origin = request.headers().get(header::ORIGIN).cloned();
    let allowed = origin.filter(|origin| origin.to_str().is_ok_and(|origin| origins.contains(origin)));
    let is_preflight =
        request.method() == Method::OPTIONS && request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    let mut response = match allowed.is_some() && is_preflight {
        true => preflight(),
        false => next.run(request).await,
    };
    let fields = response.headers_mut();
    if origins != Origins::default() {
        // A browser must not hand a page what it keeps from a call of another page.
        fields.append(header::VARY, HeaderValue::from_static("origin"));
    }
    if let Some(origin) = allowed {
        fields.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin);
        fields.insert(header::ACCESS_CONTROL_EXPOSE_HEADERS, HeaderValue::from_static(ANSWER_FIELDS));
    }
    response
}

fn preflight() -> Response {
    let fields = [
        (header::ACCESS_CONTROL_ALLOW_METHODS, METHODS),
        (header::ACCESS_CONTROL_ALLOW_HEADERS, REQUEST_FIELDS),
        (header::ACCESS_CONTROL_MAX_AGE, REMEMBERED_S),
    ];
    (StatusCode::NO_CONTENT, fields).into_response()
}
