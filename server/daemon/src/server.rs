//! Assembly of the server: store, artifacts, workers, gRPC and HTTP.

use crate::config::{Config, ConfigError};
use crate::database::DatabaseError;
use crate::devices;
use crate::life::Life;
use crate::upkeep::{self, Collected, Retention, UpkeepError};
use crate::workers::{Means, Workers};
use lightpath_api::Api;
use lightpath_api::audit::Audit;
use lightpath_api::connections;
use lightpath_api::http::{self, Admission, EndedTokens, KnownTokens, MemoryBudget, Rate};
use lightpath_api::tls::{self, Tls, TlsError};
use lightpath_artifacts::Artifacts;
use lightpath_gpu::{Device, DeviceChoice, Fault};
use lightpath_metrics as metrics;
use lightpath_rigs::Rigs;
use lightpath_service::{Service, ServiceLimits};
use lightpath_store::{ProcessKind, Store, StoreError};
use lightpath_worker::{JobProgram, WorkerError};
use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinSet};
use tokio::time::interval;
use tokio_util::sync::CancellationToken;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

/// Interval between counts of the stored bytes, for their limit, and between summaries of the metrics.
pub(crate) const COUNT_INTERVAL: Duration = Duration::from_secs(10);
/// Interval between flushes of the audit log. A power failure can lose the lines since the last one.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);
/// Interval between checks of the server's health.
const HEALTH_INTERVAL: Duration = Duration::from_secs(2);
/// Interval between checks for revoked and expired tokens, whose streams must end.
const TOKEN_INTERVAL: Duration = Duration::from_secs(2);
/// Interval between searches for jobs and artifacts to remove.
const COLLECT_INTERVAL: Duration = Duration::from_secs(3600);

