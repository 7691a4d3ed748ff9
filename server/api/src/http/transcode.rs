//! Every method of the API over HTTP: a path and JSON become a call of the gRPC method in this process, and its answer
//! becomes JSON. So HTTP has the same checks, errors and messages as gRPC.

use super::checked_body::status_of;
use super::etags::{ASKED_AGAIN, etag, text_value, unless_known};
use super::grpc_call::{streaming, unary};
use super::preconditions::from_headers;
use super::protocol::is_grpc;
use super::refusal::{Refusal, refuse, wrong_content_type, wrong_verb};
use super::request_id::RequestId;
use super::server_sent_events::{add_last_event_id, events};
use crate::{fixes, status};
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use lightpath_proto::routes::{self, EncodedRequest, Match};
use lightpath_service::Field;
use prost::bytes::Bytes;
use tonic::Code;

/// Limit on the body of a request \[bytes\]. The parsed JSON takes up to sixteen times as much memory, which is the
/// memory that a message over gRPC may take.
const JSON_BYTES_MAX: usize = 256 << 10;

/// Header that names the fields of a body which the method does not know and ignores.
const IGNORED_FIELDS: &str = "lightpath-ignored-fields";
/// Limit on the ignored fields that a header names.
const IGNORED_NAMED_MAX: usize = 10;

/// The method that a request calls over HTTP; for a known path with another verb, the verbs that it has.
#[derive(Clone, Debug)]
pub(super) struct Called(Result<Match, Vec<&'static str>>);

impl Called {
    /// Path of the gRPC method; `None` if the verb is wrong.
    pub(super) fn method(&self) -> Option<&'static str> {
        self.0.as_ref().ok().map(|found| found.route.method)
    }
}

/// Finds the method before all other layers, which then know what is called.
pub(super) async fn find_method(mut request: Request, next: Next) -> Response {
    // HEAD asks for the header of GET. The server leaves out the body.
    let verb = if request.method() == Method::HEAD { &Method::GET } else { request.method() };
    let found = routes::find(verb.as_str(), request.uri().path());
    if !matches!(&found, Err(verbs) if verbs.is_empty()) {
        request.extensions_mut().insert(Called(found));
    }
    next.run(request).await
}

/// Answers a request that no other route answers: calls its method, or says what is wrong with its path.
pub(super) async fn call_method(grpc: Router, request: Request) -> Response {
    let (mut parts, body) = request.into_parts();
    match parts.extensions.remove::<Called>() {
        Some(Called(Ok(found))) => call(grpc, found, parts, body).await.unwrap_or_else(IntoResponse::into_response),
        Some(Called(Err(verbs))) => verb_refusal(&parts, &verbs),
        None => unknown(parts.uri.path()),
    }
}

fn verb_refusal(parts: &Parts, verbs: &[&str]) -> Response {
    let (path, allowed) = (parts.uri.path(), verbs.join(", "));
    let message = format!("{} is not possible at {path}, only {allowed}", parts.method);
    let mut response = wrong_verb(message).into_response();
    response.headers_mut().insert(header::ALLOW, text_value(&allowed));
    response
}

/// Answers an unknown path in its protocol.
fn unknown(path: &str) -> Response {
    if is_grpc(path) {
        let message = format!("the method {path} does not exist");
        return refuse(status::plain(Code::Unimplemented, "NO_SUCH_METHOD", message, fixes::VERSIONS), true);
    }
    let message = format!("the path {path} does not exist");
    refuse(status::plain(Code::NotFound, "NO_SUCH_PATH", message, "look into /openapi.json for the paths"), false)
}

