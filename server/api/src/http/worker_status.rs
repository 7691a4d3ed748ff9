//! Health and metrics of a process that only runs jobs.

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use lightpath_artifacts::Artifacts;
use lightpath_metrics as metrics;
use lightpath_service::{Result, ServiceError};
use lightpath_store::Store;
use std::io;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

/// A worker whose database does not answer within this time is not healthy.
const ANSWER_MAX: Duration = Duration::from_secs(5);

#[derive(Clone)]
struct Worker {
    store: Store,
    artifacts: Artifacts,
}

/// Answers `/healthz` and `/metrics` on `listener` until `stopping` is cancelled. There are no tokens: neither says more
/// than numbers.
///
/// # Errors
///
/// Errors of the listener.
pub async fn serve_worker_status(
    listener: TcpListener,
    store: Store,
    artifacts: Artifacts,
    stopping: CancellationToken,
) -> io::Result<()> {
    let paths = Router::new()
        .route("/healthz", get(health))
        .route("/metrics", get(metrics_text))
        .with_state(Worker { store, artifacts });
    axum::serve(listener, paths).with_graceful_shutdown(stopping.cancelled_owned()).await
}

async fn health(State(worker): State<Worker>) -> Response {
    match worker.can_work().await {
        Ok(()) => (StatusCode::OK, "working\n").into_response(),
        Err(problem) => (StatusCode::SERVICE_UNAVAILABLE, format!("{problem}\n")).into_response(),
    }
}

async fn metrics_text(State(worker): State<Worker>) -> Response {
    match metrics::render(&worker.store, &worker.artifacts, worker.store.now_ms()).await {
        Ok(text) => ([(header::CONTENT_TYPE, super::METRICS_TYPE)], text).into_response(),
        Err(error) => (StatusCode::SERVICE_UNAVAILABLE, format!("{error}\n")).into_response(),
    }
}

impl Worker {
    async fn can_work(&self) -> Result<()> {
        self.artifacts.space().room_to_start()?;
        timeout(ANSWER_MAX, self.store.queue_counts()).await.map_err(|_| ServiceError::DatabaseSilent)??;
        Ok(())
    }
}
