//! gRPC-Web: the gRPC API for web pages, whose browsers show them no trailers. A call becomes one of gRPC before all
//! checks, and the trailers of its answer become its last frame.

use super::protocol::is_grpc;
use axum::Router;
use axum::extract::{Request, State};
use axum::http::header;
use axum::middleware::{self, Next};
use axum::response::Response;
use tonic::codegen::Service as _;
use tonic_web::GrpcWebLayer;

/// Lets a router answer calls of gRPC-Web, too.
pub(super) fn with_grpc_web(router: Router) -> Router {
    let translating = Router::new().fallback_service(router.clone()).layer(GrpcWebLayer::new());
    router.layer(middleware::from_fn_with_state(translating, translate))
}

async fn translate(State(mut translating): State<Router>, request: Request, next: Next) -> Response {
    let content_type = request.headers().get(header::CONTENT_TYPE).map(|value| value.as_bytes());
    // Other types are left to admission. A page of another site sends this one only if the server agrees to it first.
    let is_web = content_type.is_some_and(|value| value.starts_with(b"application/grpc-web"));
    if !is_web || !is_grpc(request.uri().path()) {
        return next.run(request).await;
    }
    let Ok(response) = translating.call(request).await;
    response
}
