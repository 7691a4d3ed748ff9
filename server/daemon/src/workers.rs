//! The workers of a process: their start, and their end within the time that they have.

use crate::config::Config;
use crate::upkeep::Result;
use lightpath_artifacts::Artifacts;
use lightpath_gpu::Device;
use lightpath_media::live_pictures::LivePictures;
use lightpath_rigs::Rigs;
use lightpath_store::Store;
use lightpath_worker::{JobProgram, OpticsTask, Worker, WorkerConfig, WorkerError};
use std::sync::Arc;
use std::time::Duration;
use tokio::task::{JoinError, JoinHandle};
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

/// Longest time for returning the jobs to the queue that did not stop in time, while the database may be away.
const RELEASE_MAX: Duration = Duration::from_secs(2);

/// What the workers run jobs with.
#[derive(Debug)]
pub(crate) struct Means {
    /// What computes holograms.
    pub(crate) device: Arc<Device>,
    /// What runs the jobs during which a server died.
    pub(crate) job_program: Option<JobProgram>,
    /// The rigs at the benches that are connected to this process.
    pub(crate) rigs: Rigs,
}

/// The running workers of this process.
#[derive(Debug)]
pub(crate) struct Workers {
    running: JoinHandle<Result<(), WorkerError>>,
    store: Store,
    /// Id of the process, if others share the database.
    process: Option<String>,
}

impl Workers {
    /// Starts the workers. They end when `stopping` is cancelled. They run jobs with `means`.
    pub(crate) async fn start(
        store: Store,
        artifacts: Artifacts,
        config: &Config,
        live_pictures: LivePictures,
        means: Means,
        stopping: CancellationToken,
    ) -> Result<Self> {
        // Two processes cannot hold the same data folder, so its identity is that of the process.
        let process = if store.is_shared() { Some(artifacts.folder_identity().await?) } else { None };
        let config = WorkerConfig { process: process.clone(), labels: config.labels()?, ..config.workers() };
        let worker = Worker::new(store.clone(), artifacts, config, Arc::new(OpticsTask));
        let worker = worker.computing_on(means.device).at_benches(means.rigs);
        let worker = worker.showing(live_pictures).isolating(means.job_program);
        Ok(Self { running: tokio::spawn(worker.run(stopping)), store, process })
    }

    /// Waits until the workers end by themselves, which they do only if they could not start.
    pub(crate) async fn ended(&mut self) -> Result<Result<(), WorkerError>, JoinError> {
        (&mut self.running).await
    }

    /// Waits until the workers have ended, at most until the deadline.
    pub(crate) async fn drained(mut self, deadline: Duration) -> Result<Result<(), WorkerError>, JoinError> {
        if let Ok(ended) = timeout(deadline, &mut self.running).await {
            return ended;
        }
        self.running.abort();
        drop(self.running.await);
        release_unfinished(&self.store, self.process.as_deref()).await;
        Ok(Ok(()))
    }
}

/// Returns the jobs to the queue that did not stop in time. Without this, the next start would take the stop for a
/// death of the server. The computations still run, but can write nothing more.
async fn release_unfinished(store: &Store, process: Option<&str>) {
    match timeout(RELEASE_MAX, store.release_all(process, store.now_ms())).await {
        Ok(Ok(jobs)) => {
            for job in jobs {
                tracing::warn!(job = job.id, "the job did not stop in time; it continues from its last saved state");
            }
        }
        Ok(Err(error)) => {
            let error: &dyn std::error::Error = &error;
            tracing::error!(error, "jobs that did not stop in time could not be returned to the queue");
        }
        Err(_) => tracing::error!("the database did not take back the jobs that did not stop in time"),
    }
}