async fn call(grpc: Router, found: Match, parts: Parts, body: Body) -> Result<Response, Refusal> {
    let route = found.route;
    let Query(mut query) = Query::<Vec<(String, String)>>::try_from_uri(&parts.uri)
        .map_err(|rejection| Field::new("the query").invalid(rejection.body_text(), "send name=value pairs"))?;
    add_last_event_id(route, &parts.headers, &mut query);
    let body = json_body(&parts, body).await?;
    let given = from_headers(&grpc, &found, &parts, &body).await?;
    let request = found
        .request(query, &body, &given)
        .map_err(|error| Field::new(&error.field).invalid(error.problem, error.fix))?;
    let EncodedRequest { message, ignored } = request;
    let (extensions, message) = (parts.extensions, Bytes::from(message));
    if route.is_stream {
        let request_id = extensions.get::<RequestId>().cloned().unwrap_or_default();
        return Ok(events(streaming(grpc, route, extensions, message).await?, route, request_id));
    }
    let is_conditional = given.iter().any(|given| Some(given.field) == route.expected);
    let json = match unary(grpc, route, extensions, message).await {
        Err(refusal) if is_conditional && refusal.is_aborted() => {
            return Err(refusal.with_status(StatusCode::PRECONDITION_FAILED));
        }
        answer => answer?,
    };
    if parts.method != Method::GET && parts.method != Method::HEAD {
        return Ok((ignored_fields(&ignored), [(header::CONTENT_TYPE, JSON)], json).into_response());
    }
    Ok(json_answer(&parts.headers, json))
}

/// A header that names fields which the method ignored, so that a typing error does not go unnoticed.
fn ignored_fields(names: &[String]) -> Option<[(&'static str, HeaderValue); 1]> {
    // Other names are not those of fields, and need not fit into a header.
    let is_name =
        |name: &&str| name.len() <= 63 && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    let named: Vec<&str> = names.iter().map(String::as_str).filter(is_name).take(IGNORED_NAMED_MAX).collect();
    (!names.is_empty()).then(|| [(IGNORED_FIELDS, text_value(&named.join(", ")))])
}

/// JSON, or 304 if the client has it.
pub(super) fn json_answer(headers: &HeaderMap, json: impl AsRef<[u8]> + IntoResponse) -> Response {
    unless_known(headers, &etag(&json), ASKED_AGAIN, ([(header::CONTENT_TYPE, JSON)], json))
}

const JSON: HeaderValue = HeaderValue::from_static("application/json");

/// The body of a request, which must be JSON or empty.
async fn json_body(parts: &Parts, body: Body) -> Result<Bytes, Refusal> {
    let bytes = to_bytes(body, JSON_BYTES_MAX).await.map_err(|error| body_refusal(&error))?;
    let content_type = parts.headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("");
    let media_type = content_type.split(';').next().unwrap_or("").trim();
    // A web page of another site can send other types without asking.
    if !bytes.is_empty() && !media_type.eq_ignore_ascii_case("application/json") {
        return Err(wrong_content_type(content_type, "must be application/json"));
    }
    Ok(bytes)
}

/// The refusal of a body: that of the memory budget, which ends bodies with its status, or that of a long body.
fn body_refusal(error: &axum::Error) -> Refusal {
    if let Some(status) = status_of(error) {
        return status.into();
    }
    let problem = "did not arrive, or is too long";
    let error = Field::new("the body").but(problem, format!("at most {JSON_BYTES_MAX} bytes are accepted"));
    Refusal::from(error).with_status(StatusCode::PAYLOAD_TOO_LARGE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::stream;
    use tonic::Status;

    #[tokio::test]
    async fn a_body_that_ends_with_a_status_is_refused_with_it() {
        let refused = |error: Status| async {
            let body = Body::from_stream(stream::iter([Ok(Bytes::from_static(b"{")), Err(error)]));
            let (parts, ()) = Request::new(()).into_parts();
            json_body(&parts, body).await.unwrap_err().into_response().status()
        };
        assert_eq!(refused(Status::resource_exhausted("no memory left")).await, StatusCode::TOO_MANY_REQUESTS);
        let (parts, ()) = Request::new(()).into_parts();
        let long = json_body(&parts, Body::from(vec![b' '; JSON_BYTES_MAX + 1])).await.unwrap_err();
        assert_eq!(long.into_response().status(), StatusCode::PAYLOAD_TOO_LARGE);
    }
}
