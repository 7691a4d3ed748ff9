//! The server, assembled: store, artifacts, workers, gRPC and HTTP.

use crate::config::{Config, ConfigError};
use crate::upkeep::{Collected, DATABASE, Retention, UpkeepError};
use lightpath_api::Api;
use lightpath_api::audit::Audit;
use lightpath_api::connections;
use lightpath_api::http::{self, EndedTokens, Gate, MemoryBudget, Rate};
use lightpath_api::tls::{self, Tls, TlsError};
use lightpath_artifacts::{ArtifactError, Artifacts};
use lightpath_metrics as metrics;
use lightpath_store::{Store, StoreError};
use lightpath_worker::{Clock, OpticsTask, Worker, WorkerError};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio::time::{interval, timeout};
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

/// How often the bytes of all artifacts are counted, for their limit, and measurements summed up.
const COUNT_INTERVAL: Duration = Duration::from_secs(10);
/// What the audit log may lose when the power fails.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);
/// How soon a change of health is told.
const HEALTH_INTERVAL: Duration = Duration::from_secs(2);
/// How soon a token that was revoked or has expired ends its streams.
const TOKEN_INTERVAL: Duration = Duration::from_secs(2);
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
    /// The listener is none.
    #[error("the listening address cannot be read")]
    Listener(#[source] io::Error),
    /// The audit log cannot be opened.
    #[error("the audit log cannot be opened")]
    Audit(#[source] io::Error),
    /// One half of a pair of settings is missing.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Certificates cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// Others than this machine could connect without TLS.
    #[error(
        "{address} can be reached from other machines, but there is no TLS: set tls_cert and tls_key, listen on \
         127.0.0.1, or say --insecure"
    )]
    NoTls {
        /// The listening address.
        address: SocketAddr,
    },
    /// Tokens are asked for, and there is none.
    #[error(
        "calls need a token, but none is valid: make one with `lightpathd token create NAME --role admin`, or listen on \
         127.0.0.1"
    )]
    NoTokens,
    /// The API's descriptors cannot be read.
    #[error("the API's descriptors cannot be read")]
    Reflection(#[from] tonic_reflection::server::Error),
}

/// Serves on `listener` until `shutdown` is done, then drains: no new connections, health says NOT_SERVING, streams
/// end with UNAVAILABLE, running jobs save their state and go back to the queue. Returns after that, at most
/// `config.drain_deadline_s` later.
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
    let (space, tls, retention) = (config.space(), config.tls()?, config.retention());
    let artifacts = tokio::task::spawn_blocking(move || Artifacts::open_within(&data_dir, space)).await??;
    let store = Store::open(&config.data_dir.join(DATABASE)).await?;
    let address = listener.local_addr().map_err(ServeError::Listener)?;
    let tokens_required = guard(&store, &config, address).await?;
    let tls = tls.map(Tls::open).transpose()?.map(Arc::new);
    let audit = Arc::new(Audit::open(&config.data_dir).map_err(ServeError::Audit)?);
    artifacts.set_stored_bytes(store.artifact_totals().await?.1);
    let stopping = CancellationToken::new();
    let upkeep = tokio::spawn(upkeep_loop(store.clone(), artifacts.clone(), retention, stopping.clone()));
    let api = Api::new(store.clone(), artifacts.clone(), config.queue_limits(), stopping.clone());
    let flushing = tokio::spawn(flush_loop(Arc::clone(&audit), tls.clone(), stopping.clone()));
    let (grpc, health) = api.clone().routes()?;
    set_health(&health, ServingStatus::Serving).await;
    let watching = tokio::spawn(health_loop(api.clone(), health.clone(), stopping.clone()));
    let mut workers = start_workers(store, artifacts, &config, stopping.clone());
    let rate = Arc::new(Rate::new(config.calls_per_s_max));
    let ended_tokens = EndedTokens::default();
    let tokens = tokio::spawn(token_loop(api.store().clone(), ended_tokens.clone(), stopping.clone()));
    let gate = Gate { api, tokens_required, audit: Arc::clone(&audit), rate, ended_tokens };
    let budget = Arc::new(MemoryBudget::new(config.under_way_bytes_max()));
    let app = http::router(gate, budget, grpc);
    let connections = tokio::spawn(connections::serve(listener, tls, app, stopping.clone(), config.drain_deadline()));

    let early = tokio::select! {
        () = shutdown => None,
        // Workers end only when told to, unless they could not start.
        ended = &mut workers => Some(ended),
    };
    tracing::info!("stopping: running jobs save their state and go back to the queue");
    stopping.cancel();
    watching.await?;
    set_health(&health, ServingStatus::NotServing).await;
    let workers_ended = match early {
        Some(ended) => ended,
        None => match timeout(config.drain_deadline(), &mut workers).await {
            Ok(ended) => ended,
            Err(_) => {
                tracing::warn!("some jobs did not stop in time; their leases run out, and they start again");
                workers.abort();
                Ok(Ok(()))
            }
        },
    };
    connections.await?;
    // A collection may stop anywhere; the next one goes on.
    upkeep.abort();
    drop(upkeep.await);
    flushing.await?;
    tokens.await?;
    audit.flush();
    workers_ended??;
    tracing::info!("stopped");
    Ok(())
}