/// Why the server could not start or had to stop; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ServeError {
    /// The artifacts cannot be used, for example because another server uses the data folder.
    #[error(transparent)]
    Data(#[from] UpkeepError),
    /// The database cannot be opened, for example because it belongs to other artifacts.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Worker(#[from] WorkerError),
    /// The workers panicked.
    #[error("the workers failed")]
    Panic(#[from] JoinError),
    #[error("the listening address cannot be read")]
    Listener(#[source] io::Error),
    #[error("the listening address cannot be printed")]
    Announcement(#[source] io::Error),
    #[error("the audit log cannot be opened")]
    Audit(#[source] io::Error),
    /// One of two settings that belong together is missing.
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Tls(#[from] TlsError),
    #[error(
        "{address} can be reached from other machines, but there is no TLS: set tls_cert and tls_key, listen on \
         127.0.0.1, or use --insecure"
    )]
    NoTls { address: SocketAddr },
    #[error(
        "calls need a token, but no valid token exists: create one with `lightpathd token create NAME --role admin`, or listen on \
         127.0.0.1"
    )]
    NoTokens,
    /// The graphics card that the settings name cannot be used.
    #[error("device is {choice}, but {fault}; `lightpathd devices` lists what there is")]
    Device { choice: DeviceChoice, fault: Fault },
    #[error("the API's descriptors cannot be read")]
    Reflection(#[from] tonic_reflection::server::Error),
}

/// Does the same as [`run_and_announce`], without an announcement, and runs all jobs in this process.
pub async fn run(
    listener: TcpListener,
    config: Config,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), ServeError> {
    run_and_announce(listener, config, None, |_| Ok(()), shutdown).await
}

/// Serves on `listener` until the future `shutdown` ends, then drains: it accepts no new connections, the health check
/// says NOT_SERVING, streams end with UNAVAILABLE, and running jobs save their state and return to the queue. Draining
/// takes at most `config.drain_deadline_s`.
///
/// `announce` gets the listening address as soon as the server knows that it may serve: it holds the data folder, its
/// database and certificates can be used, and its access is safe. Jobs during which a server died run with `job_program`,
/// in a process of their own.
///
/// # Errors
///
/// [`ServeError`] if the server cannot start or the workers fail.
pub async fn run_and_announce(
    listener: TcpListener,
    mut config: Config,
    job_program: Option<JobProgram>,
    announce: impl FnOnce(SocketAddr) -> io::Result<()> + Send,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), ServeError> {
    metrics::install();
    let (tls, retention) = (config.tls()?, Retention::of(&config));
    let artifacts = open_artifacts(&config).await?;
    make_private(&config.data_dir);
    let store = config.database()?.open(&artifacts).await?;
    tend_keys(&store).await;
    let address = listener.local_addr().map_err(ServeError::Listener)?;
    let tokens_required = check_access(&store, &config, address).await?;
    let (hosts, webhook_origins) = (config.hosts(tokens_required)?, config.webhook_origins()?);
    let tls = tls.map(Tls::open).transpose()?.map(Arc::new);
    let audit = Arc::new(Audit::open(&config.data_dir).map_err(ServeError::Audit)?);
    artifacts.space().set_stored_bytes(store.artifact_totals().await?.1);
    let device = if config.no_worker { Arc::default() } else { open_device(&mut config).await? };
    let life = Life::begin(&store, &artifacts, &config, kind(&config)).await?;
    announce(address).map_err(ServeError::Announcement)?;
    let stopping = CancellationToken::new();
    let upkeep = tokio::spawn(upkeep_loop(store.clone(), artifacts.clone(), retention, stopping.clone()));
    // They end when the server stops.
    let mut loops = JoinSet::new();
    loops.spawn(lightpath_webhooks::run(store.clone(), webhook_origins.clone(), stopping.clone()));
    let limits = service_limits(&config).await?;
    let service = Service::new(&store, &artifacts, &limits, webhook_origins, stopping.clone());
    let api = Api::new(service, store.clone(), artifacts.clone(), stopping.clone()).with_rigs(rigs(&config));
    loops.spawn(flush_loop(Arc::clone(&audit), tls.clone(), stopping.clone()));
    let (grpc, health) = api.clone().routes()?;
    set_health(&health, ServingStatus::Serving).await;
    let watching = tokio::spawn(health_loop(api.clone(), health.clone(), stopping.clone()));
    let means = Means { device, job_program, rigs: api.rigs() };
    let starting = Workers::start(store, artifacts, &config, api.live_pictures(), means, stopping.clone());
    let mut workers = if config.no_worker { None } else { Some(starting.await?) };
    let (ended_tokens, known_tokens) = (EndedTokens::default(), KnownTokens::default());
    loops.spawn(token_loop(api.store().clone(), ended_tokens.clone(), stopping.clone()));
    let rate = shared_rate(&config, (life, api.rigs()), &mut loops, &stopping);
    let records = Arc::clone(&audit);
    let admission = Admission { api, tokens_required, hosts, audit: records, rate, ended_tokens, known_tokens };
    let app = http::router(admission, Arc::new(MemoryBudget::new(config.under_way_bytes_max())), grpc);
    let connections = tokio::spawn(connections::serve(listener, tls, app, stopping.clone(), config.drain_deadline()));

    let early = tokio::select! {
        () = shutdown => None,
        // Workers end before the shutdown only if they could not start.
        Some(ended) = ended_early(workers.as_mut()) => Some(ended),
    };
    tracing::info!("stopping: running jobs save their state and return to the queue");
    stopping.cancel();
    watching.await?;
    set_health(&health, ServingStatus::NotServing).await;
    let workers_ended = match (early, workers) {
        (None, Some(workers)) => workers.drained(config.drain_deadline()).await,
        (early, _) => early.unwrap_or(Ok(Ok(()))),
    };
    connections.await?;
    // A collection may be stopped at any point; the next one continues it.
    upkeep.abort();
    drop(upkeep.await);
    while let Some(ended) = loops.join_next().await {
        ended?;
    }
    audit.flush();
    workers_ended??;
    tracing::info!("stopped");
    Ok(())
}

/// The rigs that may connect: none to a server that runs no jobs.
fn rigs(config: &Config) -> Rigs {
    if config.no_worker { Rigs::refusing() } else { Rigs::default() }
}

fn kind(config: &Config) -> ProcessKind {
    if config.no_worker { ProcessKind::Server } else { ProcessKind::Both }
}

/// The limit on calls, of which this server takes its part as the others come and go.
fn shared_rate(
    config: &Config,
    (life, rigs): (Life, Rigs),
    loops: &mut JoinSet<()>,
    stopping: &CancellationToken,
) -> Arc<Rate> {
    let rate = Arc::new(Rate::new(config.calls_per_s_max));
    let shared = Arc::clone(&rate);
    loops.spawn(life.go_on(rigs, stopping.clone(), move |servers| shared.share_among(servers)));
    rate
}

/// Opens the device of the settings, and gives a process with a card its label.
pub(crate) async fn open_device(config: &mut Config) -> Result<Arc<Device>, ServeError> {
    let choice = config.device;
    devices::open(config).await?.map_err(|fault| ServeError::Device { choice, fault })
}

/// Opens the data folder, and the bucket behind it if there is one.
pub(crate) async fn open_artifacts(config: &Config) -> Result<Artifacts, ServeError> {
    if config.no_worker {
        config.require_shared("no_worker")?;
    }
    let config = config.clone();
    Ok(tokio::task::spawn_blocking(move || upkeep::open_artifacts(&config)).await??)
}

/// The early end of the workers; without workers there is none.
async fn ended_early(workers: Option<&mut Workers>) -> Option<Result<Result<(), WorkerError>, JoinError>> {
    match workers {
        Some(workers) => Some(workers.ended().await),
        None => std::future::pending().await,
    }
}

/// Makes or renews the keys that sign manifests. The server works without them, for example on a full disk, and only
/// signs no manifests then.
async fn tend_keys(store: &Store) {
    if upkeep::tend(store, store.now_ms()).await.is_ok() {
        return;
    }
    // Another server may have done the same at the same time, and finished first.
    if let Err(error) = upkeep::tend(store, store.now_ms()).await {
        tracing::error!(error = &error as &dyn std::error::Error, "the keys that sign manifests could not be renewed");
    }
}

/// Takes the permissions of other users from the files of the data folder, and logs what has changed.
pub(crate) fn make_private(data_dir: &Path) {
    match lightpath_artifacts::make_private(data_dir) {
        Ok(paths) => {
            for path in paths {
                tracing::warn!(path = %path.display(), "other users could read this; now only the user of the server can");
            }
        }
        Err(error) => {
            tracing::warn!(%error, "the permissions of the data folder could not be checked; other users may read it");
        }
    }
}

/// Limits on what clients may use, with the measured speed of this machine.
async fn service_limits(config: &Config) -> Result<ServiceLimits, ServeError> {
    let threads = config.compute_threads;
    let work_per_s = tokio::task::spawn_blocking(move || lightpath_worker::measured_work_per_s(threads)).await?;
    Ok(config.service_limits(work_per_s))
}

/// Decides whether calls need a token. Returns an error if other machines could connect without the required TLS, or if
/// tokens are required and none is valid.
async fn check_access(store: &Store, config: &Config, address: SocketAddr) -> Result<bool, ServeError> {
    let is_local = address.ip().is_loopback();
    if !is_local && config.tls_cert.is_none() && !config.insecure {
        return Err(ServeError::NoTls { address });
    }
    let tokens_required = config.require_tokens || !(is_local || config.insecure);
    if config.insecure && !is_local {
        tracing::warn!(%address, tokens_required, "--insecure is set: other machines can connect without TLS or without tokens");
    }
    let now_ms = store.now_ms();
    if tokens_required && !store.tokens().await?.iter().any(|token| token.is_valid(now_ms)) {
        return Err(ServeError::NoTokens);
    }
    Ok(tokens_required)
}

/// Flushes the audit log every second, and checks at intervals whether the certificates changed.
async fn flush_loop(audit: Arc<Audit>, tls: Option<Arc<Tls>>, stopping: CancellationToken) {
    let (mut flush, mut check) = (interval(FLUSH_INTERVAL), interval(tls::CHECK_INTERVAL));
    loop {
        let (audit, tls) = (Arc::clone(&audit), tls.clone());
        let done = tokio::select! {
            () = stopping.cancelled() => return,
            _ = flush.tick() => tokio::task::spawn_blocking(move || audit.flush()).await,
            _ = check.tick() => tokio::task::spawn_blocking(move || tls.iter().for_each(|tls| tls.reload_if_changed())).await,
        };
        if let Err(error) = done {
            tracing::error!(%error, "flushing the audit log or checking the certificates failed");
        }
    }
}

/// Ends the streams of tokens that were revoked or have expired.
async fn token_loop(store: Store, ended_tokens: EndedTokens, stopping: CancellationToken) {
    let mut ticks = interval(TOKEN_INTERVAL);
    loop {
        tokio::select! {
            () = stopping.cancelled() => return,
            _ = ticks.tick() => {}
        }
        let updated = ended_tokens.update(&store, store.now_ms());
        if let Some(Err(error)) = stopping.run_until_cancelled(updated).await {
            tracing::error!(
                error = &error as &dyn std::error::Error,
                "the check for revoked and expired tokens failed"
            );
        }
    }
}

/// Counts the stored bytes, and removes old uploads, old jobs and unused artifacts.
async fn upkeep_loop(store: Store, artifacts: Artifacts, retention: Retention, stopping: CancellationToken) {
    let (mut count, mut collect) = (interval(COUNT_INTERVAL), interval(COLLECT_INTERVAL));
    loop {
        let outcome = tokio::select! {
            () = stopping.cancelled() => return,
            _ = count.tick() => {
                metrics::summarize();
                count_stored(&store, &artifacts).await
            }
            _ = collect.tick() => async {
                tend_keys(&store).await;
                let collected = retention.collect(&store, &artifacts, store.now_ms()).await?;
                if collected != Collected::default() {
                    let Collected { jobs, artifacts, artifact_bytes } = collected;
                    tracing::info!(jobs, artifacts, artifact_bytes, "removed old jobs and unused artifacts");
                }
                Ok::<(), UpkeepError>(())
            }.await,
        };
        if let Err(error) = outcome {
            tracing::error!(
                error = &error as &dyn std::error::Error,
                "counting or removing old data failed; the server tries again later"
            );
        }
    }
}

/// Counts the stored bytes, and removes uploads that nobody has continued for long.
async fn count_stored(store: &Store, artifacts: &Artifacts) -> Result<(), UpkeepError> {
    artifacts.uploads().remove_old().await?;
    artifacts.space().set_stored_bytes(store.artifact_totals().await?.1);
    Ok(())
}

/// Reports the health: not serving while the disk is almost full or the database does not answer.
async fn health_loop(api: Api, health: HealthReporter, stopping: CancellationToken) {
    let mut ticks = interval(HEALTH_INTERVAL);
    let mut is_healthy = true;
    loop {
        tokio::select! {
            () = stopping.cancelled() => return,
            _ = ticks.tick() => {}
        }
        let Some(found) = stopping.run_until_cancelled(api.is_serving()).await else { return };
        api.set_health(found.as_ref().map_err(ToString::to_string).copied());
        if found.is_ok() == is_healthy {
            continue;
        }
        is_healthy = found.is_ok();
        if let Err(error) = found {
            tracing::error!(error = &error as &dyn std::error::Error, "not serving");
        }
        let status = if is_healthy { ServingStatus::Serving } else { ServingStatus::NotServing };
        set_health(&health, status).await;
    }
}

async fn set_health(health: &HealthReporter, status: ServingStatus) {
    use lightpath_proto::v1::{
        artifact_service_server, dataset_service_server, display_service_server, job_service_server,
        kernel_service_server,
    };
    // The empty name stands for the whole server.
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
