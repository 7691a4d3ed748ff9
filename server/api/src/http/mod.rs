//! Plain HTTP beside gRPC: health, metrics, the methods of the API as JSON, and kernels for firmware.
//!
//! # Layout
//!
//! - `admission`: identifies callers and checks their roles. `origin`: keeps out web pages of other sites. `protocol`: gRPC or
//!   HTTP. `token_expiry`: ends calls of invalid tokens. `known_tokens`: tokens that were accepted lately.
//! - `cors`: pages of other sites that may call the server. `grpc_web`: gRPC for web pages.
//! - `page`: the files of the dashboard. `compression`: gzip.
//! - `unread_body`: the rest of requests that are answered before it has arrived.
//! - `memory_use`: memory of each call, taken from the memory budget. `checked_body`: bodies whose frames these check.
//! - `requests`: deadlines and metrics of requests, including gRPC. `transcode`: the methods of the API as JSON.
//!   `server_sent_events`: their streams. `preconditions`: what headers say about calls that change something.
//!   `kernel_files`: kernels and keyrings for devices. `artifact_files`: files of datasets and results.
//!   `artifact_pictures`: the same as pictures. `live_pictures`: pictures of running jobs. `file_answer`, `byte_range`:
//!   files in ranges. `worker_status`: health and metrics of a process that only runs jobs. `etags`: conditions of requests. `refusal`: errors as answers.

mod admission;
mod artifact_files;
mod artifact_pictures;
mod byte_range;
mod checked_body;
mod compression;
mod cors;
mod etags;
mod file_answer;
mod grpc_call;
mod grpc_web;
mod kernel_files;
mod known_tokens;
mod live_pictures;
mod memory_use;
mod origin;
mod page;
mod preconditions;
mod protocol;
mod refusal;
mod request_id;
mod requests;
mod server_sent_events;
mod token_expiry;
mod transcode;
mod unread_body;
mod worker_status;

pub use crate::accounts::{MemoryBudget, Rate};
use crate::api::Api;
pub use admission::Admission;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware;
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get, post, put};
use axum::{Extension, Router};
pub use known_tokens::KnownTokens;
use lightpath_metrics as metrics;
use lightpath_service::{Call, ServiceError};
pub use origin::Hosts;
use refusal::Refusal;
use std::sync::Arc;
pub use token_expiry::EndedTokens;
pub use worker_status::serve_worker_status;

/// Content type of the metrics: the text format of Prometheus.
const METRICS_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

const ARTIFACT_UPLOAD: &str = "/v1/artifacts/{digest}/upload";
const UNNAMED_UPLOAD: &str = "/v1/artifacts";

/// The paths of plain HTTP that have handlers of their own.
fn routes() -> [(&'static str, MethodRouter<Api>); 15] {
    [
        ("/healthz", get(health)),
        ("/metrics", get(metrics)),
        ("/v1/artifacts/{digest}/content", get(artifact_files::get_content)),
        ("/v1/artifacts/{digest}/picture", get(artifact_pictures::get_picture)),
        (ARTIFACT_UPLOAD, put(artifact_files::upload).layer(DefaultBodyLimit::disable())),
        (UNNAMED_UPLOAD, post(artifact_files::upload_unnamed).layer(DefaultBodyLimit::disable())),
        ("/v1/colormaps/{colormap}", get(artifact_pictures::get_colormap)),
        ("/v1/jobs/{job}/picture", get(live_pictures::get_live_picture)),
        ("/openapi.json", get(get_openapi)),
        ("/v1/keyring", get(kernel_files::get_keyring)),
        ("/v1/displays/{display}/kernels/{kernel}/manifest", get(kernel_files::get_manifest)),
        ("/v1/displays/{display}/kernels/{kernel}/versions/{version}/{format}/{digest}", get(kernel_files::get_file)),
        ("/v1/displays/{display}/kernels/{kernel}/versions/{version}/file", get(kernel_files::get_version_file)),
        ("/", get(page::get_index)),
        ("/page/{*file}", get(page::get_file)),
    ]
}

/// The router for gRPC and HTTP.
pub fn router(admission: Admission, budget: Arc<MemoryBudget>, grpc: tonic::service::Routes) -> Router {
    requests::expect_all();
    let (api, origins) = (admission.api.clone(), admission.hosts.pages().clone());
    // Both routers have a fallback, and a merged router can have only one.
    let grpc = grpc.into_axum_router().reset_fallback();
    let methods = grpc.clone();
    let http = routes()
        .into_iter()
        .fold(Router::new(), |router, (path, methods)| router.route(path, methods))
        .fallback(move |request| transcode::call_method(methods.clone(), request))
        .with_state(api.clone())
        .layer(middleware::from_fn(memory_use::with_uncompressed_counted));
    let app = compression::with_compression(http)
        .merge(grpc)
        .layer(middleware::from_fn_with_state(admission, admission::pass))
        .layer(middleware::from_fn_with_state(budget, memory_use::with_memory_limit))
        .layer(middleware::from_fn_with_state(api, requests::with_deadline))
        .layer(middleware::from_fn(transcode::find_method));
    grpc_web::with_grpc_web(app)
        .layer(middleware::from_fn_with_state(origins, cors::with_cors))
        .layer(middleware::from_fn(unread_body::with_rest_read))
}

async fn health(State(api): State<Api>) -> Response {
    match api.health() {
        Ok(()) => (StatusCode::OK, "serving\n").into_response(),
        Err(problem) => (StatusCode::SERVICE_UNAVAILABLE, format!("{problem}\n")).into_response(),
    }
}

/// Answers with the document of this API.
async fn get_openapi(headers: HeaderMap) -> Response {
    transcode::json_answer(&headers, lightpath_proto::OPENAPI)
}

/// Answers with the metrics, which name all displays.
async fn metrics(State(api): State<Api>, Extension(call): Extension<Call>) -> Result<Response, Refusal> {
    if !call.caller.displays.is_empty() {
        let message = format!(
            "the token \"{}\" is for some displays only, but the metrics are about all; ask an admin for a token for all",
            call.caller.name
        );
        return Err(ServiceError::Denied(message).into());
    }
    let text = metrics::render(&api.store, &api.artifacts, api.store.now_ms()).await.map_err(ServiceError::from)?;
    Ok(([(header::CONTENT_TYPE, METRICS_TYPE)], text).into_response())
}
