//! Errors as answers, in gRPC or HTTP.

use crate::status;
use axum::Extension;
use axum::body::Body;
use axum::extract::Query;
use axum::extract::rejection::QueryRejection;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use http_body::Frame;
use lightpath_proto::code_name;
use lightpath_service::{Field, ServiceError, shortened};
use prost::bytes::Bytes;
use serde_json::{Value, json};
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::{FieldViolation, StatusExt as _};

/// The answer to a refused call.
pub(super) fn refuse(status: Status, is_grpc: bool) -> Response {
    if is_grpc { status.into_http() } else { Refusal::from(status).into_response() }
}

/// The last frame of an answer that has started and cannot continue.
pub(super) fn closing_frame(status: Status, is_grpc: bool) -> Result<Frame<Bytes>, axum::Error> {
    if !is_grpc {
        return Err(axum::Error::new(status));
    }
    let mut trailers = HeaderMap::new();
    status.add_header(&mut trailers).map_err(axum::Error::new)?;
    Ok(Frame::trailers(trailers))
}

/// A refused call as an answer: problem details of RFC 9457, `application/problem+json`. The body is written where the
/// id of the request is known ([`with_problem`]).
#[derive(Clone, Debug)]
pub(super) struct Refusal {
    status: Status,
    http: StatusCode,
}

impl From<Status> for Refusal {
    fn from(status: Status) -> Self {
        let http = http_status(status.code());
        Self { status, http }
    }
}

impl From<ServiceError> for Refusal {
    fn from(error: ServiceError) -> Self {
        status::of(error).into()
    }
}

impl Refusal {
    /// A refusal that only HTTP knows. `fix` says what to do.
    pub(super) fn new(http: StatusCode, code: Code, reason: &'static str, message: String, fix: &'static str) -> Self {
        Self { status: status::plain(code, reason, message, fix), http }
    }

    /// The refusal with an HTTP status that says more than the gRPC code.
    pub(super) fn with_status(self, http: StatusCode) -> Self {
        Self { http, ..self }
    }

    /// Whether somebody else changed the same thing.
    pub(super) fn is_aborted(&self) -> bool {
        self.status.code() == Code::Aborted
    }

    /// The body of the answer to a request with this id.
    pub(super) fn json(&self, request_id: &str) -> Vec<u8> {
        let (code, details) = (self.status.code(), self.status.get_error_details());
        let mut problem = json!({
            "title": title(code),
            "status": self.http.as_u16(),
            "detail": self.status.message(),
            "grpc_code": code_name(code),
            "request_id": request_id,
            "fields": details.bad_request().map_or_else(Vec::new, |bad| bad.field_violations.iter().map(field).collect()),
        });
        if let Some(info) = details.error_info() {
            problem["type"] = json!(format!("urn:lightpath:error:{}", info.reason));
            problem["reason"] = json!(info.reason);
            for (name, value) in &info.metadata {
                problem[name] = json!(value);
            }
        }
        if let Some(fix) = details.localized_message() {
            problem["fix"] = json!(fix.message);
        }
        if let (Some(_), Some(problem)) = (details.bad_request(), problem.as_object_mut()) {
            // The first field is among the fields, with its problem and its fix.
            problem.remove("field");
        }
        if let Some(delay) = self.retry_after() {
            problem["retry_after_s"] = json!(delay.as_secs_f64());
        }
        problem.to_string().into_bytes()
    }

    fn retry_after(&self) -> Option<Duration> {
        self.status.get_error_details().retry_info().and_then(|info| info.retry_delay)
    }
}

/// A wrong field with what is wrong and what to do.
fn field(wrong: &FieldViolation) -> Value {
    let fix = wrong.localized_message.as_ref().map_or("", |fix| &fix.message);
    json!({ "field": wrong.field, "problem": wrong.description, "fix": fix })
}

