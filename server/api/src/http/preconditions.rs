//! What headers say about a call that changes something: `idempotency-key`, by which the server knows a repeated request,
//! and `if-match`, with which a call changes a resource only if it is still what the client has seen.
//!
//! The ETag of an answer is that of its text. So `if-match` is checked against the present answer about the resource,
//! and the call itself then expects the version or revision that this answer has: nothing can change in between.

use super::etags::etag;
use super::grpc_call::unary;
use super::refusal::Refusal;
use axum::Router;
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, StatusCode, header};
use lightpath_proto::routes::{self, FromHeader, Match};
use lightpath_service::Field;
use serde_json::Value;
use tonic::Code;

const IDEMPOTENCY_KEY: &str = "idempotency-key";

/// The fields of a request that its headers give.
pub(super) async fn from_headers(
    grpc: &Router,
    found: &Match,
    parts: &Parts,
    body: &[u8],
) -> Result<Vec<FromHeader>, Refusal> {
    if parts.method == Method::GET || parts.method == Method::HEAD {
        return Ok(Vec::new());
    }
    let mut given = Vec::new();
    if let Some(key) = text(&parts.headers, IDEMPOTENCY_KEY) {
        let header = "the header idempotency-key";
        let field = found.route.request_id.ok_or_else(|| no_meaning(header, "this call has no request id"))?;
        // The header is a text in quotes; many clients leave them out.
        let key = key.strip_prefix('"').and_then(|key| key.strip_suffix('"')).unwrap_or(key);
        given.push(FromHeader { header, field, value: key.into() });
    }
    if let Some(tags) = text(&parts.headers, header::IF_MATCH.as_str()) {
        let header = "the header if-match";
        let field = found.route.expected.ok_or_else(|| no_meaning(header, "this call expects no version"))?;
        let seen = seen(grpc, found, parts, tags).await?;
        given.push(FromHeader { header, field, value: expected(field[0], &seen, body) });
    }
    Ok(given)
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

fn no_meaning(header: &str, why: &str) -> Refusal {
    Field::new(header).invalid(format!("is given, but {why}"), "leave it out").into()
}

/// The present answer about the resource in the path, which must be what the client has seen.
async fn seen(grpc: &Router, found: &Match, parts: &Parts, tags: &str) -> Result<Value, Refusal> {
    let name = found.resource().unwrap_or_default();
    let resource = routes::find("GET", &format!("/v1/{name}")).map_err(|_| changed(name))?;
    let request = resource.request(Vec::new(), &[], &[]).map_err(|_| changed(name))?;
    let answer = unary(grpc.clone(), resource.route, parts.extensions.clone(), request.message.into()).await?;
    let etag = etag(&answer);
    if !tags.split(',').map(str::trim).any(|tag| tag == "*" || tag == etag) {
        return Err(changed(name));
    }
    Ok(serde_json::from_slice(&answer).unwrap_or_default())
}

/// What a call expects of a resource, such as its revision in the field `expected_revision`. No version is expected as 0.
fn expected(field: &str, seen: &Value, body: &[u8]) -> Value {
    match field {
        "expected_revision" => seen["revision"].clone(),
        "expected_active_version" => seen.get("activeVersion").cloned().unwrap_or_else(|| 0.into()),
        // The version that the alias of the request names.
        _ => {
            let request: Value = serde_json::from_slice(body).unwrap_or_default();
            let named = request["alias"].as_str().and_then(|alias| seen["aliases"].get(alias));
            named.cloned().unwrap_or_else(|| 0.into())
        }
    }
}

fn changed(name: &str) -> Refusal {
    let fix = "read it again, and decide again";
    let message = format!("{name} is no longer what the header if-match names; {fix}");
    Refusal::new(StatusCode::PRECONDITION_FAILED, Code::Aborted, "CHANGED", message, fix)
}