/// Whether calls need a token; a server that others could abuse does not start.
async fn guard(store: &Store, config: &Config, address: SocketAddr) -> Result<bool, ServeError> {
    let is_local = address.ip().is_loopback();
    if !is_local && config.tls_cert.is_none() && !config.insecure {
        return Err(ServeError::NoTls { address });
    }
    let tokens_required = config.require_tokens || !(is_local || config.insecure);
    if config.insecure && !is_local {
        tracing::warn!(%address, tokens_required, "insecure, as was asked for: others can read along");
    }
    let now_ms = Clock::default().now_ms();
    if tokens_required && !store.tokens().await?.iter().any(|token| token.is_valid(now_ms)) {
        return Err(ServeError::NoTokens);
    }
    Ok(tokens_required)
}

/// Once a second the audit log is flushed; now and then certificates are looked at.
async fn flush_loop(audit: Arc<Audit>, tls: Option<Arc<Tls>>, stopping: CancellationToken) {
    let (mut flush, mut look) = (interval(FLUSH_INTERVAL), interval(tls::LOOK_INTERVAL));
    loop {
        let (audit, tls) = (Arc::clone(&audit), tls.clone());
        let done = tokio::select! {
            () = stopping.cancelled() => return,
            _ = flush.tick() => tokio::task::spawn_blocking(move || audit.flush()).await,
            _ = look.tick() => tokio::task::spawn_blocking(move || tls.iter().for_each(|tls| tls.look())).await,
        };
        if let Err(error) = done {
            tracing::error!(%error, "flushing failed");
        }
    }
}

/// Looks for tokens that are accepted no more.
async fn token_loop(store: Store, ended_tokens: EndedTokens, stopping: CancellationToken) {
    let mut looks = interval(TOKEN_INTERVAL);
    loop {
        tokio::select! {
            () = stopping.cancelled() => return,
            _ = looks.tick() => {}
        }
        if let Err(error) = ended_tokens.look(&store, Clock::default().now_ms()).await {
            tracing::error!(error = &error as &dyn std::error::Error, "tokens could not be looked at");
        }
    }
}

fn start_workers(
    store: Store,
    artifacts: Artifacts,
    config: &Config,
    stopping: CancellationToken,
) -> JoinHandle<Result<(), WorkerError>> {
    tokio::spawn(Worker::new(store, artifacts, config.workers(), Arc::new(OpticsTask)).run(stopping))
}

/// Counts what is stored, and removes what may go.
async fn upkeep_loop(store: Store, artifacts: Artifacts, retention: Retention, stopping: CancellationToken) {
    let (mut count, mut collect) = (interval(COUNT_INTERVAL), interval(COLLECT_INTERVAL));
    loop {
        let outcome = tokio::select! {
            () = stopping.cancelled() => return,
            _ = count.tick() => {
                metrics::sum_up();
                store.artifact_totals().await.map(|(_, bytes)| artifacts.set_stored_bytes(bytes)).map_err(Into::into)
            }
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

/// Says what is so: not serving while the disk is low or the database does not answer.
async fn health_loop(api: Api, health: HealthReporter, stopping: CancellationToken) {
    let mut looks = interval(HEALTH_INTERVAL);
    let mut is_well = true;
    loop {
        tokio::select! {
            () = stopping.cancelled() => return,
            _ = looks.tick() => {}
        }
        let found = api.is_serving().await;
        if found.is_ok() == is_well {
            continue;
        }
        is_well = found.is_ok();
        if let Err(error) = found {
            tracing::error!(error = &error as &dyn std::error::Error, "not serving");
        }
        let status = if is_well { ServingStatus::Serving } else { ServingStatus::NotServing };
        set_health(&health, status).await;
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
