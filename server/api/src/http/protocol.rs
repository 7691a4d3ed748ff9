//! The protocol of a request. Its path decides, never a header that the client chooses freely.

use crate::status;
use axum::extract::Request;
use axum::http::{Method, header};
use tonic::{Code, Status};

/// Whether a path is that of a gRPC method, `/package.Service/Method`. No other path of the server has this form.
pub(super) fn is_grpc(path: &str) -> bool {
    let service = path.strip_prefix('/').and_then(|path| path.split_once('/'));
    service.is_some_and(|(service, method)| service.contains('.') && !method.contains('/'))
}

/// Refuses a request for a gRPC method that is no gRPC request. A web page of another site can send such requests
/// without asking, for example with the content type `text/plain`.
///
/// # Errors
///
/// INVALID_ARGUMENT with the fix.
pub(super) fn require_grpc(request: &Request) -> Result<(), Status> {
    let content_type = request.headers().get(header::CONTENT_TYPE).map(|value| value.as_bytes());
    let is_content_type = match content_type.and_then(|value| value.strip_prefix(b"application/grpc")) {
        Some(rest) => rest.is_empty() || rest.starts_with(b"+proto") || rest.starts_with(b";"),
        None => false,
    };
    if request.method() == Method::POST && is_content_type {
        return Ok(());
    }
    let message = "the path is a gRPC method, so the request must be a POST with the content type application/grpc";
    let fix = "use a client of gRPC, or a path of /openapi.json";
    Err(status::plain(Code::InvalidArgument, "NOT_GRPC", message.to_owned(), fix))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    fn is_accepted(method: &str, content_type: Option<&str>) -> bool {
        let request = Request::builder().method(method).uri("/lightpath.v1.JobService/GetJob");
        let request = content_type.into_iter().fold(request, |request, value| request.header("content-type", value));
        require_grpc(&request.body(Body::empty()).unwrap()).is_ok()
    }

    #[test]
    fn only_grpc_requests_reach_grpc_methods() {
        for content_type in ["application/grpc", "application/grpc+proto", "application/grpc;x=y"] {
            assert!(is_accepted("POST", Some(content_type)), "{content_type}");
            assert!(!is_accepted("GET", Some(content_type)), "{content_type}");
        }
        let others =
            ["text/plain", "application/json", "application/grpc-web", "application/grpcx", "Application/Grpc", ""];
        for content_type in others {
            assert!(!is_accepted("POST", Some(content_type)), "{content_type}");
        }
        assert!(!is_accepted("POST", None));
    }

    #[test]
    fn the_path_decides_the_protocol() {
        assert!(is_grpc("/lightpath.v1.JobService/GetJob") && is_grpc("/grpc.health.v1.Health/Check"));
        assert!(is_grpc("/other.Service/Method"));
        assert!(!is_grpc("/v1/jobs") && !is_grpc("/") && !is_grpc("/healthz") && !is_grpc("/v1/jobs/a.b/c"));
    }
}
