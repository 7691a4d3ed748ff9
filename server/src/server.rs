//! The server, assembled: store, artifacts, workers, gRPC and HTTP.

use crate::api::Api;
use crate::artifacts::{ArtifactError, Artifacts};
use crate::config::Config;
use crate::connections;
use crate::http;
use crate::metrics;
use crate::store::{QueueLimits, Store, StoreError};
use crate::upkeep::{Collected, DATABASE, Retention, UpkeepError};
use crate::worker::{Clock, OpticsTask, Worker, WorkerConfig, WorkerError};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio::time::{interval, timeout};
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

/// How often the bytes of all artifacts are counted, for their limit.
const COUNT_INTERVAL: Duration = Duration::from_secs(10);
/// How often what may go is looked for.
const COLLECT_INTERVAL: Duration = Duration::from_secs(3600);

/// Why the server could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data folder cannot be used, for example because another server works in it.
    #[error(transparent)]
    Artifacts(#[from] ArtifactError),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The workers cannot start.
    #[error(transparent)]
    Worker(#[from] WorkerError),
    /// The workers panicked.
    #[error("the workers failed")]
    Panic(#[from] JoinError),
    /// The API's descriptors cannot be read.
    #[error("the API's descriptors cannot be read")]
    Reflection(#[from] tonic_reflection::server::Error),
}

/// Serves on `listener` until `shutdown` is done, then drains: no new connections, health says NOT_SERVING, streams
/// end with UNAVAILABLE, running jobs save their state and go back to the queue. Returns after that, at most
/// `config.drain_deadline` later.
///
/// # Errors
///
/// [`ServeError`] when the server cannot start; nothing is half done then.
pub async fn run(
    listener: TcpListener,
    config: Config,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), ServeError> {
    metrics::install();
    let data_dir = config.data_dir.clone();
    let space = config.space;
    let artifacts = tokio::task::spawn_blocking(move || Artifacts::open_within(&data_dir, space)).await??;
    let store = Store::open(&config.data_dir.join(DATABASE)).await?;
    artifacts.set_stored_bytes(store.artifact_totals().await?.1);
    let stopping = CancellationToken::new();
    let upkeep = tokio::spawn(upkeep_loop(store.clone(), artifacts.clone(), config.retention, stopping.clone()));
    let limits = QueueLimits { queued: config.queue_limit, queued_per_owner: config.owner_queue_limit };
    let api = Api::new(store.clone(), artifacts.clone(), limits, stopping.clone());
    let (grpc, health) = api.clone().routes()?;
    set_health(&health, ServingStatus::Serving).await;
    let mut workers = start_workers(store, artifacts, &config, stopping.clone());
    let app = http::router(api, grpc);
    let connections = tokio::spawn(connections::serve(listener, app, stopping.clone(), config.drain_deadline));

    let early = tokio::select! {
        () = shutdown => None,
        // Workers end only when told to, unless they could not start.
        ended = &mut workers => Some(ended),
    };
    tracing::info!("stopping: running jobs save their state and go back to the queue");
    set_health(&health, ServingStatus::NotServing).await;
    stopping.cancel();
    let workers_ended = match early {
        Some(ended) => ended,
        None => match timeout(config.drain_deadline, &mut workers).await {
            Ok(ended) => ended,
            Err(_) => {
                tracing::warn!("some jobs did not stop in time; their leases run out, and they start again");
                workers.abort();
                Ok(Ok(()))
            }
        },
    };
    connections.await?;
    upkeep.await?;
    workers_ended??;
    tracing::info!("stopped");
    Ok(())
}

fn start_workers(
    store: Store,
    artifacts: Artifacts,
    config: &Config,
    stopping: CancellationToken,
) -> JoinHandle<Result<(), WorkerError>> {
    let config = WorkerConfig {
        workers: config.workers as usize,
        compute_threads: config.compute_threads,
        lease: config.lease,
        checkpoint_interval: config.checkpoint_interval,
        limits: config.running,
        timeouts: config.timeouts,
        ..WorkerConfig::default()
    };
    tokio::spawn(Worker::new(store, artifacts, config, Arc::new(OpticsTask)).run(stopping))
}

/// Counts what is stored, and removes what may go.
async fn upkeep_loop(store: Store, artifacts: Artifacts, retention: Retention, stopping: CancellationToken) {
    let (mut count, mut collect) = (interval(COUNT_INTERVAL), interval(COLLECT_INTERVAL));
    loop {
        let outcome = tokio::select! {
            () = stopping.cancelled() => return,
            _ = count.tick() => store.artifact_totals().await.map(|(_, bytes)| artifacts.set_stored_bytes(bytes)).map_err(Into::into),
            _ = collect.tick() => async {
                let collected = retention.collect(&store, &artifacts, Clock::default().now_ms()).await?;
                if collected != Collected::default() {
                    let Collected { jobs, artifacts, artifact_bytes } = collected;
                    tracing::info!(jobs, artifacts, artifact_bytes, "removed what was kept for long enough");
                }
                Ok::<(), UpkeepError>(())
            }.await,
        };
        if let Err(error) = outcome {
            tracing::error!(error = &error as &dyn std::error::Error, "upkeep failed; it is tried again later");
        }
    }
}

async fn set_health(health: &HealthReporter, status: ServingStatus) {
    use lightpath_proto::v1::{
        artifact_service_server, dataset_service_server, display_service_server, job_service_server,
        kernel_service_server,
    };
    // The empty name is the server as a whole.
    for service in [
        "",
        artifact_service_server::SERVICE_NAME,
        dataset_service_server::SERVICE_NAME,
        display_service_server::SERVICE_NAME,
        job_service_server::SERVICE_NAME,
        kernel_service_server::SERVICE_NAME,
    ] {
        health.set_service_status(service, status).await;
    }
}
