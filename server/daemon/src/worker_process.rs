//! A process that only runs jobs. It needs the database and the bucket of the artifacts, and no other process.

use crate::config::Config;
use crate::life::Life;
use crate::server::{COUNT_INTERVAL, ServeError, make_private, open_artifacts, open_device};
use crate::workers::{Means, Workers};
use lightpath_api::http::serve_worker_status;
use lightpath_artifacts::Artifacts;
use lightpath_media::live_pictures::LivePictures;
use lightpath_metrics as metrics;
use lightpath_rigs::Rigs;
use lightpath_store::{ProcessKind, Store};
use lightpath_worker::JobProgram;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio::time::interval;
use tokio_util::sync::CancellationToken;

/// Runs jobs until the future `shutdown` ends, then drains: running jobs save their state and return to the queue.
/// Draining takes at most `config.drain_deadline_s`. Health and metrics are at `status`. Jobs during which a process died
/// run with `job_program`, in a process of their own.
///
/// # Errors
///
/// [`ServeError`] if the workers cannot start or fail.
pub async fn run(
    status: Option<TcpListener>,
    mut config: Config,
    job_program: Option<JobProgram>,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), ServeError> {
    config.require_shared("lightpathd worker")?;
    metrics::install();
    let artifacts = open_artifacts(&config).await?;
    make_private(&config.data_dir);
    let store = config.database()?.open(&artifacts).await?;
    let stopping = CancellationToken::new();
    // They end when the process stops.
    let mut loops = JoinSet::new();
    loops.spawn(count_loop(store.clone(), artifacts.clone(), stopping.clone()));
    let device = open_device(&mut config).await?;
    let life = Life::begin(&store, &artifacts, &config, ProcessKind::Worker).await?;
    loops.spawn(life.go_on(Rigs::refusing(), stopping.clone(), drop));
    if let Some(listener) = status {
        let answers = serve_worker_status(listener, store.clone(), artifacts.clone(), stopping.clone());
        loops.spawn(async {
            if let Err(error) = answers.await {
                tracing::error!(%error, "health and metrics can no longer be asked for");
            }
        });
    }
    let (pictures, means) = (LivePictures::default(), Means { device, job_program, rigs: Rigs::refusing() });
    let mut workers = Workers::start(store, artifacts, &config, pictures, means, stopping.clone()).await?;
    tracing::info!("working");
    let early = tokio::select! {
        () = shutdown => None,
        ended = workers.ended() => Some(ended),
    };
    tracing::info!("stopping: running jobs save their state and return to the queue");
    stopping.cancel();
    let ended = match early {
        Some(ended) => ended,
        None => workers.drained(config.drain_deadline()).await,
    };
    while let Some(ended) = loops.join_next().await {
        ended?;
    }
    ended??;
    tracing::info!("stopped");
    Ok(())
}

/// Counts the stored bytes, for their limit.
async fn count_loop(store: Store, artifacts: Artifacts, stopping: CancellationToken) {
    let mut count = interval(COUNT_INTERVAL);
    loop {
        tokio::select! {
            () = stopping.cancelled() => return,
            _ = count.tick() => {}
        }
        metrics::summarize();
        match stopping.run_until_cancelled(store.artifact_totals()).await {
            None => return,
            Some(Ok((_, bytes))) => artifacts.space().set_stored_bytes(bytes),
            Some(Err(error)) => {
                let error: &dyn std::error::Error = &error;
                tracing::error!(error, "the stored bytes could not be counted");
            }
        }
    }
}