/// The gRPC code of a refusal, kept with its answer for the audit log.
#[derive(Clone, Copy, Debug)]
pub(super) struct RefusalCode(pub(super) Code);

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let code = RefusalCode(self.status.code());
        let retry = self.retry_after().map(|delay| [(header::RETRY_AFTER, delay.as_secs().max(1).to_string())]);
        (self.http, Extension(code), retry, Extension(self)).into_response()
    }
}

/// The answer to the request with this id: a refusal gets its body.
pub(super) fn with_problem(mut response: Response, request_id: &str) -> Response {
    let refusal = match response.extensions_mut().remove::<Refusal>() {
        Some(refusal) => refusal,
        // The router of the paths with handlers of their own refuses a wrong verb without a body.
        None if response.status() == StatusCode::METHOD_NOT_ALLOWED => {
            wrong_verb("the path has other verbs".to_owned())
        }
        None => return response,
    };
    response.headers_mut().insert(header::CONTENT_TYPE, PROBLEM);
    response.headers_mut().remove(header::CONTENT_LENGTH);
    response.map(|_| Body::from(refusal.json(request_id)))
}

/// The refusal of a verb that a path does not have.
pub(super) fn wrong_verb(message: String) -> Refusal {
    let fix = "use a verb that the header Allow lists";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, Code::Unimplemented, "WRONG_VERB", message, fix)
}

/// The refusal of a body of another type.
pub(super) fn wrong_content_type(given: &str, rule: &str) -> Refusal {
    let error = Field::new("the header content-type").but(format!("is {:?}", shortened(given)), rule);
    Refusal::from(error).with_status(StatusCode::UNSUPPORTED_MEDIA_TYPE)
}

/// The parameters of a request, or a refusal that names what is wrong.
pub(super) fn checked<T>(query: Result<Query<T>, QueryRejection>) -> Result<Query<T>, Refusal> {
    let fix = "give the parameters of the path as in /openapi.json";
    query.map_err(|rejection| Field::new("the query").invalid(rejection.body_text(), fix).into())
}

const PROBLEM: HeaderValue = HeaderValue::from_static("application/problem+json");

/// What all errors of a code have in common.
fn title(code: Code) -> &'static str {
    match code {
        Code::InvalidArgument | Code::OutOfRange => "The request is wrong",
        Code::NotFound => "Something that the request names does not exist",
        Code::AlreadyExists => "Something else has this name already",
        Code::FailedPrecondition => "The present state does not allow the request",
        Code::Aborted => "Somebody else changed the same thing",
        Code::Unauthenticated => "The request has no valid token",
        Code::PermissionDenied => "The caller may not do this",
        Code::ResourceExhausted => "A limit is reached",
        Code::Unavailable => "The server cannot answer now",
        Code::Unimplemented => "The path does not have this verb",
        Code::Cancelled | Code::DeadlineExceeded => "The call ended before its answer",
        Code::Ok | Code::Unknown | Code::Internal | Code::DataLoss => "The server failed",
    }
}

/// The HTTP status of a gRPC code, as in google.rpc.Code.
fn http_status(code: Code) -> StatusCode {
    match code {
        Code::Ok => StatusCode::OK,
        Code::Cancelled => StatusCode::REQUEST_TIMEOUT,
        Code::Unknown => StatusCode::INTERNAL_SERVER_ERROR,
        Code::InvalidArgument => StatusCode::BAD_REQUEST,
        Code::DeadlineExceeded => StatusCode::GATEWAY_TIMEOUT,
        Code::NotFound => StatusCode::NOT_FOUND,
        Code::AlreadyExists => StatusCode::CONFLICT,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        Code::ResourceExhausted => StatusCode::TOO_MANY_REQUESTS,
        Code::FailedPrecondition => StatusCode::BAD_REQUEST,
        Code::Aborted => StatusCode::CONFLICT,
        Code::OutOfRange => StatusCode::RANGE_NOT_SATISFIABLE,
        Code::Unimplemented => StatusCode::NOT_IMPLEMENTED,
        Code::Internal => StatusCode::INTERNAL_SERVER_ERROR,
        Code::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        Code::DataLoss => StatusCode::INTERNAL_SERVER_ERROR,
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
    }
}
