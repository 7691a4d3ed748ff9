//! Plain HTTP beside gRPC: health, metrics, and jobs as JSON with the same messages.
//!
//! # Layout
//!
//! - `gate`: identifies callers and checks their roles. `rate`: rate limits. `token_expiry`: ends calls of invalid
//!   tokens.
//! - `memory_use`: memory of each call, taken from a `memory_budget`. `checked_body`: bodies whose frames these check.
//! - `requests`: deadlines and metrics of requests, including gRPC. `jobs_json`: `/v1/jobs`. `refusal`: errors as
//!   answers.

mod checked_body;
mod gate;
mod jobs_json;
mod memory_budget;
mod memory_use;
mod rate;
mod refusal;
mod requests;
mod token_expiry;

use crate::api::Api;
use crate::error::ApiError;
use crate::time::now_ms;
use axum::Router;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::middleware;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
pub use gate::Gate;
use lightpath_metrics as metrics;
pub use memory_budget::MemoryBudget;
pub use rate::Rate;
use refusal::Refusal;
use std::sync::Arc;
pub use token_expiry::EndedTokens;
use tonic::Status;

/// The router for gRPC and HTTP.
pub fn router(gate: Gate, budget: Arc<MemoryBudget>, grpc: tonic::service::Routes) -> Router {
    let api = gate.api.clone();
    let http = Router::new()
        .route("/healthz", get(health))
        .route("/metrics", get(metrics))
        .route("/v1/jobs", get(jobs_json::list_jobs))
        .route("/v1/jobs/{id}", get(jobs_json::get_job))
        .fallback(unknown)
        .with_state(api.clone());
    // Both routers have a fallback, and a merged router can have only one.
    let grpc = grpc.into_axum_router().reset_fallback();
    http.merge(grpc)
        .layer(middleware::from_fn_with_state(gate, gate::pass))
        .layer(middleware::from_fn_with_state(budget, memory_use::with_memory_limit))
        .layer(middleware::from_fn_with_state(api, requests::with_deadline))
}

async fn health(State(api): State<Api>) -> Response {
    match api.is_serving().await {
        Ok(()) => (StatusCode::OK, "serving\n").into_response(),
        Err(error) => (StatusCode::SERVICE_UNAVAILABLE, format!("{}\n", Status::from(error).message())).into_response(),
    }
}

async fn metrics(State(api): State<Api>) -> Result<Response, Refusal> {
    /// Content type of the text format of Prometheus.
    const TEXT_FORMAT: &str = "text/plain; version=0.0.4; charset=utf-8";
    let text = metrics::render(&api.store, &api.artifacts, now_ms()).await.map_err(ApiError::from)?;
    Ok(([(header::CONTENT_TYPE, TEXT_FORMAT)], text).into_response())
}

/// Answers an unknown path in the protocol of the client.
async fn unknown(request: Request) -> Response {
    let content_type = request.headers().get(header::CONTENT_TYPE).map(|value| value.as_bytes());
    let path = request.uri().path();
    if content_type.is_some_and(|value| value.starts_with(b"application/grpc")) {
        return Status::unimplemented(format!("the method {path} does not exist")).into_http();
    }
    Refusal::from(Status::not_found(format!("the path {path} does not exist"))).into_response()
}
