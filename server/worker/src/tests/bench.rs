//! Test bench: a store and artifacts in a temporary folder, a display, and workers.

use super::super::*;
use lightpath_domain::display::Display;
use lightpath_domain::job::{Estimate, JobSpec, NewJob, Scheduling};
use lightpath_domain::units::Distance;
use tempfile::TempDir;
use tokio::task::JoinHandle;

pub(super) const DISTANCE: Distance = Distance { nm: 4_000_000 };

/// Present time \[ms since 1970\].
pub(super) fn now_ms() -> i64 {
    Clock::default().now_ms()
}

pub(super) struct Bench {
    pub(super) store: Store,
    pub(super) artifacts: Artifacts,
    _folder: TempDir,
}

impl Bench {
    pub(super) async fn new(display: Display) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("lightpath.db")).await.unwrap();
        let artifacts = Artifacts::open(folder.path()).unwrap();
        store.create_display(&display, 1).await.unwrap();
        Self { store, artifacts, _folder: folder }
    }

    /// Submits a job and returns its id.
    pub(super) async fn submit(&self, request_id: &str, spec: JobSpec, attempts_max: u32) -> String {
        let scheduling = Scheduling::default();
        let (request_id, estimate) = (request_id.to_owned(), Estimate::default());
        let new = NewJob { spec, request_id, priority: 0, attempts_max, scheduling, estimate };
        self.store.submit(&new, now_ms(), 1000).await.unwrap().0.id
    }

    pub(super) fn start(&self, config: WorkerConfig, task: impl Task) -> Working {
        self.start_worker(Worker::new(self.store.clone(), self.artifacts.clone(), config, Arc::new(task)))
    }

    pub(super) fn start_worker(&self, worker: Worker) -> Working {
        let drain = CancellationToken::new();
        let running = tokio::spawn(worker.run(drain.clone()));
        Working { drain, running }
    }

    /// Starts workers without the recovery of orphans, as if they had been running all the time.
    pub(super) fn start_unrecovered(&self, config: WorkerConfig, task: impl Task) -> Working {
        let drain = CancellationToken::new();
        let worker = Worker::new(self.store.clone(), self.artifacts.clone(), config, Arc::new(task));
        let running = tokio::spawn(worker.work(drain.clone()));
        Working { drain, running }
    }

    /// Waits until the condition holds for the job, and returns the job.
    pub(super) async fn until(&self, id: &str, condition: impl Fn(&Job) -> bool) -> Job {
        let mut changes = self.store.subscribe_job_changes();
        loop {
            let job = self.store.job(id).await.unwrap();
            if condition(&job) {
                return job;
            }
            drop(changes.recv().await);
        }
    }

    pub(super) async fn ended(&self, id: &str) -> Job {
        self.until(id, |job| job.state.has_ended()).await
    }
}

/// Running workers.
pub(super) struct Working {
    drain: CancellationToken,
    running: JoinHandle<Result<(), WorkerError>>,
}

impl Working {
    /// Drains the workers and waits for their end.
    pub(super) async fn stop(self) {
        self.drain.cancel();
        self.running.await.unwrap().unwrap();
    }
}
