//! Errors as answers, in gRPC or HTTP.

use crate::status;
use axum::Extension;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use http_body::Frame;
use lightpath_proto::code_name;
use lightpath_service::ServiceError;
use prost::bytes::Bytes;
use serde_json::{Value, json};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

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

/// An error in the form `{"error": {"code", "status", "message", "reason", "metadata"}}`.
#[derive(Debug)]
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
    /// The refusal with an HTTP status that says more than the gRPC code.
    pub(super) fn with_status(self, http: StatusCode) -> Self {
        Self { http, ..self }
    }

    /// The body of the answer.
    pub(super) fn json(&self) -> Vec<u8> {
        let name = code_name(self.status.code());
        let mut error = json!({ "code": self.http.as_u16(), "status": name, "message": self.status.message() });
        if let Some(info) = self.status.get_error_details().error_info() {
            error["reason"] = Value::from(info.reason.clone());
            error["metadata"] = json!(info.metadata);
        }
        json!({ "error": error }).to_string().into_bytes()
    }
}

/// The gRPC code of a refusal, kept with its answer for the audit log.
#[derive(Clone, Copy, Debug)]
pub(super) struct RefusalCode(pub(super) Code);

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let code = RefusalCode(self.status.code());
        let delay = self.status.get_error_details().retry_info().and_then(|info| info.retry_delay);
        let retry = delay.map(|delay| [(header::RETRY_AFTER, delay.as_secs().max(1).to_string())]);
        let json = [(header::CONTENT_TYPE, "application/json")];
        (self.http, Extension(code), retry, json, self.json()).into_response()
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
